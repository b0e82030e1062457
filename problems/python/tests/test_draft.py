"""Models from a text or made element by element, postures, roles."""

import os

import cavort
import numpy as np
import pytest

from conftest import ARM

SOURCE = os.environ["CAVORT_SOURCE"]


def drafted():
    """The pendulum of conftest.py, element by element."""
    draft = cavort.Draft("arm")
    draft.root.add("option", timestep=0.01)
    rod = draft.world.add("body", name="rod")
    rod.add("joint", name="pivot", axis=[0, 1, 0], damping=0.1)
    rod.add("geom", name="ball", type="sphere", pos=np.array([0, 0, -0.5]), size=0.05, mass=1)
    rod.add("site", name="tip", pos=[0, 0, -0.5])
    motors = draft.root.add("actuator")
    motors.add("motor", name="motor", joint="pivot", gear=20, ctrlrange=[-1, 1], ctrllimited=True)
    sensors = draft.root.add("sensor")
    sensors.add("framepos", name="where", objtype="site", objname="tip")
    sensors.add("jointpos", name="angle", joint="pivot")
    return draft


def test_same_model(arm):
    models = cavort.Model(arm), cavort.Model.parse(ARM), drafted().compile()
    for kind in ("body", "joint", "geom", "actuator", "dof"):
        first = getattr(models[0], kind)
        assert len(first)
        for model in models[1:]:
            assert model.names(kind) == models[0].names(kind) if kind != "dof" else True
            assert getattr(model, kind).tobytes() == first.tobytes() or same(getattr(model, kind), first)
    for model in models[1:]:
        assert np.array_equal(model.inverse([0.3], [0.2], [0.5]), models[0].inverse([0.3], [0.2], [0.5]))
    assert "<joint" in drafted().mjcf


def same(a, b):
    """Every member alike; bytes between members may differ."""
    return all(np.array_equal(a[name], b[name]) for name in a.dtype.names)


def test_refused(tmp_path):
    with pytest.raises(cavort.Error, match="did you mean 'name'") as caught:
        cavort.Model.parse("<mujoco><worldbody>\n<body nmae='a'/></worldbody></mujoco>", str(tmp_path))
    assert caught.value.line == 2
    draft = drafted()
    draft.world.add("body").add("goem", type="sphere")
    with pytest.raises(cavort.Error, match="goem"):
        draft.compile()
    # a text is no file that a problem could name
    problem = cavort.Problem(cavort.Model.parse(ARM))
    with pytest.raises(ValueError, match="not read from a file"):
        problem.save(str(tmp_path / "none.xml"))


def test_postures(humanoid):
    model = cavort.Model(humanoid)
    stand = model.stand()
    up = stand + np.eye(model.nq)[2]
    state = cavort.State(model)
    for q, height in ((model.to_floor(up), 0.0), (model.to_floor(up, rise=0.25), 0.25)):
        state.position(q)
        lowest = state.pose("body", "foot_right").pos[2]
        state.position(model.to_floor(stand))
        assert lowest - state.pose("body", "foot_right").pos[2] == pytest.approx(height, abs=1e-9)
    kneel = model.to_floor(model.posture("kneel"))
    state.position(kneel)
    knees = state.pose("body", "head").pos[2]
    state.position(model.to_floor(stand))
    assert 0.2 < state.pose("body", "head").pos[2] - knees < 0.6
    with pytest.raises(cavort.Error, match="no posture of that name, got 'kneal'"):
        model.posture("kneal")
    bent = stand.copy()
    bent[model.q_slice("knee_right")] = 9
    clipped = model.clip(bent)
    low, high = model.joint["range"][model.index("joint", "knee_right")]
    assert low <= clipped[model.q_slice("knee_right")][0] <= high
    assert bent[model.q_slice("knee_right")][0] == 9


def test_roles(humanoid):
    model = cavort.Model(humanoid)
    problem = cavort.Problem(model)
    term = problem.cost("sensor", type="framepos", body="right foot", component="z", relative="start", target=0.1, at=1)
    named = problem.cost("sensor", type="framepos", body="foot_right", component="z", relative="start", target=0.1, at=1)
    assert np.array_equal(term.target, named.target) and term.target[2] > 0.1
    assert problem.cost("force", body="left foot")._c.body == model.index("body", "foot_left")
    state = cavort.State(model)
    state.position(model.q0)
    assert np.array_equal(state.pose("body", "left foot").pos, state.pose("body", "foot_left").pos)
    with pytest.raises(KeyError, match="has no body of that name"):
        problem.cost("sensor", type="framepos", body="rigth foot")
