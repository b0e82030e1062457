"""Solves: from files and built in code, watched, interrupted, warm; what a solution says."""

import gc
import json
import os
import signal
import subprocess
import sys
import threading
import time

import cavort
import numpy as np
import pytest

SOURCE = os.environ["CAVORT_SOURCE"]


def built(arm):
    """The problem of swing.xml, in code."""
    problem = cavort.Problem(arm, 1.0, 0.05, name="swing")
    problem.q_goal = [1.0]
    problem.cost("posture", 900, dofs="all", at=1.0, name="there")
    return problem


def hard_swing(path):
    """A problem whose efforts are at their limits: some 26 iterations."""
    problem = cavort.Problem.load(path)
    problem.effort_limit, problem.q_goal = 0.3, [2.5]
    return problem


def test_file_and_code(arm, swing, tmp_path):
    """A problem built in code is that of the file, bit by bit, and writes one that reads the same."""
    loaded, made = cavort.Problem.load(swing), built(arm)
    a, b = cavort.solve(loaded), cavort.solve(made)
    assert a.status == "success" and np.array_equal(a.q, b.q) and a.cost == b.cost
    made.save(str(tmp_path / "made.xml"))
    c = cavort.solve(cavort.Problem.load(str(tmp_path / "made.xml")))
    assert np.array_equal(a.q, c.q)
    # a weight that differs leads elsewhere
    made.terms[-1].weight = 1.0
    assert not np.array_equal(cavort.solve(made).q, a.q)


def test_solution(swing):
    problem = cavort.Problem.load(swing)
    solution = cavort.solve(problem)
    assert solution.q.shape == (21, 1) and solution.time[-1] == pytest.approx(1)
    verdict = solution.verdict
    assert verdict.certified is True and verdict["achieved"] is True and verdict.reason == ""
    term = next(term for term in solution.terms if term.name == "there")
    assert term.met and term.wanted == pytest.approx(1) and abs(term.got - 1) < 0.03
    along = solution.values("there")
    assert along["knot"].tolist() == [20] and along["value"][0] == pytest.approx(term.got - term.wanted)
    assert along["cost"].sum() == pytest.approx(term.cost) and np.array_equal(along, solution.values(-1))
    speeds = solution.values("joint velocity")
    assert np.allclose(speeds["value"], solution.v[speeds["knot"], 0]) and len(speeds) >= 20
    # efforts are u over the gear, and u is the inverse under the motion's law
    assert np.allclose(20 * solution.effort, solution.u)
    law = solution.contact
    assert np.allclose(
        problem.model.inverse(solution.q[:-1], solution.v[:-1], solution.v[1:], options=law), solution.u[:-1]
    )
    assert len(solution.contacts) == 0 and solution.log[-1].iteration == solution.iterations
    assert solution.explain().met is True
    by_q, by_v = solution.gains
    assert by_q.shape == (20, 1, 1)
    q, v, u = solution.sample(0.01)
    assert np.allclose(q[::5], solution.q)
    # what is changed afterwards is not the solution's
    problem.terms[-1].target = [3.0]
    problem.q_start[0] = 0.5
    again = cavort.Solution(problem, solution._frozen, solution._c, 0)
    assert again.verdict == verdict or np.isnan(verdict.joint_speed_over_limit)
    assert again.verdict.certified


def test_folder(swing, tmp_path):
    """A result folder reads back to the same bits, and says what the solution says."""
    solution = cavort.solve(cavort.Problem.load(swing))
    folder = str(tmp_path / "made" / "swing.result")
    solution.save(folder)
    with open(os.path.join(folder, "verdict.json")) as file:
        told = json.load(file)
    assert told["certified"] is True and told["cost"] == solution.verdict.cost and told["targets"]
    again = cavort.Solution.load(folder)
    assert again.status == "read" and again.iterations == solution.iterations
    for name in ("q", "v", "u", "effort"):
        assert np.array_equal(getattr(again, name), getattr(solution, name))
    assert again.cost == pytest.approx(solution.cost, rel=1e-12)
    assert np.array_equal(again.gains[0], solution.gains[0]) and again.verdict.cost == solution.verdict.cost
    assert again.verdict.certified and again.verdict.optimality == solution.verdict.optimality
    warm = cavort.solve(again.problem, warm=again)
    assert warm.status == "success" and np.allclose(warm.q, solution.q, atol=1e-4)
    again.save(str(tmp_path / "twice"))
    with open(os.path.join(folder, "trajectory.csv"), "rb") as a, open(str(tmp_path / "twice" / "trajectory.csv"), "rb") as b:
        assert a.read() == b.read()
    with pytest.raises(cavort.Error, match="problem.xml"):
        cavort.Solution.load(str(tmp_path))


def test_contacts():
    problem = cavort.Problem.load(os.path.join(SOURCE, "problems", "motions", "squat-jump", "problem.xml"))
    stopped = cavort.solve(problem, max_iterations=2, gains=False)
    assert stopped.status == "interrupted"
    touching = stopped.contacts
    weight = problem.model.mass * 9.81
    first = touching[touching["knot"] == 0]
    assert len(first) and first["force"][:, 2].sum() > 0.1 * weight
    floor = problem.model.index("geom", "floor")
    assert set(np.unique(touching["geom1"])) >= {floor}
    # what bears is the inverse's: force over the whole motion against the momentum of the centre of mass
    assert stopped.com.shape == (81, 3) and stopped.control.shape == (81, 21)


def test_observed(swing):
    seen = []
    problem = hard_swing(swing)
    solution = cavort.solve(problem, seen.append)
    assert seen[-1].phase and len(seen) >= solution.iterations > 10
    stopped = cavort.solve(problem, lambda record: record.iteration >= 3)
    assert stopped.status == "interrupted" and stopped.iterations < solution.iterations

    def breaks(record):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        cavort.solve(problem, breaks)


def test_warm_and_threads(swing):
    problem = hard_swing(swing)
    cold = cavort.solve(problem)
    assert np.array_equal(cavort.solve(problem, threads=3).q, cold.q)
    problem.terms[-1].weight *= 1.1
    warm = cavort.solve(problem, warm=cold)
    assert warm.status == "success" and warm.iterations < cold.iterations / 2
    assert warm.verdict.certified
    problem.timestep = 0.025
    finer = cavort.solve(problem, warm=cold)
    assert finer.q.shape == (41, 1) and finer.status == "success"
    problem.duration = 2.0
    with pytest.raises(ValueError, match="lasts 1 s, the problem 2 s"):
        cavort.solve(problem, warm=cold)


def test_guess(arm):
    problem = built(arm)
    time = np.linspace(0, 1, 21)
    smooth = time**2 * (3 - 2 * time)
    assert np.allclose(problem.guessed()[:, 0], smooth)
    problem.guess_poses([(0.5, [3.0])])
    assert problem.guessed()[10, 0] == pytest.approx(3)
    problem.guess_poses([])
    problem.guess_swings([("pivot", 0.2, 2.0, 0.0)])
    swung = problem.guessed()[:, 0] - smooth
    assert 0.15 < np.abs(swung).max() <= 0.2 and swung[0] == 0
    problem.guess_swings([])
    problem.guess = "hold"
    assert not problem.guessed().any()


def test_cycle_and_duration():
    """A gait and a free duration, as files have them."""
    loaded = cavort.Problem.load(os.path.join(SOURCE, "problems", "motions", "walker-walk", "problem.xml"))
    made = cavort.Problem(loaded.model, loaded.duration, loaded.timestep)
    of = loaded._c.cycle
    mirror = {value: name for name, value in cavort._library.words("cav_mirror").items()}[of.mirror]
    made.cycle(list(of.translation), rotation=of.rotation, mirror=mirror)
    for name in ("on", "rotation", "mirror"):
        assert getattr(made._c.cycle, name) == getattr(of, name)
    assert list(made._c.cycle.translation) == list(of.translation) and of.on == 1


def test_least_time(arm):
    """A free duration: the pendulum's way in the least time that its limit of effort allows is shorter with more of it."""
    took = []
    for effort in (0.4, 0.8):
        problem = built(arm)
        problem.constraint("posture", dofs="all", at=1.0, target=[1.0])
        problem.constraint("velocity", dofs="all", at=1.0)
        problem.duration_least, problem.duration_most, problem.duration_weight = 0.2, 3.0, 100.0
        problem.effort_limit = effort
        solution = cavort.solve(problem, gains=False)
        took.append(solution.time[-1])
        assert solution.status == "success" and solution.timestep != pytest.approx(0.05)
    assert took[1] < 0.9 * took[0]


def test_lifetime(swing):
    """Arrays of a solution live as long as one is looked at, and no longer than needed is nothing kept."""
    solution = cavort.solve(cavort.Problem.load(swing))
    q, copy, model = solution.q, solution.q.copy(), solution.problem.model
    joints = model.joint["range"]
    del solution, model
    gc.collect()
    for _ in range(3):
        cavort.solve(cavort.Problem.load(swing))
    assert np.array_equal(q, copy) and joints.shape == (1, 2)


def test_strategies():
    """A pendulum too weak to rise without a swing: its own guess fails, another leads up."""
    problem = cavort.Problem.load(os.path.join(SOURCE, "tests", "rise.xml"))
    solution = cavort.solve(problem, strategies=4)
    assert solution.strategy not in ("", "stated") and solution.status == "success"
    assert solution.verdict.certified and solution.verdict.achieved
    assert abs(solution.q[-1, 0]) == pytest.approx(3, abs=1e-5)


def test_refused(arm, swing):
    problem = built(arm)
    with pytest.raises(ValueError, match="no quantity 'posturee'"):
        problem.cost("posturee")
    with pytest.raises(TypeError, match="did you mean 'joint'"):
        problem.cost("velocity", jiont="pivot")
    with pytest.raises(KeyError, match="pivot"):
        problem.cost("velocity", joint="pivto")
    with pytest.raises(ValueError, match="cost alone"):
        problem.constraint("effort")
    with pytest.raises(ValueError, match="looks at"):
        problem.cost("sensor", type="jointpos", body="rod")
    with pytest.raises(ValueError, match="target has the shape"):
        problem.cost("sensor", type="framepos", body="rod", target=[1, 2])
    problem.cost("velocity", at=3.0)
    with pytest.raises(ValueError, match="ends at 3 s, after the horizon of 1 s"):
        cavort.solve(problem)
    with pytest.raises(ValueError, match="solver: expected one of gn"):
        cavort.solve(cavort.Problem.load(swing), solver="magic")
    for attributes, words in (
        ({"component": 3}, "component that its sensor does not have"),
        ({"scale": 0.0}, "positive scale"),
        ({"within": -1.0}, "within"),
        ({"waypoints": [(0.5, [0, 0, 0]), (0.2, [1, 0, 0])]}, "do not increase"),
        ({"target": [0, np.nan, 0], "name": "mine"}, r"not finite: term\[12\], 'mine'"),
    ):
        wrong = built(arm)
        wrong.terms.pop()
        wrong.cost("sensor", type="framepos", site="tip", **attributes)
        with pytest.raises(cavort.Error, match=words):
            cavort.solve(wrong)
    with pytest.raises(ValueError, match="expected 'x', 'y', 'z' or a number"):
        problem.cost("sensor", type="framepos", site="tip", component="w")
    with pytest.raises(TypeError, match="of sensors"):
        problem.cost("posture", component=0)
    with pytest.raises(ValueError, match="of another model"):
        other = built(arm)
        other.terms.append(problem.terms[0])
        cavort.solve(other)
    odd = built(arm)
    odd.timestep = 0.03
    with pytest.raises(ValueError, match="whole number of steps"):
        cavort.solve(odd)


def test_impossible(arm):
    problem = built(arm)
    assert problem.impossible() == []
    problem.constraint("sensor", type="framepos", site="tip", at=1.0, target=[5, 0, 0])
    proofs = problem.impossible()
    assert proofs and proofs[0].what and proofs[0].cure


def test_targets(arm):
    problem = built(arm)
    term = problem.cost("sensor", 5, type="framepos", site="tip", component="z", relative="goal", target=0.1, at=1.0)
    assert np.allclose(term.target, [0, 0, -0.5 * np.cos(1) + 0.1]) and term.dim == 3
    term = problem.cost("velocity", joint="pivot", waypoints=[(0, 0.0), (0.5, 2.0), (1, 0.0)])
    assert np.array_equal(term.target, [[0], [2], [0]])
    hard = problem.constraint("velocity", joint="pivot", lower=-1.5, upper=1.5)
    solution = cavort.solve(problem)
    assert hard.hard and solution.status == "success" and np.abs(solution.v).max() < 1.5 + 1e-6


def test_interpreter_runs(swing):
    """Other threads of Python run while the library solves."""
    problem = cavort.Problem.load(os.path.join(SOURCE, "problems", "motions", "squat-jump", "problem.xml"))
    counted, done = 0, threading.Event()
    thread = threading.Thread(target=lambda: (cavort.solve(problem, max_iterations=20, gains=False), done.set()))
    thread.start()
    while not done.is_set():
        counted += 1
        time.sleep(0.001)
    thread.join()
    assert counted > 20


INTERRUPTED = """
import cavort, sys
problem = cavort.Problem.load(sys.argv[1])
def told(record):
    if record.iteration == 2: print("solving", flush=True)
try:
    cavort.solve(problem, told)
except KeyboardInterrupt as interrupt:
    print("interrupted", interrupt.solution.status, interrupt.solution.q.shape)
"""


def test_interrupt():
    """Ctrl-C ends a solve in a second and hands over the best iterate."""
    path = os.path.join(SOURCE, "problems", "motions", "squat-jump", "problem.xml")
    process = subprocess.Popen([sys.executable, "-c", INTERRUPTED, path], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "solving\n"
    sent = time.monotonic()
    process.send_signal(signal.SIGINT)
    told = process.communicate(timeout=60)[0]
    assert told == "interrupted interrupted (81, 28)\n" and process.returncode == 0
    assert time.monotonic() - sent < 10


def test_end_and_names(arm):
    """The end in words, settings that are none, a term in the place of its number."""
    problem = cavort.Problem(arm, 1.0, 0.05)
    term = problem.cost("posture", 900, dofs="all", at="end", target=[1.0])
    with pytest.raises(ValueError, match="'end', got 'start'"):
        problem.cost("posture", 900, dofs="all", at="start")
    with pytest.raises(AttributeError, match="did you mean 'duration'"):
        problem.duratoin = 3
    solution = cavort.solve(problem)
    values = solution.values(term)["value"]
    assert len(values) == 1 and abs(values[0]) < 0.1 or abs(values[0] - 1) < 0.1
    with pytest.raises(ValueError, match="not one of the problem"):
        solution.values(cavort.Problem(arm).terms[0])
    told = str(solution.explain())
    assert told.startswith(("nothing is missed", "missed:")) and "Record(" not in told
