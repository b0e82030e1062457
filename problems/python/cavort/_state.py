"""One point of the dynamics, with all that is known there: poses, contacts, sensors, derivatives."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _library
from ._library import Array, Options, check, ffi, lib, pointer_to
from ._model import Derivatives, Model


class Pose(NamedTuple):
    """Where something is: world = rotation @ local + pos."""

    pos: Array
    rotation: Array
    quat: Array


class Momentum(NamedTuple):
    """Of all that moves, world axes: centre of mass (m), its velocity (m/s), angular momentum about it (kg m^2/s)."""

    com: Array
    velocity: Array
    angular: Array


class Actuation(NamedTuple):
    """What actuators make of u: the part that none can give [nv], N or N m, and the efforts [nu] of the rest."""

    residual: Array
    effort: Array


class State:
    """What one thread evaluates of a model at one point.

    options: the contact law, the model's at first; change it at will. time: s, what a clock reads. position(), inverse()
    and forward() fill the state; what follows reads it.
    """

    def __init__(self, model: Model) -> None:
        pointer = lib.cav_state_new(model._c)
        if not pointer:
            raise MemoryError("no memory for a state")
        # the model outlives the state, in whichever order Python lets them go
        self._take(model, ffi.gc(pointer, lambda state, model=model: lib.cav_state_free(state)))

    @classmethod
    def _of(cls, model: Model, pointer: Any) -> "State":
        # the state of a knot, which is the library's
        state = cls.__new__(cls)
        state._take(model, pointer)
        return state

    def _take(self, model: Model, pointer: Any) -> None:
        self.model = model
        self._c = pointer
        self.options: Options = _library.contact_options(ffi.addressof(pointer, "options"), pointer)

    @property
    def time(self) -> float:
        """s"""
        return float(self._c.time)

    @time.setter
    def time(self, seconds: float) -> None:
        self._c.time = seconds

    def _given(self, **arrays: tuple[ArrayLike, int]) -> list[Array]:
        return [_library.as_array(value, (length,), name) for name, (value, length) in arrays.items()]

    def position(self, q: ArrayLike) -> None:
        """Poses, tendons, contacts and limits at q [nq]."""
        (q,) = self._given(q=(q, self.model.nq))
        check(lib.cav_position(self.model._c, self._c, pointer_to(q)), "the position")

    def inverse(self, q: ArrayLike, v: ArrayLike, v_next: ArrayLike) -> Array:
        """Forces u [nv] that take v to v_next [nv] in one step at q [nq]."""
        nq, nv = self.model.nq, self.model.nv
        q, v, v_next = self._given(q=(q, nq), v=(v, nv), v_next=(v_next, nv))
        u = np.empty(nv)
        call = lib.cav_inverse(self.model._c, self._c, pointer_to(q), pointer_to(v), pointer_to(v_next), pointer_to(u))
        check(call, "the inverse")
        return u

    def forward(self, q: ArrayLike, v: ArrayLike, u: ArrayLike) -> Array:
        """v_next [nv] of one step from q [nq] and v [nv] under u [nv]."""
        nq, nv = self.model.nq, self.model.nv
        q, v, u = self._given(q=(q, nq), v=(v, nv), u=(u, nv))
        v_next = np.empty(nv)
        call = lib.cav_forward(self.model._c, self._c, pointer_to(q), pointer_to(v), pointer_to(u), pointer_to(v_next))
        check(call, "the forward step")
        return v_next

    def derivatives(self) -> Derivatives:
        """Analytic derivatives of u at the last inverse()."""
        nv = self.model.nv
        found = [np.empty((nv, nv)) for _ in range(3)]
        call = lib.cav_derivatives(self.model._c, self._c, *(pointer_to(d.reshape(-1)) for d in found))
        check(call, "derivatives (they need an inverse() before)")
        return Derivatives(*found)

    def inertia(self, q: ArrayLike) -> Array:
        """Inertia matrix [nv, nv] at q [nq], armature and damping of the step included."""
        (q,) = self._given(q=(q, self.model.nq))
        matrix = np.empty((self.model.nv, self.model.nv))
        check(lib.cav_inertia(self.model._c, self._c, pointer_to(q), pointer_to(matrix.reshape(-1))), "the inertia")
        return matrix

    @property
    def contacts(self) -> NDArray[Any]:
        """Contacts of the last evaluation, a copy: pos, frame, dist, impulse (N s), velocity_next and more.

        Forces are impulse / options.timestep, along the rows of frame; pair counts in model.pair.
        """
        return _library.view(self, self._c.contact, (self._c.ncontact,)).copy()

    @property
    def limits(self) -> NDArray[Any]:
        """Active limits and friction losses of the last evaluation, a copy."""
        return _library.view(self, self._c.row, (self._c.nrow,)).copy()

    @property
    def com(self) -> Array:
        """Centres of mass of the links [nlink, 3], m, world; looks at the state's memory."""
        return _library.view(self, self._c.com, (self.model._c.nlink, 3))

    def pose(self, kind: str, name: str) -> Pose:
        """World pose of a body (at its centre of mass), xbody (as the file has it), geom or site, of that name or role."""
        pose = ffi.new("cav_pose *")
        lib.cav_object_pose(self.model._c, self._c, *self.model.named(kind, name), pose)
        held = _library.view(pose, pose, (1,))[0]
        return Pose(held["pos"].copy(), held["rotation"].reshape(3, 3).copy(), held["quat"].copy())

    def momentum(self, v: ArrayLike) -> Momentum:
        """Centre of mass and momentum at the last position and the velocity v [nv]."""
        (v,) = self._given(v=(v, self.model.nv))
        out = [np.empty(3) for _ in range(3)]
        lib.cav_momentum(self.model._c, self._c, pointer_to(v), *(pointer_to(x) for x in out))
        return Momentum(*out)

    def actuation(self, u: ArrayLike) -> Actuation:
        """What actuators make of u [nv] at the last position; efforts are controls of motors, else forces."""
        (u,) = self._given(u=(u, self.model.nv))
        residual, effort = np.empty(self.model.nv), np.empty(self.model.nu)
        lib.cav_actuation(self.model._c, self._c, pointer_to(u), pointer_to(residual), pointer_to(effort))
        return Actuation(residual, effort)

    def sensor(self, name: str) -> Array:
        """Reading of a sensor of the model at the last inverse() or forward(); of positions, position()."""
        return self._read(self.model._c.sensor + self.model.index("sensor", name))

    def _read(self, sensor: Any) -> Array:
        out = np.empty(sensor.dim)
        lib.cav_sensor_read(self.model._c, self._c, sensor, pointer_to(out))
        return out

    def sensors(self) -> dict[str, Array]:
        """Readings of all sensors of the model that have a name."""
        return {name: self.sensor(name) for name in self.model.names("sensor") if name}

    def sensor_derivatives(self, name: str) -> tuple[Array, Array]:
        """Derivatives of a reading by q and v_next, [dim, nv] each, after derivatives()."""
        sensor = self.model._c.sensor + self.model.index("sensor", name)
        found = [np.empty((sensor.dim, self.model.nv)) for _ in range(2)]
        call = lib.cav_sensor_derivatives(self.model._c, self._c, sensor, *(pointer_to(d.reshape(-1)) for d in found))
        check(call, f"derivatives of the sensor {name!r} (they need derivatives() before)")
        return found[0], found[1]
