"""What a motion should achieve: model, horizon, start, guess, costs and constraints."""

from __future__ import annotations

import difflib
import os
from typing import Any, Sequence

import numpy as np
from numpy.typing import ArrayLike

from . import _library, _term
from ._library import Array, Options, Record, check, failure, ffi, lib, new_error, pointer_to, text
from ._model import Model
from ._state import State
from ._term import Quantity, Term

class _Number:
    """A number of cav_problem as an attribute."""

    def __init__(self, doc: str) -> None:
        self.__doc__ = doc

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, problem: "Problem", owner: type) -> float:
        return self if problem is None else getattr(problem._c, self.name)  # type: ignore

    def __set__(self, problem: "Problem", value: float) -> None:
        setattr(problem._c, self.name, value)


class _Posture:
    """A vector of the problem as an attribute, which may be written in place."""

    def __init__(self, length: str, doc: str) -> None:
        self.length = length
        self.__doc__ = doc

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, problem: "Problem", owner: type) -> Array:
        return self if problem is None else problem.__dict__[self.name]  # type: ignore

    def __set__(self, problem: "Problem", value: ArrayLike) -> None:
        shape = (getattr(problem.model, self.length),)
        problem.__dict__[self.name] = _library.as_array(value, shape, self.name).copy()


class Frozen:
    """A problem as it was when it was taken: what C sees, with all that it points at."""

    def __init__(self, c: Any, model: Model, terms: Sequence[Term], keep: Any) -> None:
        self.c, self.model, self.keep, self.terms = c, model, keep, list(terms)
        self.names = [term.name or text(lib.cav_quantity_rule_of(term._c.quantity).name) for term in terms]
        self.quantities = [term._user for term in terms if term._user]

    def check(self, status: int, what: str, error: Any = None) -> None:
        """Raises what a callable raised, or what the library says."""
        _term.surface(self.quantities)
        check(status, what, error)


class Problem:
    """What a motion should achieve. Problem.load reads a problem file; Problem(model, ...) is built in code.

    The terms are a list, problem.terms, in which the usual running costs stand at first (effort, velocities,
    accelerations, posture, contacts that hover, slip or hit); cost() and constraint() add to it. All that a solve needs is
    taken when it begins: what is changed afterwards is of the next one.
    """

    duration = _Number("s; a whole number of steps")
    timestep = _Number("s between knots")
    duration_least = _Number("shortest duration where that is free, s; both 0: it is fixed")
    duration_most = _Number("longest duration where that is free, s")
    duration_weight = _Number("cost weight/2 * duration^2 where that is free")
    guess_height = _Number("m: ballistic arc of the guess over guess_from .. guess_to")
    guess_from = _Number("s")
    guess_to = _Number("s")
    effort_limit = _Number("fraction of the actuators' limits to plan with, 0 .. 1")
    limit_margin = _Number("rad or m kept from limits of joints and tendons")
    q_start = _Posture("nq", "configuration at the start [nq]")
    v_start = _Posture("nv", "velocity at the start [nv]")
    q_goal = _Posture("nq", "posture that the guess ends at and costs of posture are about [nq]")
    model: Model
    terms: list[Term]
    name: str

    def __setattr__(self, name: str, value: Any) -> None:
        if name[:1] != "_" and not hasattr(type(self), name) and name not in Problem.__annotations__:
            near = difflib.get_close_matches(name, [*vars(Problem), *Problem.__annotations__], 1)
            raise AttributeError(f"a problem has no '{name}'" + (f"; did you mean '{near[0]}'?" if near else ""))
        super().__setattr__(name, value)

    def __init__(
        self, model: Model | str, duration: float = 1.0, timestep: float = 0.025, *, name: str = ""
    ) -> None:
        """At rest in the model's own configuration, with the usual running costs and nothing asked.

        model: a file is read as problem files read theirs, where geoms that overlap at rest do not push.
        """
        if not isinstance(model, Model):
            model = Model(model, overlaps=True)
        self._take(model, lib.cav_problem_default(model._c), None)
        self.duration, self.timestep, self.guess_to, self.name = duration, timestep, duration, name
        self.q_start, self.q_goal, self.v_start = model.q0, model.q0, np.zeros(model.nv)
        count = lib.cav_problem_default_terms(ffi.NULL, 0)
        usual = ffi.new("cav_term[]", count)
        lib.cav_problem_default_terms(usual, count)
        self.terms = [Term(model, usual[i], keep=usual) for i in range(count)]

    @classmethod
    def load(cls, path: str, model: str | None = None) -> "Problem":
        """Reads a problem file and its model; model: a file in the place of the one that it names."""
        error = new_error()
        other = ffi.NULL if model is None else str(model).encode()
        pointer = lib.cav_problem_load(str(path).encode(), other, error)
        if not pointer:
            raise failure(error.status, str(path), error)
        return cls._of(pointer, ffi.gc(pointer, lib.cav_problem_free))

    @classmethod
    def _of(cls, pointer: Any, owner: Any) -> "Problem":
        # a problem of the library, which owner keeps
        problem = cls.__new__(cls)
        model = Model._of(pointer.model, owner)
        model.path = os.path.abspath(text(pointer.model_path)) if pointer.model_path else None
        model.floating = bool(pointer.floating)
        problem._take(model, pointer[0], owner)
        nq, nv = model.nq, model.nv
        problem.q_start = _library.view(problem, pointer.q_start, (nq,))
        problem.q_goal = _library.view(problem, pointer.q_goal, (nq,))
        problem.v_start = _library.view(problem, pointer.v_start, (nv,))
        problem.name = text(pointer.name)
        problem.terms = [Term(model, pointer.term[i], keep=owner) for i in range(pointer.nterm)]
        return problem

    def _take(self, model: Model, struct: Any, owner: Any) -> None:
        self.model = model
        self._owner = owner
        self._c = ffi.new("cav_problem *", struct)
        self._held: dict[str, Any] = {}

    def __repr__(self) -> str:
        return f"<cavort.Problem {self.name!r} of {self.model.name!r}: {self.duration:g} s, {len(self.terms)} terms>"

    @property
    def close_at_rest(self) -> bool:
        """The velocity after the last knot is zero, and forces hold there."""
        return bool(self._c.close_at_rest)

    @close_at_rest.setter
    def close_at_rest(self, close: bool) -> None:
        self._c.close_at_rest = int(close)

    @property
    def guess_ground(self) -> bool:
        """Between start and goal the guess stands on what is below it, so high as there."""
        return bool(self._c.guess_ground)

    @guess_ground.setter
    def guess_ground(self, ground: bool) -> None:
        self._c.guess_ground = int(ground)

    @property
    def free_start(self) -> bool:
        """Configuration and velocity at the start are found too; q_start and v_start are where the guess starts."""
        return bool(self._c.free_start)

    @free_start.setter
    def free_start(self, free: bool) -> None:
        self._c.free_start = int(free)

    @property
    def order(self) -> str:
        """Of the step: "euler", "midpoint" or "momentum"."""
        return _library.word("cav_order", self._c.order)

    @order.setter
    def order(self, order: str) -> None:
        self._c.order = _library.choose("cav_order", order, "order")

    @property
    def guess(self) -> str:
        """Where a solve starts: "interpolate" from start to goal, "hold" the start, "pump" a swing-up by simulation."""
        return _library.word("cav_guess", self._c.guess)

    @guess.setter
    def guess(self, guess: str) -> None:
        self._c.guess = _library.choose("cav_guess", guess, "guess")

    def guessed(self) -> Array:
        """The configurations that a solve starts from [nknot, nq]."""
        frozen, error = self._freeze(), new_error()
        pointer = lib.cav_problem_guess(frozen.c, error)
        if not pointer:
            raise failure(error.status, "the guess", error)
        motion = ffi.gc(pointer, lib.cav_trajectory_free)
        return _library.view(motion, motion.q, (motion.nknot, motion.nq))

    def guess_poses(self, poses: Sequence[tuple[float, ArrayLike]]) -> None:
        """Postures (time in s, q [nq]) that the guess passes."""
        array = ffi.new("cav_guess_pose[]", len(poses))
        held = [_library.as_array(q, (self.model.nq,), "a posture of the guess").copy() for _, q in poses]
        buffers = [pointer_to(q) for q in held]
        for i, (time, _) in enumerate(poses):
            array[i].time, array[i].q = time, buffers[i]
        self._c.nguess_pose, self._c.guess_pose = len(poses), array
        self._c.guess_left = ffi.NULL
        self._held["poses"] = array, held, buffers

    def guess_swings(self, swings: Sequence[tuple[str, float, float, float]]) -> None:
        """Sines over joints of the guess: (joint, amplitude in rad or m, frequency in Hz, phase in rad)."""
        array = ffi.new("cav_swing[]", len(swings))
        for i, (joint, *numbers) in enumerate(swings):
            array[i].joint = self.model.index("joint", joint)
            array[i].amplitude, array[i].frequency, array[i].phase = numbers
        self._c.nswing, self._c.swing = len(swings), array
        self._held["swings"] = array

    @property
    def stages(self) -> int:
        """Of the continuation, 1 or more."""
        return int(self._c.schedule.stages)

    @stages.setter
    def stages(self, stages: int) -> None:
        self._c.schedule.stages = stages

    @property
    def first_stage(self) -> Options:
        """Options of the first stage of the continuation."""
        return Options(self._c.schedule.first, lib.cav_stage_fields, "the first stage", self)

    @property
    def last_stage(self) -> Options:
        """Options of the last stage of the continuation: the contact law that the motion obeys."""
        return Options(self._c.schedule.last, lib.cav_stage_fields, "the last stage", self)

    def cost(self, quantity: str | Quantity, weight: float = 1.0, *, norm: str = "square", **attributes: Any) -> Term:
        """Adds weight/2 times the squared difference from the target, integrated over the window, at one knot as it is.

        The usual costs stay: take from problem.terms what it stands in the place of. quantity: as in problem files ("sensor", "posture", "velocity", "effort", "slip", ...: `cavort help terms`), or one's
        own. norm: "square", or "absolute" (linear far beyond the scale). Attributes are those of problem files:

        target (numbers; of a posture q [nq]) or waypoints [(time, target), ...]; at (s) or window (from, to); scale; within
        (tolerance: a number or "any"); name; dofs ("all", "root_linear", "root_angular", "joints", "driven") or joint; of a sensor type
        and one of body, xbody, site, geom, joint, tendon, actuator, or sensor (one of the model's), component ("x", "y", "z"),
        relative ("start" or "goal": the target counts from the reading there); body, of contacts.
        """
        term = self._term(lib.cav_term_cost(_term.quantity_of(quantity), weight), quantity, **attributes)
        term._c.norm = _library.choose("cav_norm", norm, "norm")
        self.terms.append(term)
        return term

    def constraint(
        self, quantity: str | Quantity, *, lower: float | None = None, upper: float | None = None, **attributes: Any
    ) -> Term:
        """Adds what must hold: value equal to the target, or within lower and upper. Attributes as those of cost()."""
        of = _term.quantity_of(quantity)
        rule = lib.cav_quantity_rule_of(of)
        if not rule.hard:
            raise ValueError(f"{text(rule.name)} can be a cost alone, no constraint")
        if lower is None and upper is None:
            struct = lib.cav_term_equal(of, ffi.NULL)
        else:
            struct = lib.cav_term_range(of, -np.inf if lower is None else lower, np.inf if upper is None else upper)
        term = self._term(struct, quantity, **attributes)
        self.terms.append(term)
        return term

    def _term(
        self,
        struct: Any,
        quantity: str | Quantity,
        *,
        name: str = "",
        target: ArrayLike | None = None,
        waypoints: Sequence[tuple[float, ArrayLike]] | None = None,
        at: float | str | None = None,
        window: tuple[float, float] | None = None,
        scale: float = 1.0,
        within: float | str = 0.0,
        component: str | int | None = None,
        **attributes: Any,
    ) -> Term:
        user = quantity if isinstance(quantity, Quantity) else None
        made = ffi.new("cav_term *", struct)
        made.scale, made.within = scale, _term.tolerance(within)
        if component is not None:
            if not user and made.quantity != lib.CAV_QUANTITY_SENSOR:
                raise TypeError("component is of sensors and of quantities of one's own")
            if component not in ("x", "y", "z") and not (isinstance(component, int) and component >= 0):
                raise ValueError(f"component: expected 'x', 'y', 'z' or a number from 0, got {component!r}")
            made.component = "xyz".index(component) if isinstance(component, str) else component
        if at is not None or window is not None:
            if at is not None and window is not None:
                raise ValueError("give at or window, not both")
            if isinstance(at, str) and at != "end":
                raise ValueError(f"at: expected a time in s or 'end', got {at!r}")
            at = self.duration if isinstance(at, str) else at
            start, made.to = (at, at) if at is not None else window  # type: ignore
            setattr(made, "from", start)
        relative = attributes.pop("relative", None)
        self._describe(made, user, attributes)
        term = Term(self.model, made[0], user)
        if name:
            term.name = name
        if waypoints is not None:
            if target is not None:
                raise ValueError("give target or waypoints, not both")
            term._waypoints([time for time, _ in waypoints])
            term.target = np.array([self._target(term, x, relative) for _, x in waypoints])
        elif target is not None or relative is not None:
            term.target = self._target(term, 0.0 if target is None else target, relative)
        return term

    def _describe(self, made: Any, user: Quantity | None, attributes: dict[str, Any]) -> None:
        # what the quantity is of
        of = lib.cav_quantity_rule_of(made.quantity).of
        known: Sequence[str] = ()
        if user:
            made.user = user._c
        elif of == lib.CAV_OF_SENSOR:
            known = ("type", "sensor", *_term.OBJECTS)
            objects = {kind: attributes[kind] for kind in _term.OBJECTS if kind in attributes}
            made.sensor = _term.sensor_of(self.model, attributes.get("sensor"), attributes.get("type"), objects)
        elif of in (lib.CAV_OF_POSTURE, lib.CAV_OF_RATE):
            known = ("dofs", "joint")
            made.dofs = _library.choose("cav_dof_set", attributes.get("dofs", "joints"), "dofs")
            if "joint" in attributes:
                made.dofs, made.joint = lib.CAV_DOFS_ONE, self.model.index("joint", attributes["joint"])
        elif of == lib.CAV_OF_CONTACTS:
            known = ("body",)
            if "body" in attributes:
                made.body = self._body(attributes["body"])
        for name in attributes:
            if name not in known:
                near = difflib.get_close_matches(name, known, 1)
                hint = f"; did you mean {near[0]!r}?" if near else ""
                raise TypeError(f"{text(lib.cav_quantity_rule_of(made.quantity).name)} has no attribute {name!r}{hint}")

    def _body(self, names: str) -> int:
        # of contacts: the body of a role may be told by a geom of it
        kind, number = self.model.named("body", names)
        return int(self.model._c.geom[number].body) if kind == lib.CAV_OBJECT_GEOM else number

    def _target(self, term: Term, target: ArrayLike, relative: str | None) -> Array:
        # laid out as C has it
        given = np.atleast_1d(np.asarray(target, dtype=np.float64))
        of = lib.cav_quantity_rule_of(term._c.quantity).of
        full = np.zeros(term.dim)
        if of == lib.CAV_OF_POSTURE:
            joint = self.model._c.joint[term._c.joint]
            if term._c.dofs == lib.CAV_DOFS_ONE and given.size == 1:
                full = self.q_goal.copy()
                full[joint.q] = given[0]
                return full
        elif of == lib.CAV_OF_RATE and given.size != self.model.nv:
            chosen = _term.select_dofs(self.model, term._c.dofs, term._c.joint)
            full[chosen] = given
            return full
        elif term._c.component >= 0 and given.size == 1 and term.dim != 4:
            full[term._c.component] = given[0]
            given = full
        elif relative is not None and given.size == 1 and given[0] == 0:
            given = full
        given = _library.as_array(given, (term.dim,), "target")
        return given if relative is None else given + self._reading(term, relative)

    def _reading(self, term: Term, posture: str) -> Array:
        # of a sensor at start or goal
        if posture not in ("start", "goal") or term._c.quantity != lib.CAV_QUANTITY_SENSOR or term.dim == 4:
            raise ValueError("relative: 'start' or 'goal', of sensors that are no orientation")
        state = State(self.model)
        rest = np.zeros(self.model.nv)
        state.inverse(self.q_start if posture == "start" else self.q_goal, rest, rest)
        reading = state._read(ffi.addressof(term._c, "sensor"))
        component = term._c.component
        return reading if component < 0 else np.where(np.arange(reading.size) == component, reading, 0)

    def cycle(self, translation: ArrayLike = (0, 0, 0), *, rotation: float = 0.0, mirror: str = "none") -> None:
        """The motion ends as it starts, moved (m) and turned (rad); mirror "x" or "y": half a stride of a gait."""
        moved = _library.as_array(translation, (3,), "translation")
        self._c.cycle.on, self._c.cycle.rotation = 1, rotation
        self._c.cycle.translation = list(moved)
        self._c.cycle.mirror = _library.choose("cav_mirror", mirror, "mirror")

    def _check_times(self) -> None:
        # what a file is told by its reader and C by nobody; the library checks all else
        steps = self.duration / self.timestep if self.timestep > 0 else np.nan
        if not np.isfinite(steps) or steps < 0.5 or abs(steps - round(steps)) > 1e-6 * max(1.0, steps):
            raise ValueError(f"the duration, {self.duration:g} s, is not a whole number of steps of {self.timestep:g} s")
        for i, term in enumerate(self.terms):
            if term._model._c != self.model._c:
                raise ValueError(f"term {i} is of another model, {term._model.name!r}")
            if term._c.to > self.duration * (1 + 1e-6):
                name = term.name or text(lib.cav_quantity_rule_of(term._c.quantity).name)
                raise ValueError(
                    f"term {i} ({name}): its window ends at {term._c.to:g} s, after the horizon of {self.duration:g} s"
                )

    def _freeze(self) -> Frozen:
        self._check_times()
        c = ffi.new("cav_problem *", self._c[0])
        vectors = [x.copy() for x in (self.q_start, self.v_start, self.q_goal)]
        buffers = [pointer_to(x) for x in vectors]
        c.q_start, c.v_start, c.q_goal = buffers
        name = ffi.new("char[]", self.name.encode())
        path = ffi.new("char[]", self.model.path.encode()) if self.model.path else ffi.NULL
        c.name, c.model, c.model_path, c.floating = name, self.model._c, path, int(self.model.floating)
        terms = ffi.new("cav_term[]", max(1, len(self.terms)))
        for i, term in enumerate(self.terms):
            terms[i] = term._c[0]
        c.nterm, c.term = len(self.terms), terms
        keep = (self._owner, vectors, buffers, name, path, terms, [t._held() for t in self.terms], dict(self._held))
        return Frozen(c, self.model, self.terms, keep)

    def impossible(self) -> list[Record]:
        """Proofs that no motion can do what is asked, the cause first: term, knot, what, cure. Takes milliseconds."""
        frozen, error, count = self._freeze(), new_error(), ffi.new("int *")
        found = ffi.new("cav_impossibility[]", 16)
        frozen.check(lib.cav_problem_impossible(frozen.c, found, 16, count, error), "the proofs", error)
        return [_library.record(found[i]) for i in range(count[0])]

    def save(self, path: str) -> None:
        """Writes a problem file that reads back the same: postures as numbers, every term spelt out."""
        frozen, error = self._freeze(), new_error()
        if not self.model.path:
            raise ValueError("the model was not read from a file, so no problem file can name it")
        folder = os.path.dirname(os.path.abspath(path))
        model = os.path.relpath(os.path.abspath(self.model.path), folder).encode()
        frozen.check(lib.cav_problem_write(str(path).encode(), frozen.c, model, error), str(path), error)
