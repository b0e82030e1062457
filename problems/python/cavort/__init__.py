"""Motions of robots and characters out of a model and a wish, and the contact dynamics under them.

    import cavort
    solution = cavort.solve(cavort.Problem.load("problems/motions/squat-jump/problem.xml"))
    solution.q, solution.verdict.certified

Units are m, kg, s, rad, N; q and v are laid out as MJCF does (quaternions w x y z). Arrays look at the library's memory
where it stays in its place, without copies, and keep it alive.
"""

from ._draft import Draft, Element
from ._library import Error, Options, Record, lib, text
from ._model import Derivatives, Model
from ._problem import Problem
from ._solution import Solution
from ._solve import solve
from ._state import Actuation, Momentum, Pose, State
from ._term import Jacobian, Knot, Quantity, Term

__version__ = text(lib.cav_version())
__all__ = [
    "Actuation",
    "Derivatives",
    "Draft",
    "Element",
    "Error",
    "Jacobian",
    "Knot",
    "Model",
    "Momentum",
    "Options",
    "Pose",
    "Problem",
    "Quantity",
    "Record",
    "Solution",
    "State",
    "Term",
    "solve",
]
