"""Quantities of one's own: power of a joint and distance of two bodies, hard and priced, with and without derivatives."""

import cavort
import numpy as np
import pytest

TWO = """<mujoco model="two"><compiler angle="degree"/><worldbody>
<body name="upper" pos="0 0 1"><joint name="shoulder" axis="0 1 0" damping=".2"/>
<geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03" mass="1.5"/>
<body name="lower" pos="0 0 -.3"><joint name="elbow" axis="0 1 0" damping=".1"/>
<geom name="end" type="capsule" fromto="0 0 0 0 0 -.25" size=".025" mass="1"/></body></body>
<body name="post" pos=".3 0 1"><geom type="sphere" size=".02" contype="0" conaffinity="0"/></body>
</worldbody><actuator><motor joint="shoulder" gear="25" ctrlrange="-1 1" ctrllimited="true"/>
<motor joint="elbow" gear="12" ctrlrange="-1 1" ctrllimited="true"/></actuator></mujoco>"""


def distance_value(knot):
    """Between the centres of the lower arm and the post, m."""
    return np.linalg.norm(knot.state.pose("body", "lower").pos - knot.state.pose("body", "post").pos)


def distance_jacobian(knot, out):
    """By hand: both joints turn about y."""
    lower, post = knot.state.pose("body", "lower").pos, knot.state.pose("body", "post").pos
    away = (lower - post) / np.linalg.norm(lower - post)
    for j, name in enumerate(("upper", "lower")):
        anchor = knot.state.pose("xbody", name).pos
        out.dq[0, j] += away @ np.cross([0, 1, 0], lower - anchor)


def power_value(knot):
    """Mechanical power of the shoulder at the mean velocity of the step, W."""
    return knot.u[0] * 0.5 * (knot.v[0] + knot.v_next[0])


def power_jacobian(knot, out):
    """Of a product."""
    out.du[0, 0] += 0.5 * (knot.v[0] + knot.v_next[0])
    out.dv[0, 0] += 0.5 * knot.u[0]
    out.dv_next[0, 0] += 0.5 * knot.u[0]


QUANTITIES = {
    "distance": lambda jacobian=True: cavort.Quantity(
        "distance", 1, distance_value, distance_jacobian if jacobian else None, unit="m", reads="position", within=0.01
    ),
    "power": lambda jacobian=True: cavort.Quantity("power", 1, power_value, power_jacobian if jacobian else None, unit="W"),
}


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """Two links beside a post."""
    path = tmp_path_factory.mktemp("two") / "two.xml"
    path.write_text(TWO)
    return cavort.Model(str(path))


def problem(model):
    """From hanging to a raised arm in a second."""
    made = cavort.Problem(model, 1.0, 0.05, name="raise")
    made.q_goal = [-1.5, 0.4]
    made.cost("posture", 900, dofs="all", at=1.0, name="there")
    return made


@pytest.mark.parametrize("name", QUANTITIES)
def test_derivatives(model, name):
    state = cavort.State(model)
    quantity = QUANTITIES[name]()
    point = [0.3, -0.7], [0.5, 1.0], [0.8, 0.7]
    assert quantity.check(state, *point) < 1e-6

    # a wrong one is told
    def wrong(knot, out):
        quantity.jacobian(knot, out)
        out.dq[0, 1] += 0.1

    broken = cavort.Quantity("broken", 1, quantity.value, wrong)
    assert broken.check(state, *point) > 1e-3


@pytest.mark.parametrize("jacobian", [True, False])
def test_power(model, jacobian):
    free = cavort.solve(problem(model))
    most = max(abs(power_of(free)))
    # expensive
    priced = problem(model)
    priced.cost(QUANTITIES["power"](jacobian), 5.0, scale=most / 10, name="power")
    solution = cavort.solve(priced)
    assert solution.status == "success" and max(abs(power_of(solution))) < 0.9 * most
    # and bounded: the report and the certificate speak of it
    bounded = problem(model)
    bounded.constraint(QUANTITIES["power"](jacobian), lower=-0.7 * most, upper=0.7 * most, scale=most, name="limit of power")
    solution = cavort.solve(bounded)
    assert solution.status == "success" and max(abs(power_of(solution))) < 0.7 * most * (1 + 1e-5)
    assert solution.verdict.certified, solution.verdict.reason
    report = next(term for term in solution.terms if term.name == "limit of power")
    assert report.unit == "W" and report.met


def power_of(solution):
    """Power of the shoulder at every knot but the last, by NumPy alone."""
    return solution.u[:-1, 0] * 0.5 * (solution.v[:-1, 0] + solution.v[1:, 0])


@pytest.mark.parametrize("threads", [1, 3])
def test_distance(model, threads):
    def nearest(solution):
        state, found = cavort.State(model), []
        for q in solution.q:
            state.position(q)
            found.append(np.linalg.norm(state.pose("body", "lower").pos - state.pose("body", "post").pos))
        return np.array(found)

    near = nearest(cavort.solve(problem(model))).min()
    hard = problem(model)
    hard.constraint(QUANTITIES["distance"](), lower=near + 0.05, window=(0, 0.9), name="clear of the post")
    solution = cavort.solve(hard, threads=threads)
    assert solution.status == "success" and nearest(solution)[:19].min() > near + 0.05 - 1e-6
    priced = problem(model)
    priced.cost(QUANTITIES["distance"](), 400, target=0.2, at=0.5, name="pass the post")
    solution = cavort.solve(priced, threads=threads)
    report = next(term for term in solution.terms if term.name == "pass the post")
    assert report.has_target and abs(report.got - 0.2) < 0.01 and report.within == pytest.approx(0.01) and report.met
    assert nearest(solution)[10] == pytest.approx(report.got)


def test_exceptions(model):
    """What a callable raises comes out as it is, from solves and from reports."""

    class Odd(Exception):
        pass

    calls = []

    def value(knot):
        calls.append(knot.time)
        if len(calls) > 50:
            raise Odd("no more")
        return 0.0

    made = problem(model)
    made.cost(cavort.Quantity("odd", 1, value), 1.0)
    with pytest.raises(Odd, match="no more"):
        cavort.solve(made)
    made = problem(model)
    made.cost(cavort.Quantity("two", 1, lambda knot: [1.0, 2.0]), 1.0)
    with pytest.raises(ValueError, match="gave 2 values, it has 1"):
        cavort.solve(made)
    made = problem(model)
    made.cost(cavort.Quantity("infinite", 1, lambda knot: np.inf), 1.0)
    with pytest.raises(cavort.Error, match="infinite"):
        cavort.solve(made)

    def stopped(knot):
        raise KeyboardInterrupt

    made = problem(model)
    made.cost(cavort.Quantity("stopped", 1, stopped), 1.0)
    with pytest.raises(KeyboardInterrupt):
        cavort.solve(made)


def test_knot(model):
    """What a quantity sees fits together, and its arrays outlive the call."""
    seen, kept = [], []

    def value(knot):
        seen.append((knot.time, knot.u.shape, len(knot.state.contacts), knot.timestep))
        kept.append((knot.q, knot.q.copy()))
        return knot.state.model.inverse(knot.q, knot.v, knot.v_next, options=knot.state.options)[:1] - knot.u[:1]

    made = problem(model)
    term = made.cost(cavort.Quantity("difference", 1, value), 1.0, name="nothing")
    solution = cavort.solve(made)
    assert term.dim == 1 and seen[0][1:] == ((2,), 0, 0.05)
    assert all(np.array_equal(a, b) for a, b in kept)
    report = next(record for record in solution.terms if record.name == "nothing")
    assert report.cost < 1e-15
    with pytest.raises(cavort.Error, match="function"):
        made.save("/tmp/none.xml")


def test_folder(model, tmp_path):
    """A function cannot be written into a result folder."""
    made = problem(model)
    made.cost(QUANTITIES["distance"](), 1.0, name="distance")
    with pytest.raises(cavort.Error, match="function"):
        cavort.solve(made, gains=False).save(str(tmp_path / "folder"))
