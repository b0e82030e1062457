"""Every public name has a docstring, and what it documents is there."""

import inspect

import cavort

NAMES = [getattr(cavort, name) for name in cavort.__all__]


def members(kind):
    """Public functions and properties of a class of the package itself."""
    for name, member in vars(kind).items():
        if name.startswith("_") and name != "__init__":
            continue
        if inspect.isfunction(member) or isinstance(member, (property, classmethod, staticmethod)):
            yield name, member


def test_names():
    assert sorted(cavort.__all__) == cavort.__all__ and len(NAMES) > 15
    assert cavort.__doc__
    for thing in NAMES:
        assert thing.__doc__, thing


def test_members():
    seen = 0
    for kind in filter(inspect.isclass, NAMES):
        for name, member in members(kind):
            of = member.__func__ if isinstance(member, (classmethod, staticmethod)) else member
            told = inspect.getdoc(of) or (name == "__init__" and kind.__doc__)
            plain = isinstance(of, property) and of.fget.__name__ == "<lambda>"  # numbers that the class's own text lists
            assert told or plain and name in kind.__doc__, f"{kind.__name__}.{name}"
            seen += 1
    assert seen > 60
