"""Models and points: views without copies, batches against single calls and C, errors with the library's text."""

import gc
import weakref

import cavort
import numpy as np
import pytest
from cavort._library import ffi


def random_points(model, n, seed=1):
    """Postures from in the floor to above it, and velocities."""
    draw = np.random.default_rng(seed)
    rest = model.q0.copy()
    q = np.array([model.integrate(rest, 0.2 * draw.standard_normal(model.nv), 1) for _ in range(n)])
    q[:, 2] -= 0.4 * np.linspace(0, 1, n)
    v = 0.3 * draw.standard_normal((n, model.nv))
    return q, v, v + 0.02 * draw.standard_normal((n, model.nv))


def test_names_and_ranges(humanoid):
    model = cavort.Model(humanoid)
    assert (model.nq, model.nv, model.nu) == (28, 27, 21)
    assert model.names("joint")[0] == "root" and model.index("joint", "knee_right") > 0
    knee = model.index("joint", "knee_right")
    low, high = model.joint["range"][knee]
    assert low < high and model.joint["limited"][knee] == 1
    assert model.q_slice("root") == slice(0, 7) and model.v_slice("root") == slice(0, 6)
    assert model.mass == pytest.approx(model.body["mass"].sum())
    assert np.allclose(model.gravity, [0, 0, -9.81])
    with pytest.raises(KeyError, match="knee_right"):
        model.index("joint", "knee_rihgt")
    with pytest.raises(ValueError, match="kind of object"):
        model.index("knee", "x")


def test_views(humanoid):
    model = cavort.Model(humanoid)
    q0, joints = model.q0, model.joint
    # the memory is the library's, not a copy, and cannot be written
    assert q0.ctypes.data == int(ffi.cast("uintptr_t", model._c.q0))
    assert joints.ctypes.data == int(ffi.cast("uintptr_t", model._c.joint))
    assert joints["axis"][1].base is not None and not q0.flags.writeable
    with pytest.raises(ValueError):
        q0[0] = 1
    # and lives as long as an array looks at it
    before = q0.copy(), joints["range"].copy()
    del model
    gc.collect()
    assert np.array_equal(q0, before[0]) and np.array_equal(joints["range"], before[1])


def test_errors(tmp_path, arm):
    with pytest.raises(cavort.Error, match="cannot be opened") as caught:
        cavort.Model(str(tmp_path / "none.xml"))
    assert caught.value.status == "bad input"
    broken = tmp_path / "broken.xml"
    broken.write_text("<mujoco>\n<worldbody>\n<body nmae='a'/>\n</worldbody></mujoco>")
    with pytest.raises(cavort.Error, match="broken.xml:3.*did you mean 'name'") as caught:
        cavort.Model(str(broken))
    assert caught.value.line == 3
    model = cavort.Model(arm)
    with pytest.raises(ValueError, match=r"q has the shape \(2,\), expected \(1,\)"):
        model.inverse([1, 2], [0], [0])
    with pytest.raises(cavort.Error, match="not finite"):
        model.inverse([np.nan], [0], [0])
    with pytest.raises(cavort.Error, match="row 2 .1 of 3 fail"):
        model.inverse([[0], [0], [np.inf]], np.zeros((3, 1)), np.zeros((3, 1)))
    with pytest.raises(ValueError, match="timestep"):
        model.options.timestep = -1
    with pytest.raises(ValueError, match="euler, midpoint, momentum"):
        model.options.order = "leapfrog"
    with pytest.raises(AttributeError, match="no option"):
        model.options.stepp = 1


def test_pendulum(arm):
    """Closed form: a ball of 1 kg at half a metre, its own inertia 0.4 m r^2 and the damping of the step."""
    model = cavort.Model(arm)
    inertia, h = 0.25 + 0.4 * 0.05**2, model.timestep
    q, v, v_next = 0.3, 0.2, 0.5
    expected = inertia * (v_next - v) / h + 9.81 * 0.5 * np.sin(q) + 0.1 * v_next
    assert model.inverse([q], [v], [v_next])[0] == pytest.approx(expected, rel=1e-12)
    assert model.forward([q], [v], [expected])[0] == pytest.approx(v_next, rel=1e-9)
    slopes = model.derivatives([q], [v], [v_next])
    assert slopes.dq[0, 0] == pytest.approx(9.81 * 0.5 * np.cos(q), rel=1e-9)
    assert slopes.dv[0, 0] == pytest.approx(-inertia / h, rel=1e-9)
    assert slopes.dv_next[0, 0] == pytest.approx(inertia / h + 0.1, rel=1e-9)


def test_batches(humanoid):
    model = cavort.Model(humanoid)
    state = cavort.State(model)
    q, v, v_next = random_points(model, 70)
    u = model.inverse(q, v, v_next)
    touching = 0
    for i in range(len(q)):
        assert np.array_equal(state.inverse(q[i], v[i], v_next[i]), u[i])
        touching += len(state.contacts) > 0
    assert 10 < touching
    assert np.array_equal(model.inverse(q, v, v_next, threads=3), u)
    assert np.array_equal(model.inverse(q[5], v[5], v_next[5]), u[5])
    found = model.derivatives(q, v, v_next, threads=2)
    alone = model.derivatives(q[7], v[7], v_next[7])
    assert found.dq.shape == (70, 27, 27) and np.array_equal(found.dq[7], alone.dq)
    options = model.options.update(smoothing=0.01)
    assert not np.array_equal(model.inverse(q, v, v_next, options=options), u)
    # the forward step undoes the inverse where nothing is stiffer than the step resolves
    back = model.forward(q[:5], v[:5], u[:5], threads=2)
    assert np.abs(back - v_next[:5]).max() < 1e-7


def test_state(humanoid):
    model = cavort.Model(humanoid)
    state = cavort.State(model)
    rest = np.zeros(model.nv)
    q = model.q0.copy()
    state.position(q)
    while not len(state.contacts):
        q[2] -= 0.0005
        state.position(q)
    u = state.inverse(q, rest, rest)
    force = sum(c["impulse"][0] for c in state.contacts) / state.options.timestep
    # at rest the floor bears what u does not: the vertical force on the whole
    assert force + u[2] == pytest.approx(model.mass * 9.81, rel=1e-9)
    assert state.com.ctypes.data == int(ffi.cast("uintptr_t", state._c.com))
    assert np.allclose(state.inertia(q), state.inertia(q).T)
    momentum = state.momentum(np.r_[1.0, rest[1:]])
    assert momentum.velocity[0] == pytest.approx(1)
    actuation = state.actuation(u)
    assert actuation.effort.shape == (model.nu,) and np.abs(actuation.residual[6:]).max() < 1e-9
    pose = state.pose("body", "pelvis")
    assert np.allclose(pose.rotation @ pose.rotation.T, np.eye(3))


def test_sensors(arm):
    model = cavort.Model(arm)
    state = cavort.State(model)
    state.inverse([0.3], [0.1], [0.1])
    assert state.sensor("angle")[0] == pytest.approx(0.3)
    assert np.allclose(state.sensor("where"), [-0.5 * np.sin(0.3), 0, -0.5 * np.cos(0.3)])
    assert set(state.sensors()) == {"where", "angle"}
    state.derivatives()
    by_q, by_v = state.sensor_derivatives("where")
    assert np.allclose(by_q[:, 0], [-0.5 * np.cos(0.3), 0, 0.5 * np.sin(0.3)]) and not by_v.any()


def test_order_of_release(humanoid):
    """A state may go after its model, and goes at once, without a collector of cycles."""
    freed = []
    model = cavort.Model(humanoid)
    state = cavort.State(model)
    weakref.finalize(state, freed.append, 1)
    gc.disable()
    try:
        del model
        state.position(state.model.q0)
        del state
        assert freed == [1]
    finally:
        gc.enable()
