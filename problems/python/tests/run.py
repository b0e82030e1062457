"""Runs the tests by pytest on the package of a build. Usage: run.py BUILD SOURCE COMPILER...; 77: there is no pytest."""

import os
import sys

build, source, *compiler = sys.argv[1:]
os.environ.update(CAVORT_SOURCE=source, CAVORT_COMPILER=" ".join(compiler), PYTHONDONTWRITEBYTECODE="1")
os.environ["PYTHONPATH"] = build
sys.path.insert(0, build)
try:
    import pytest
except ImportError:
    print("skipped: no pytest here (sh problems/install.sh test)")
    sys.exit(77)
sys.exit(pytest.main(["-q", "-p", "no:cacheprovider", os.path.join(source, "problems", "python", "tests")]))
