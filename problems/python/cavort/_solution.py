"""A solved motion: what it is, whether it holds, and why."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _library
from ._library import Array, Options, Record, check, failure, ffi, lib, new_error, text
from ._problem import Frozen, Problem
from ._term import Term


class Explanation(Record):
    """Why a motion is as it is, Solution.explain; in print() a line for each reason."""

    def __str__(self) -> str:
        lines = ["nothing is missed" if self.met else "missed:"]
        lines += [f"  {reason.what}\n    {reason.cure}" for reason in self.violation]
        lines += ["pulls against each other:"] if self.conflict else []
        lines += [f"  {reason.what}\n    {reason.cure}" for reason in self.conflict]
        return "\n".join(lines + ([self.contradiction] if self.contradiction else []))


class Solution:
    """A motion over knots, as a solve left it.

    q [nknot, nq], v, u [nknot, nv] look at the solution's memory; time [nknot] in s. status: "success", or
    "not converged" or "interrupted" with the best iterate. What verdict and the reports say is of the problem as it was
    when it was solved. Solution.load reads one from a result folder.
    """

    problem: Problem
    strategy: str  #: that led to it; "" where none but the problem's own was asked for

    def __init__(self, problem: Problem, frozen: Frozen, pointer: Any, status: int | None, strategy: str = "") -> None:
        self.problem = problem
        self._frozen = frozen
        self._c = pointer
        self._status = status
        self.strategy = strategy
        self._verdict: Record | None = None
        self._along: Any = None

    def __repr__(self) -> str:
        return f"<cavort.Solution of {self.problem.name!r}: {self.status}, {len(self.q)} knots, cost {self.cost:.6g}>"

    @property
    def status(self) -> str:
        """How the solve ended, in a word or two; "read" of a result folder, which does not say."""
        if self._status is None:
            return "read"
        return "success" if self._status == lib.CAV_OK else text(lib.cav_status_name(self._status))

    @property
    def timestep(self) -> float:
        """s between knots."""
        return float(self._c.trajectory.timestep)

    @property
    def time(self) -> Array:
        """Of the knots [nknot], s."""
        return self.timestep * np.arange(self._c.trajectory.nknot)

    def _rows(self, name: str, length: str) -> Array:
        motion = self._c.trajectory
        return _library.view(self, getattr(motion, name), (motion.nknot, getattr(motion, length)))

    @property
    def q(self) -> Array:
        """Configurations [nknot, nq]."""
        return self._rows("q", "nq")

    @property
    def v(self) -> Array:
        """Velocities [nknot, nv]: v[t] leads to q[t]."""
        return self._rows("v", "nv")

    @property
    def u(self) -> Array:
        """Generalised forces [nknot, nv], N or N m: u[t] = inverse(q[t], v[t], v[t+1]) under the law contact."""
        return self._rows("u", "nv")

    @property
    def contact(self) -> Options:
        """The contact law that the motion obeys, a copy."""
        return _library.contact_options(ffi.new("cav_options *", self._c.contact))

    @property
    def gains(self) -> tuple[Array, Array] | None:
        """Feedback (by q, by v) [nknot - 1, nv, nv]: du = by_q dq + by_v dv with dq = difference(planned, q); None: there is none."""
        if not self._c.gain_q:
            return None
        nv, n = self._c.trajectory.nv, self._c.trajectory.nknot - 1
        return _library.view(self, self._c.gain_q, (n, nv, nv)), _library.view(self, self._c.gain_v, (n, nv, nv))

    @property
    def cost(self) -> float:
        """Of the cost terms, as the solver counts it."""
        return float(self._c.cost)

    @property
    def iterations(self) -> int:
        """Of the solve."""
        return int(self._c.iterations)

    @property
    def seconds(self) -> float:
        """Of the solve, wall clock."""
        return float(self._c.seconds)

    @property
    def log(self) -> list[Record]:
        """One record an iteration: phase, stage, cost, unactuated, violation, seconds and more."""
        return [_library.record(self._c.progress[i]) for i in range(self._c.nprogress)]

    @property
    def _forces(self) -> Any:
        # what contacts and actuators do along the motion, found once
        if self._along is None:
            error, problem = new_error(), self._frozen.c
            at_rest = int(problem.close_at_rest and not problem.cycle.on)
            motion = self._c.trajectory, ffi.addressof(self._c, "contact")
            pointer = lib.cav_forces_new(self._frozen.model._c, *motion, at_rest, error)
            if not pointer:
                raise failure(error.status, "the forces of the motion", error)
            self._along = ffi.gc(pointer, lib.cav_forces_free)
        return self._along

    def _at_knots(self, name: str, *shape: int) -> Array:
        forces = self._forces
        return _library.view(forces, getattr(forces, name), (forces.nknot, *shape))

    @property
    def effort(self) -> Array:
        """Efforts of the actuators [nknot, nu]: controls of motors, else forces; NaN at a last knot without forces."""
        return self._at_knots("control", self._frozen.model.nu)

    @property
    def control(self) -> Array:
        """Inputs of the actuators [nknot, nu]: controls, or activations, that give these efforts; NaN likewise."""
        return self._at_knots("input", self._frozen.model.nu)

    @property
    def com(self) -> Array:
        """Centre of mass of all that moves [nknot, 3], m."""
        return self._at_knots("com", 3)

    @property
    def contacts(self) -> NDArray[Any]:
        """All loaded contacts: knot, geom1, geom2, pos (m, world), force (N, world, on geom2), gap (m)."""
        forces = self._forces
        return _library.view(forces, forces.force, (forces.nforce,))

    def _motion(self) -> tuple[Any, Any, Any]:
        return self._frozen.c, self._c.trajectory, ffi.addressof(self._c, "contact")

    @property
    def verdict(self) -> Record:
        """Whether the motion holds: certified, achieved, reason, missed, and every figure, as attributes and items.

        Found by code apart from the solver's the first time that it is asked for, which takes about a second.
        """
        if self._verdict is None:
            verdict, error = ffi.new("cav_verdict *"), new_error()
            verdict.solve_seconds, verdict.iterations = self._c.seconds, self._c.iterations
            motion = self._motion()
            self._frozen.check(
                lib.cav_verify(*motion, self._c.gain_q, self._c.gain_v, verdict, error), "the verification", error
            )
            self._frozen.check(
                lib.cav_verify_optimality(*motion, self._c.nrow, self._c.row, verdict, error), "the verification", error
            )
            self._verdict = _library.record(verdict, ("certified", "achieved"))
        return self._verdict

    @property
    def terms(self) -> list[Record]:
        """What each term of the problem asked and got: name, wanted, got, off, within, met, cost and more."""
        count, report = self._frozen.c.nterm, self._report()
        records = [_library.record(report[i], ("has_target", "met")) for i in range(count)]
        return [Record({"name": name, **record}) for name, record in zip(self._frozen.names, records)]

    def values(self, term: int | str | Term) -> NDArray[Any]:
        """A term along the motion: a record for every knot and value, with the fields knot, component, value, target and
        cost, as in values("apex")["value"]. term: its number, its name, or the term itself."""
        if isinstance(term, Term):
            term = next((i for i, known in enumerate(self._frozen.terms) if known is term), -1)
            if term < 0:
                raise ValueError("the term is not one of the problem that was solved")
        number = self._frozen.names.index(term) if isinstance(term, str) else range(self._frozen.c.nterm)[term]
        count, error = ffi.new("int *"), new_error()
        what = *self._motion(), number
        self._frozen.check(lib.cav_term_values(*what, 0, ffi.NULL, count, error), "the values of a term", error)
        array = ffi.new("cav_term_value[]", max(1, count[0]))
        self._frozen.check(lib.cav_term_values(*what, count[0], array, count, error), "the values of a term", error)
        return _library.view(array, array, (count[0],))

    def explain(self) -> Explanation:
        """Why the motion is as it is: violation and conflict, lists of reasons (what, cure, time, ...) by size; met.
        print() shows them a line each."""
        found, error = ffi.new("cav_explanation *"), new_error()
        self._frozen.check(
            lib.cav_explain(*self._motion(), self._c.nrow, self._c.row, found, error), "the explanation", error
        )
        lists = {"violation": found.nviolation, "conflict": found.nconflict}
        told: dict[str, Any] = {
            name: [_library.record(getattr(found, name)[i]) for i in range(count)] for name, count in lists.items()
        }
        return Explanation(met=bool(found.met), contradiction=text(found.contradiction), **told)

    def sample(self, timestep: float) -> tuple[Array, Array, Array]:
        """q, v, u of the motion at another step, by cubics through the knots (u linear): copies."""
        model = self._frozen.model
        pointer = lib.cav_trajectory_resample(model._c, self._c.trajectory, timestep)
        if not pointer:
            raise MemoryError("no memory for the motion")
        motion = ffi.gc(pointer, lib.cav_trajectory_free)
        n = motion.nknot
        widths = (("q", model.nq), ("v", model.nv), ("u", model.nv))
        q, v, u = (_library.view(motion, getattr(motion, name), (n, width)).copy() for name, width in widths)
        return q, v, u

    @classmethod
    def load(cls, folder: str, model: str | None = None) -> "Solution":
        """Reads a result folder, of solves by the tool too; model: a file in the place of the one that it names."""
        error = new_error()
        other = ffi.NULL if model is None else str(model).encode()
        pointer = lib.cav_result_read(str(folder).encode(), other, error)
        if not pointer:
            raise failure(error.status, str(folder), error)
        result = ffi.gc(pointer, lib.cav_result_free)
        problem = Problem._of(result.problem, result)
        c = ffi.new("cav_solution *")
        for name in ("trajectory", "gain_q", "gain_v", "nrow", "row", "iterations"):
            setattr(c, name, getattr(result, name))
        c.contact, c.seconds = result.problem.contact, result.solve_seconds
        solution = cls(problem, problem._freeze(), c, None)
        report = solution._report()
        c.cost = sum(report[i].cost for i in range(solution._frozen.c.nterm))
        return solution

    def save(self, folder: str) -> None:
        """Writes a result folder, made where it is missing, as the tool does but for its page (`cavort view FOLDER`).

        Verifies the motion if that is still to be done. A problem with a quantity of one's own, or whose model was not read
        from a file, cannot be written.
        """
        error, where, problem = new_error(), str(folder).encode(), self._frozen.c
        verdict = ffi.new("cav_verdict *")
        for name, value in self.verdict.items():
            setattr(verdict, name, value.encode() if isinstance(value, str) else value)
        report = self._report()
        check(lib.cav_result_write(where, problem, self._c, error), folder, error)
        check(lib.cav_result_write_forces(where, *self._motion(), error), folder, error)
        check(lib.cav_result_write_verdict(where, problem, verdict, report, ffi.NULL, error), folder, error)

    def _report(self) -> Any:
        # of every term
        report, error = ffi.new("cav_term_report[]", max(1, self._frozen.c.nterm)), new_error()
        status = lib.cav_terms_report(*self._motion(), report, ffi.NULL, error)
        self._frozen.check(status, "the report of terms", error)
        return report

    def save_trajectory(self, path: str) -> None:
        """Writes trajectory.csv: time, q in MuJoCo's layout, v, u; one row a knot."""
        error = new_error()
        check(
            lib.cav_trajectory_write(str(path).encode(), self._frozen.model._c, self._c.trajectory, error), str(path), error
        )
