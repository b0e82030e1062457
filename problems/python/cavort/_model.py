"""A compiled model, and many points of its dynamics at once."""

from __future__ import annotations

import difflib
import os
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _library
from ._library import Array, Options, check, failure, ffi, lib, new_error, pointer_to, text

# arrays of the model, by the member that counts them where that is not n and their name
_COUNTS = {"dof": "nv", "q0": "nq"}
KINDS = ("body", "joint", "geom", "site", "tendon", "actuator", "key", "sensor", "equality", "link", "dof", "pair")


class Derivatives(NamedTuple):
    """Derivatives of u = inverse(q, v, v_next): [nv, nv] of a point, [n, nv, nv] of many; [..., i, j] = du_i/dx_j.

    Positions are differentiated in the tangent, q (+) e_j.
    """

    dq: Array
    dv: Array
    dv_next: Array


class Model:
    """A robot, character or scene, read from an MJCF or URDF file. Immutable; any number of threads may share it.

    nq, nv, nu: sizes of q (configuration; a free joint has x y z and a unit quaternion w x y z), of v (velocity) and of
    the efforts. Units are m, kg, s, rad, N.

    body, joint, geom, site, tendon, actuator, sensor, equality, link, dof, pair: the arrays of include/cavort/model.h,
    as structured arrays that look at the library's memory and cannot be written: model.joint["range"] is [njoint, 2].
    """

    name: str
    path: str | None
    floating: bool
    nq: int
    nv: int
    nu: int
    timestep: float
    mass: float
    body: NDArray[Any]
    joint: NDArray[Any]
    geom: NDArray[Any]
    site: NDArray[Any]
    tendon: NDArray[Any]
    actuator: NDArray[Any]
    sensor: NDArray[Any]
    equality: NDArray[Any]
    link: NDArray[Any]
    dof: NDArray[Any]
    pair: NDArray[Any]

    def __init__(self, path: str, *, floating: bool = False, overlaps: bool = False) -> None:
        """Reads a file. floating: the root link of a URDF floats. overlaps: geoms that overlap at rest do not push, as in plans."""
        error = new_error()
        self._take(_read(lib.cav_model_load_with(str(path).encode(), load_options(floating, overlaps), error), error), None)
        self.path, self.floating = os.path.abspath(path), floating

    @classmethod
    def parse(cls, text: str, folder: str = ".", *, floating: bool = False, overlaps: bool = False) -> "Model":
        """Reads MJCF or URDF from a text; files that it names are sought from folder."""
        error, model = new_error(), cls.__new__(cls)
        options = load_options(floating, overlaps)
        model._take(_read(lib.cav_model_parse(text.encode(), str(folder).encode(), options, error), error), None)
        return model

    @classmethod
    def _of(cls, pointer: Any, owner: Any) -> "Model":
        # the model of a problem, which keeps it
        model = cls.__new__(cls)
        model._take(ffi.cast("cav_model *", pointer), owner)
        return model

    def _take(self, pointer: Any, owner: Any) -> None:
        self._c = pointer
        self._owner = owner
        self.path, self.floating = None, False
        self.name = text(pointer.name)
        self.nq, self.nv, self.nu = pointer.nq, pointer.nv, pointer.nu
        self.timestep, self.mass = pointer.timestep, pointer.mass

    def __repr__(self) -> str:
        return f"<cavort.Model {self.name!r}: nq {self.nq}, nv {self.nv}, nu {self.nu}, {self.mass:.4g} kg>"

    def __getattr__(self, name: str) -> NDArray[Any]:
        if name not in KINDS:
            raise AttributeError(f"a model has no {name!r}")
        count = getattr(self._c, _COUNTS.get(name, "n" + name))
        return _library.view(self, getattr(self._c, name), (count,))

    @property
    def q0(self) -> Array:
        """The configuration of the file [nq]."""
        return _library.view(self, self._c.q0, (self.nq,))

    @property
    def gravity(self) -> Array:
        """m/s^2 [3]."""
        return _library.view(self, self._c.gravity, (3,))

    @property
    def options(self) -> Options:
        """A copy of the contact law that evaluations start with."""
        return _library.contact_options(ffi.new("cav_options *", self._c.options))

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the file asks for and the library leaves aside, with file and line."""
        return tuple(text(self._c.warning[i]) for i in range(self._c.nwarning))

    def names(self, kind: str) -> tuple[str, ...]:
        """Names of all objects of a kind ("body", "joint", "actuator", ...) in their order; "" where there is none."""
        self._kind(kind)
        array, count = getattr(self._c, kind), getattr(self._c, "n" + kind)
        return tuple(text(array[i].name) for i in range(count))

    def index(self, kind: str, name: str) -> int:
        """Number of the object of a kind and name; KeyError with what is near."""
        found = int(lib.cav_object_find(self._c, self._kind(kind), name.encode()))
        if found < 0:
            near = difflib.get_close_matches(name, self.names("body" if kind == "xbody" else kind), 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise KeyError(f"the model {self.name!r} has no {kind} {name!r}{hint}")
        return found

    @staticmethod
    def _kind(kind: str) -> int:
        return _library.choose("cav_object_type", kind, "kind of object")

    def named(self, kind: str, names: str) -> tuple[int, int]:
        """Kind (cav_object_type) and number of the first object that has one of the names, as problem files have them.

        Several names are separated by |; of bodies also roles, such as "right foot". KeyError with what is near.
        """
        error, found = new_error(), ffi.new("cav_object_type *", self._kind(kind))
        own = int(lib.cav_object_find(self._c, found[0], names.encode()))
        if own >= 0:
            return int(found[0]), own
        number = int(lib.cav_object_named(self._c, self._scratch(), names.encode(), found, error))
        if number < 0:
            raise KeyError(text(error.text))
        return int(found[0]), number

    def _scratch(self) -> Any:
        state = lib.cav_state_new(self._c)
        if not state:
            raise MemoryError("no memory for a state")
        return ffi.gc(state, lib.cav_state_free)

    def stand(self) -> Array:
        """A configuration that stands [nq], of any model with feet: its keyframe "stand" or "home", or one found."""
        q, error = np.empty(self.nq), new_error()
        check(lib.cav_configuration_stand(self._c, self._scratch(), pointer_to(q), error), "a posture that stands", error)
        return q

    def posture(self, name: str) -> Array:
        """A posture by name [nq]: stand, squat, kneel, half-kneel, sit, sit-floor, all-fours, lie-back, lie-front or
        lie-side of a biped, stand or lie of a quadruped."""
        q, error = np.empty(self.nq), new_error()
        status = lib.cav_configuration_posture(self._c, self._scratch(), name.encode(), pointer_to(q), error)
        check(status, f"the posture {name!r}", error)
        return q

    def to_floor(self, q: ArrayLike, rise: float | None = None) -> Array:
        """q [nq] with every tree that can be raised or lowered on what it stands on; rise: so many m above planes."""
        moved, error = _library.as_array(q, (self.nq,), "q").copy(), new_error()
        height = ffi.NULL if rise is None else ffi.new("double *", rise)
        status = lib.cav_configuration_to_floor(self._c, self._scratch(), height, pointer_to(moved), error)
        check(status, "the way to the floor", error)
        return moved

    def clip(self, q: ArrayLike) -> Array:
        """q [nq] with hinges and slides within their ranges."""
        moved = _library.as_array(q, (self.nq,), "q").copy()
        lib.cav_configuration_clip(self._c, pointer_to(moved))
        return moved

    def key(self, name: str) -> Array:
        """Configuration of a keyframe [nq]."""
        return _library.view(self, self._c.key[self.index("key", name)].q, (self.nq,))

    def q_slice(self, joint: str) -> slice:
        """Where a joint's coordinates stand in q."""
        of = self._c.joint[self.index("joint", joint)]
        length = {lib.CAV_JOINT_FREE: 7, lib.CAV_JOINT_BALL: 4}.get(of.type, 1)
        return slice(of.q, of.q + length)

    def v_slice(self, joint: str) -> slice:
        """Where a joint's velocities stand in v and u."""
        of = self._c.joint[self.index("joint", joint)]
        length = {lib.CAV_JOINT_FREE: 6, lib.CAV_JOINT_BALL: 3}.get(of.type, 1)
        return slice(of.dof, of.dof + length)

    def integrate(self, q: ArrayLike, v: ArrayLike, h: float) -> Array:
        """q (+) h v: q [nq] moved along v [nv] for h seconds; quaternions stay unit."""
        q, v = _library.as_array(q, (self.nq,), "q"), _library.as_array(v, (self.nv,), "v")
        out = np.empty(self.nq)
        lib.cav_integrate(self._c, pointer_to(q), pointer_to(v), h, pointer_to(out))
        return out

    def difference(self, q0: ArrayLike, q1: ArrayLike, h: float = 1.0) -> Array:
        """The velocity [nv] that takes q0 [nq] to q1 [nq] in h seconds."""
        q0, q1 = _library.as_array(q0, (self.nq,), "q0"), _library.as_array(q1, (self.nq,), "q1")
        out = np.empty(self.nv)
        lib.cav_difference(self._c, pointer_to(q0), pointer_to(q1), h, pointer_to(out))
        return out

    def inverse(
        self, q: ArrayLike, v: ArrayLike, v_next: ArrayLike, *, options: Options | None = None, threads: int = 1
    ) -> Array:
        """Forces u that take v to v_next in one step at q, contacts included.

        q [nq], v, v_next [nv] -> u [nv], or of many points q [n, nq], v, v_next [n, nv] -> u [n, nv]; N or N m. The
        result does not depend on the number of threads. options: a contact law of its own (Model.options).
        """
        points = _Points(self, q, v, v_next, "v_next")
        u = np.empty((points.n, self.nv))
        points.run(lib.cav_inverse_batch, options, (threads,), (pointer_to(u),), "the inverse")
        return points.shaped(u)

    def forward(
        self, q: ArrayLike, v: ArrayLike, u: ArrayLike, *, options: Options | None = None, threads: int = 1
    ) -> Array:
        """One step forward: v_next of u, the inverse of inverse(), shapes as there.

        The configuration afterwards is integrate(q, v_next, options.timestep).
        """
        points = _Points(self, q, v, u, "u")
        v_next = np.empty((points.n, self.nv))
        points.run(lib.cav_forward_batch, options, (threads,), (pointer_to(v_next),), "the forward step")
        return points.shaped(v_next)

    def derivatives(
        self,
        q: ArrayLike,
        v: ArrayLike,
        v_next: ArrayLike,
        *,
        method: str = "analytic",
        options: Options | None = None,
        threads: int = 1,
    ) -> Derivatives:
        """Derivatives of inverse(); method: "analytic", or "forward" or "centred" differences."""
        points = _Points(self, q, v, v_next, "v_next")
        found = [np.empty((points.n, self.nv, self.nv)) for _ in range(3)]
        chosen = _library.choose("cav_derivative", method, "method")
        if chosen == lib.CAV_DERIVATIVE_ANALYTIC and lib.cav_derivatives_missing(self._c):
            missing = text(lib.cav_derivatives_missing(self._c))
            raise _library.Error(f"no analytic derivatives of {missing}: take method='centred'", "not supported")
        out = tuple(pointer_to(d.reshape(-1)) for d in found)
        points.run(lib.cav_inverse_jacobian_batch, options, (chosen, threads), out, "derivatives")
        return Derivatives(*(points.shaped(d) for d in found))


def load_options(floating: bool, overlaps: bool) -> Any:
    """A cav_load_options."""
    options = ffi.new("cav_load_options *", lib.cav_load_options_default())
    options.floating, options.overlaps = int(floating), int(overlaps)
    return options


def _read(pointer: Any, error: Any) -> Any:
    # a model of the library, which goes with what Python makes of it
    if not pointer:
        raise failure(error.status, "the model", error)
    return ffi.gc(pointer, lib.cav_model_free)


class _Points:
    """Points of a caller, one or many, as a batch takes them."""

    def __init__(self, model: Model, q: ArrayLike, v: ArrayLike, given: ArrayLike, what: str) -> None:
        self.model = model
        configuration = np.asarray(q, dtype=np.float64)
        self.single = configuration.ndim < 2
        self.n = 1 if self.single else configuration.shape[0]
        lead = () if self.single else (self.n,)
        self.q = _library.as_array(configuration, (*lead, model.nq), "q")
        self.v = _library.as_array(v, (*lead, model.nv), "v")
        self.given = _library.as_array(given, (*lead, model.nv), what)

    def run(self, call: Any, options: Options | None, head: tuple[Any, ...], out: tuple[Any, ...], what: str) -> None:
        status = np.zeros(self.n, dtype=np.int32)
        given = tuple(ffi.from_buffer("double[]", x) for x in (self.q, self.v, self.given))
        law = options._struct if options is not None else ffi.NULL
        done = call(self.model._c, law, *head, self.n, *given, *out, ffi.from_buffer("cav_status[]", status))
        failed = np.flatnonzero(status)
        if done and failed.size:
            row = "" if self.single else f" of row {failed[0]} ({failed.size} of {self.n} fail)"
            raise failure(int(status[failed[0]]), what + row)
        check(done, what)

    def shaped(self, array: Array) -> Array:
        one: Array = array[0]
        return one if self.single else array
