"""Models and problems of the tests: small ones from text, and those of the repository."""

import os
import sys

import pytest

SOURCE = os.environ["CAVORT_SOURCE"]
sys.path.append(os.path.join(SOURCE, "problems", "python"))

# a pendulum with a motor that holds it at any angle
ARM = """<mujoco model="arm"><option timestep="0.01"/><worldbody><body name="rod"><joint name="pivot" axis="0 1 0" damping=".1"/>
<geom name="ball" type="sphere" pos="0 0 -.5" size=".05" mass="1"/><site name="tip" pos="0 0 -.5"/></body></worldbody>
<actuator><motor name="motor" joint="pivot" gear="20" ctrlrange="-1 1" ctrllimited="true"/></actuator>
<sensor><framepos name="where" objtype="site" objname="tip"/><jointpos name="angle" joint="pivot"/></sensor></mujoco>"""

SWING = """<problem name="swing" model="arm.xml"><horizon duration="1" timestep="0.05"/><start/>
<goal><joint name="pivot" pos="1"/></goal><cost><posture name="there" dofs="all" at="end" weight="900"/></cost></problem>"""


@pytest.fixture(scope="session")
def arm(tmp_path_factory):
    """Path of the pendulum."""
    path = tmp_path_factory.mktemp("models") / "arm.xml"
    path.write_text(ARM)
    (path.parent / "swing.xml").write_text(SWING)
    return str(path)


@pytest.fixture(scope="session")
def swing(arm):
    """Path of a problem: swing the pendulum to one radian."""
    return os.path.join(os.path.dirname(arm), "swing.xml")


@pytest.fixture(scope="session")
def humanoid():
    """Path of the humanoid."""
    return os.path.join(SOURCE, "problems", "models", "humanoid.xml")
