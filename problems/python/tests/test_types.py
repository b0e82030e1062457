"""The package's type hints hold, and those of a program that uses it."""

import os
import subprocess
import sys

import cavort
import pytest

pytest.importorskip("mypy", reason="no mypy here")

PROGRAM = """import cavort
solution = cavort.solve(cavort.Problem.load("x"), threads=2)
reveal_type(solution.q)
cavort.Model(3)
"""


def mypy(*arguments, cwd):
    cache = os.path.join(os.path.dirname(os.path.dirname(cavort.__file__)), "mypy")
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", cache, *arguments]
    path = os.path.dirname(os.path.dirname(cavort.__file__))
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, env={**os.environ, "MYPYPATH": path})


def test_package(tmp_path):
    done = mypy("-p", "cavort", cwd=tmp_path)
    assert done.returncode == 0, done.stdout


def test_user(tmp_path):
    (tmp_path / "program.py").write_text(PROGRAM)
    told = mypy("program.py", cwd=tmp_path).stdout
    assert "ndarray" in told and 'Argument 1 to "Model" has incompatible type "int"' in told and "Found 1 error" in told, told
