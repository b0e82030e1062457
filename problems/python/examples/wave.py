"""A model and a wish of one's own, from nothing to numbers: an arm on a post that waves once and comes to rest upright.

Usage: wave.py [FOLDER]; the model goes there, and the motion as a table. Cells as in a notebook (# %%).
"""

# %% a model: two links, two motors, a hand
import os
import sys

import numpy as np

import cavort

MODEL = """<mujoco model="waver">
  <compiler angle="degree"/>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 1"/>
    <body name="upper arm" pos="0 0 1">
      <joint name="shoulder" axis="0 1 0" range="-170 170" limited="true" damping="0.2"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.03" mass="1.5"/>
      <body name="forearm" pos="0 0 -0.3">
        <joint name="elbow" axis="0 1 0" range="-140 0" limited="true" damping="0.1"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.25" size="0.025" mass="1"/>
        <site name="hand" pos="0 0 -0.27"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="shoulder" joint="shoulder" gear="25" ctrlrange="-1 1" ctrllimited="true"/>
    <motor name="elbow" joint="elbow" gear="12" ctrlrange="-1 1" ctrllimited="true"/>
  </actuator>
</mujoco>"""

folder = sys.argv[1] if len(sys.argv) > 1 else "."
path = os.path.join(folder, "waver.xml")
with open(path, "w", encoding="utf-8") as file:
    file.write(MODEL)
problem = cavort.Problem(path, duration=2.0, timestep=0.05, name="wave")
model = problem.model
print(model)

# %% a wish: from hanging to a raised arm, the hand high and to the right on the way, to the left a little later, then at rest
raised = np.radians([-160.0, -20.0])
problem.q_start = [0.0, 0.0]
problem.q_goal = raised
problem.cost("sensor", 400, type="framepos", site="hand", component="x", target=0.3, at=1.0, within=0.05, name="right")
problem.cost("sensor", 400, type="framepos", site="hand", component="x", target=-0.1, at=1.5, within=0.05, name="left")
problem.cost("posture", 900, dofs="all", at=2.0, name="raised")
problem.constraint("velocity", dofs="all", at=2.0, name="rest")
problem.constraint("velocity", joint="shoulder", lower=-5, upper=5, name="speed limit")

# %% solved
solution = cavort.solve(problem)
print(solution)

# %% read: whether it holds, what was asked and got, and why it is as it is
verdict = solution.verdict
print("certified:", verdict.certified, verdict.reason)
print("achieved:", verdict.achieved, verdict.missed)
for term in solution.terms:
    if term.has_target and np.isfinite(term.within):
        print(f"  {term.name}: wanted {term.wanted:.3f}, got {term.got:.3f} {term.unit}")
print("largest effort of each motor:", np.nanmax(np.abs(solution.effort), axis=0).round(3))
for reason in solution.explain().conflict[:1]:
    print("pulls most:", reason.what)

# %% in numbers, for other tools
state = cavort.State(model)
hand = []
for q in solution.q:
    state.position(q)
    hand.append(state.pose("site", "hand").pos)
print("the hand rises by", round(float(np.ptp(np.array(hand)[:, 2])), 3), "m")
solution.save_trajectory(os.path.join(folder, "wave.csv"))
