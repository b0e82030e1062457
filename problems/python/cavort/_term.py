"""Terms of a problem: what a motion costs and what it must hold; quantities of one's own."""

from __future__ import annotations

import math
from typing import Any, Callable, NamedTuple, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _library
from ._library import Array, check, ffi, lib, pointer_to, text
from ._model import Model
from ._state import State

OBJECTS = ("body", "xbody", "site", "geom", "joint", "tendon", "actuator")


class Knot(NamedTuple):
    """What a quantity of one's own is read off: one knot of a motion, during the call only.

    state holds the evaluation there (poses, contacts, sensors; evaluate nothing with it, and do not keep it). Its model is that
    of the plan: without trees that nothing touches, so look up numbers by name there. time and timestep in s,
    q [nq], v, v_next [nv] (accelerations are (v_next - v)/timestep), u [nv], N or N m.
    """

    state: State
    time: float
    timestep: float
    q: Array
    v: Array
    v_next: Array
    u: Array


class Jacobian(NamedTuple):
    """Derivatives of dim values, zeros at first, to be filled in: by the tangent of q, v, v_next, u [dim, nv] each, and
    by impulses [dim, ncontact, 6]. What a value has of one through another is added by the library."""

    dq: Array
    dv: Array
    dv_next: Array
    du: Array
    dimpulse: Array


class Quantity:
    """A quantity of one's own: value(knot) -> dim numbers, used in cost() and constraint() like a built-in one.

    jacobian(knot, out): adds derivatives to the arrays of out; None: differences of value, 3 nv evaluations a knot. reads: the
    last thing it looks at, "position" (q), "velocity" (q, v_next) or "acceleration" (anything). within: tolerance of its
    goals that state none, 0: there is none. An exception in a callable ends the solve and comes out of solve(). Solves
    call from all their threads, so callables change nothing but what they return, and the same knot gives the same numbers.
    """

    def __init__(
        self,
        name: str,
        dim: int,
        value: Callable[[Knot], ArrayLike],
        jacobian: Callable[[Knot, Jacobian], None] | None = None,
        *,
        unit: str = "",
        reads: str = "acceleration",
        within: float = 0.0,
    ) -> None:
        self.name, self.dim, self.value, self.jacobian = name, dim, value, jacobian
        self.raised: BaseException | None = None
        self._text = ffi.new("char[]", name.encode()), ffi.new("char[]", unit.encode())
        self._call = (
            ffi.callback("cav_user_value", self._value, onerror=self._raise, error=1),
            ffi.callback("cav_user_jacobian", self._jacobian, onerror=self._raise, error=1),
        )
        self._c = ffi.new("cav_user_quantity *")
        self._c.name, self._c.unit = self._text
        self._c.dim, self._c.within = dim, within
        self._c.reads = _library.choose("cav_sensor_stage", reads, "reads")
        self._c.value = self._call[0]
        self._c.jacobian = self._call[1] if jacobian else ffi.NULL

    def _raise(self, kind: Any, raised: BaseException, trace: Any) -> None:
        self.raised = self.raised or raised

    def _knot(self, view: Any) -> Knot:
        # a plan may leave out trees that nothing touches: the model is the view's. Copies, since its memory ends with the call
        model = Model._of(view.model, None)
        q, v, v_next, u = (
            _library.view(None, pointer, (n,)).copy()
            for pointer, n in ((view.q, model.nq), (view.v, model.nv), (view.v_next, model.nv), (view.u, model.nv))
        )
        return Knot(State._of(model, view.state), view.time, view.timestep, q, v, v_next, u)

    def _value(self, context: Any, view: Any, out: Any) -> int:
        found = np.asarray(self.value(self._knot(view)), dtype=np.float64).reshape(-1)
        if found.shape != (self.dim,):
            raise ValueError(f"the quantity {self.name!r} gave {found.size} values, it has {self.dim}")
        ffi.memmove(out, pointer_to(np.ascontiguousarray(found)), 8 * self.dim)
        return 0

    def _jacobian(self, context: Any, view: Any, out: Any) -> int:
        assert self.jacobian
        nv, contacts = view.model.nv, view.state.ncontact
        dq, dv, dv_next, du = (np.zeros((self.dim, nv)) for _ in range(4))
        found = Jacobian(dq, dv, dv_next, du, np.zeros((self.dim, contacts, 6)))
        self.jacobian(self._knot(view), found)
        for to, array in zip((out.dq, out.dv, out.dv_next, out.du, out.dimpulse), found):
            if array.size:
                ffi.memmove(to, pointer_to(array.reshape(-1)), array.nbytes)
        return 0

    def check(self, state: State, q: ArrayLike, v: ArrayLike, v_next: ArrayLike) -> float:
        """Largest relative difference of the Jacobian from centred differences of value at a point."""
        nq, nv = state.model.nq, state.model.nv
        given = [_library.as_array(*x) for x in ((q, (nq,), "q"), (v, (nv,), "v"), (v_next, (nv,), "v_next"))]
        worst, error = ffi.new("double *"), _library.new_error()
        arrays = [pointer_to(x) for x in given]
        status = lib.cav_user_quantity_check(self._c, state._c, *arrays, worst, ffi.NULL, error)
        surface([self])
        check(status, f"the Jacobian of {self.name!r}", error)
        return float(worst[0])


def surface(quantities: Sequence[Quantity]) -> None:
    """Raises what a callable raised inside the library."""
    raised = [quantity.raised for quantity in quantities if quantity.raised]
    for quantity in quantities:
        quantity.raised = None
    if raised and raised[0]:
        raise raised[0]


class Term:
    """A cost or a constraint of a problem; Problem.cost and Problem.constraint make them.

    weight, scale, within, lower, upper, name may be changed, and target [..., dim].
    """

    def __init__(self, model: Model, struct: Any, quantity: Quantity | None = None, keep: Any = None) -> None:
        self._model = model
        self._c = ffi.new("cav_term *", struct)
        self._keep = keep
        self._target: Any = None
        self._times: Any = None
        self._name: Any = None
        self._user = quantity

    def __repr__(self) -> str:
        rule = text(lib.cav_quantity_rule_of(self._c.quantity).name)
        what = f"weight {self.weight:g}" if self._c.use == lib.CAV_USE_COST else "hard"
        return f"<cavort.Term {self.name or rule!r}: {rule}, {what}>"

    weight, scale, within, lower, upper = (
        property(lambda self, n=n: getattr(self._c, n), lambda self, x, n=n: setattr(self._c, n, x))  # type: ignore
        for n in ("weight", "scale", "within", "lower", "upper")
    )

    @property
    def name(self) -> str:
        """For logs and reports."""
        return text(self._c.name)

    @name.setter
    def name(self, name: str) -> None:
        self._name = ffi.new("char[]", name.encode())
        self._c.name = self._name

    @property
    def hard(self) -> bool:
        """Whether it is a constraint."""
        return bool(self._c.use != lib.CAV_USE_COST)

    @property
    def quantity(self) -> Quantity | str:
        """One's own, or the name of a built-in one."""
        return self._user or text(lib.cav_quantity_rule_of(self._c.quantity).name)

    @property
    def dim(self) -> int:
        """Numbers of a target."""
        of, quantity = lib.cav_quantity_rule_of(self._c.quantity), self._c.quantity
        if quantity == lib.CAV_QUANTITY_SENSOR:
            return int(self._c.sensor.dim)
        if self._user:
            return self._user.dim
        return {lib.CAV_OF_POSTURE: self._model.nq, lib.CAV_OF_RATE: self._model.nv}.get(of.of, 0)

    @property
    def target(self) -> Array | None:
        """What the values shall be, a copy: [dim], or [n, dim] of n waypoints; None: zeros, or the goal posture."""
        if not self._c.target:
            return None
        rows = (self._c.nwaypoint,) if self._c.nwaypoint else ()
        return _library.view(self, self._c.target, (*rows, self.dim)).copy()

    @target.setter
    def target(self, target: ArrayLike) -> None:
        rows = (self._c.nwaypoint,) if self._c.nwaypoint else ()
        # a new array: solutions keep the one before
        self._target = _library.as_array(np.array(target, dtype=np.float64), (*rows, self.dim), "target")
        self._c.target = pointer_to(self._target.reshape(-1))

    def _waypoints(self, times: Sequence[float]) -> None:
        self._times = np.array(times, dtype=np.float64)
        self._c.nwaypoint = len(self._times)
        self._c.waypoint_time = pointer_to(self._times)

    def _held(self) -> tuple[Any, ...]:
        # what the struct points at
        return self._keep, self._target, self._times, self._name, self._user


def quantity_of(name: str | Quantity) -> int:
    """The number of a quantity: of the built-in one of a name, as problem files have it, or of one's own."""
    if isinstance(name, Quantity):
        return int(lib.CAV_QUANTITY_USER)
    known = [text(lib.cav_quantity_rule_of(i).name) for i in range(lib.CAV_QUANTITY_USER)]
    if name not in known:
        raise ValueError(f"no quantity {name!r}; there are {', '.join(n for n in known if n)}")
    return known.index(name)


def sensor_of(model: Model, sensor: str | None, kind: str | None, objects: dict[str, str]) -> Any:
    """A cav_sensor: of the model by its name, or of a type that looks at one object."""
    if sensor is not None:
        if kind is not None or objects:
            raise ValueError("sensor names one of the model: give that, or type and what it looks at")
        return model._c.sensor[model.index("sensor", sensor)]
    known = [text(lib.cav_sensor_rule_of(i).name) for i in range(lib.CAV_SENSOR_TYPES)]
    if kind not in known:
        raise ValueError(f"type: expected a type of sensor ({', '.join(known)}), got {kind!r}")
    if len(objects) > 1:
        raise ValueError(f"a sensor looks at one object, got {', '.join(objects)}")
    of, number = lib.CAV_OBJECT_BODY, 0
    for what, name in objects.items():
        of, number = model.named(what, name)
    made, error = ffi.new("cav_sensor *"), _library.new_error()
    if lib.cav_sensor_of(model._c, known.index(kind), of, number, made, error):
        raise ValueError(text(error.text))
    return made[0]


def select_dofs(model: Model, dofs: int, joint: int) -> NDArray[np.bool_]:
    """Which dofs a term over velocities or postures selects [nv]."""
    of = model.dof["joint"]
    free = model.joint["type"][of] == lib.CAV_JOINT_FREE
    place = np.arange(model.nv) - model.joint["dof"][of]
    chosen: dict[int, NDArray[np.bool_]] = {
        lib.CAV_DOFS_ALL: np.ones(model.nv, dtype=bool),
        lib.CAV_DOFS_ROOT_LINEAR: free & (place < 3),
        lib.CAV_DOFS_ROOT_ANGULAR: free & (place >= 3),
        lib.CAV_DOFS_JOINTS: ~free,
        lib.CAV_DOFS_DRIVEN: ~free & (model.link["driven"][model.joint["link"][of]] != 0),
        lib.CAV_DOFS_ONE: of == joint,
    }
    return chosen[dofs]


def tolerance(within: float | str) -> float:
    """A tolerance as C has it: "any" is infinite."""
    if isinstance(within, str) and within != "any":
        raise ValueError(f"within: expected a number or 'any', got {within!r}")
    return math.inf if isinstance(within, str) else float(within)
