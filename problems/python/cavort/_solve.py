"""Solves a problem."""

from __future__ import annotations

from functools import partial
from typing import Any, Callable, Sequence

from . import _library
from ._library import Record, failure, ffi, lib, new_error
from ._problem import Frozen, Problem
from ._solution import Solution
from ._term import Term


class _Watch:
    """The callbacks of a solve: progress to the caller, and the end where an exception or Ctrl-C comes up."""

    def __init__(self, callback: Callable[[Record], Any] | None) -> None:
        self.callback = callback
        self.raised: BaseException | None = None
        self.observer = ffi.callback("cav_observer", self._observe, onerror=self._note, error=1)
        # asked many times an iteration: here Python sees its signals
        self.stop = ffi.callback("cav_stop", self._stopped, onerror=self._note, error=1)

    def _note(self, kind: Any, raised: BaseException, trace: Any) -> None:
        self.raised = self.raised or raised

    def _observe(self, context: Any, progress: Any) -> int:
        if self.callback is None:
            return 0
        return int(bool(self.callback(_library.record(progress))))

    def _stopped(self, context: Any) -> int:
        return int(self.raised is not None)


def _start_warm(frozen: Frozen, options: Any, warm: Solution) -> Any:
    # the motion to start from, resampled where the step differs; with its multipliers straight to the optimum
    motion = warm._c.trajectory
    if (motion.nq, motion.nv) != (frozen.model.nq, frozen.model.nv):
        raise ValueError("warm: the solution is of another model")
    problem = frozen.c
    fixed = problem.duration_most == 0
    duration = (motion.nknot - 1) * motion.timestep
    knots = round(problem.duration / problem.timestep) + 1
    if fixed and abs(duration - problem.duration) > 0.5 * problem.timestep:
        raise ValueError(f"warm: the solution lasts {duration:g} s, the problem {problem.duration:g} s")
    step = problem.timestep if fixed else duration / (knots - 1)
    equations, error = ffi.new("cav_equations *"), new_error()
    if abs(motion.timestep - step) > 1e-9 * step:
        pointer = lib.cav_trajectory_resample(frozen.model._c, motion, step)
        if not pointer:
            raise MemoryError("no memory for the motion")
        return ffi.gc(pointer, lib.cav_trajectory_free)
    if motion.nknot == knots and warm._frozen.c.order == problem.order and warm._c.nmultiplier:
        frozen.check(lib.cav_problem_equations(problem, equations, error), "the problem", error)
        if equations.constraints == warm._c.nmultiplier:
            options.nmultiplier, options.multiplier = warm._c.nmultiplier, warm._c.multiplier
            options.first_stage = problem.schedule.stages + 1
    return motion


def _strategies(frozen: Frozen, most: int) -> list[Any]:
    # the problem's own guess first; what is worth trying after it
    array, count = ffi.new("cav_strategy[]", lib.CAV_STRATEGIES), ffi.new("int *")
    owner = ffi.gc(ffi.cast("cav_strategy *", array), lambda _: lib.cav_strategies_clear(array, count[0]))
    frozen.check(lib.cav_strategy_list(frozen.c, array, count), "the strategies")
    frozen.keep = (frozen.keep, array, owner)
    listed = [array[i] for i in range(count[0])]
    return [strategy for strategy in listed if strategy.use == lib.CAV_STRATEGY_TRY][:most]


def _run(problem: Problem, frozen: Frozen, strategy: Any, options: Any, start: Any, watch: _Watch) -> Solution:
    # one solve, by a strategy or (None) as the problem says
    error, out = new_error(), ffi.new("cav_solution **")
    taken, name = frozen, ""
    if strategy is None:
        status = lib.cav_solve(frozen.c, options, start, out, error)
    else:
        status = lib.cav_strategy_solve(frozen.c, ffi.addressof(strategy), options, start, out, error)
        struct, name = ffi.new("cav_problem *"), _library.text(strategy.name)
        lib.cav_strategy_apply(frozen.c, ffi.addressof(strategy), struct)
        # a strategy may have terms of its own behind the problem's
        added = [Term(frozen.model, struct.term[i], keep=frozen) for i in range(len(frozen.terms), struct.nterm)]
        taken = Frozen(struct, frozen.model, [*frozen.terms, *added], frozen)
    found = None
    if out[0]:
        found = Solution(problem, taken, ffi.gc(out[0], lib.cav_solution_free), status, name)
    if watch.raised is not None:
        raised = watch.raised
        if isinstance(raised, KeyboardInterrupt):
            raised.solution = found  # type: ignore[attr-defined]
        raise raised
    if found is None or status not in (lib.CAV_OK, lib.CAV_NOT_CONVERGED, lib.CAV_INTERRUPTED):
        frozen.check(status, "the solve", error)
        raise failure(status, "the solve", error)
    return found


def _try_all(runs: Sequence[Callable[[], Solution]]) -> Solution:
    # the first that is certified and achieves; else the first that is certified; else the problem's own
    best: Solution | None = None
    for run in runs:
        found = run()
        if found.status == "interrupted" or (found.verdict.certified and found.verdict.achieved):
            return best if best is not None and found.status == "interrupted" else found
        if best is None or (found.verdict.certified and not best.verdict.certified):
            best = found
    assert best is not None
    return best


def solve(
    problem: Problem,
    callback: Callable[[Record], Any] | None = None,
    *,
    warm: Solution | None = None,
    threads: int = 1,
    max_seconds: float = 0.0,
    max_iterations: int = 0,
    solver: str = "gn",
    gains: bool = True,
    strategies: int = 1,
) -> Solution:
    """Solves a problem from its guess, or from a solution that is near (warm).

    callback is called after every iteration with its record (phase, stage, fraction, iteration, cost, unactuated,
    violation, seconds, ...); a true answer ends the solve. Ctrl-C ends it, too: the KeyboardInterrupt has the best iterate
    as its attribute solution (None: there is none). warm: a solution of the same model and duration; one of as many knots
    and constraints goes straight to the optimum. max_seconds, max_iterations: 0, or a limit. gains: chooses feedback, which
    a certificate needs. strategies: at most so many guesses and schedules are tried, one after the other, the problem's own
    first, until a motion is certified and achieves what is asked; Solution.strategy names the one kept. The result does not depend on threads; the GIL is released, except in callbacks.

    Raises Error where the problem cannot be solved at all, with the text of the library; a motion that misses something
    is told in Solution.status and Solution.verdict.
    """
    frozen, watch = problem._freeze(), _Watch(callback)
    options = ffi.new("cav_solve_options *", lib.cav_solve_options_default())
    known = [_library.text(lib.cav_solver_rule_of(i).name) for i in range(lib.CAV_SOLVER_TYPES)]
    if solver not in known:
        raise ValueError(f"solver: expected one of {', '.join(known)}, got {solver!r}")
    if threads < 1 or strategies < 1:
        raise ValueError(f"threads and strategies: expected 1 or more, got {threads} and {strategies}")
    options.solver, options.threads, options.gains = known.index(solver), threads, int(gains)
    options.max_seconds, options.max_iterations = max_seconds, max_iterations
    options.observer, options.stop = watch.observer, watch.stop
    start = _start_warm(frozen, options, warm) if warm is not None else ffi.NULL
    if strategies > 1 and warm is not None:
        raise ValueError("give warm, the one start, or strategies, not both")
    if strategies == 1:
        return _run(problem, frozen, None, options, start, watch)
    tried = _strategies(frozen, strategies)
    return _try_all([partial(_run, problem, frozen, strategy, options, start, watch) for strategy in tried])
