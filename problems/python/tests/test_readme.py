"""Every block of README.md, every line of Python in the project's README.md, and every example, runs."""

import os
import re
import subprocess
import sys

import pytest

SOURCE = os.environ["CAVORT_SOURCE"]
HERE = os.path.join(SOURCE, "problems", "python")
TEXT = open(os.path.join(HERE, "README.md"), encoding="utf-8").read()
BLOCKS = re.findall(r"```python\n(.*?)```", TEXT, re.S)
FIRST = open(os.path.join(SOURCE, "README.md"), encoding="utf-8").read()
LINES = re.findall(r"^python3 -c '(.*)'$", TEXT + FIRST, re.M)
EXAMPLES = sorted(name for name in os.listdir(os.path.join(HERE, "examples")) if name.endswith(".py"))


def run(*arguments):
    """A fresh interpreter at the root of the sources."""
    done = subprocess.run([sys.executable, *arguments], cwd=SOURCE, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    assert done.stdout and not done.stderr, done.stderr


def test_found():
    assert len(BLOCKS) >= 3 and len(LINES) == 2 and EXAMPLES


@pytest.mark.parametrize("block", [*BLOCKS, *LINES])
def test_block(block):
    run("-c", block)


@pytest.mark.parametrize("name", EXAMPLES)
def test_example(name, tmp_path):
    run(os.path.join(HERE, "examples", name), str(tmp_path))
