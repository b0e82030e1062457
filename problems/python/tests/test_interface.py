"""The interface is that of the compiled library: sizes and offsets by the C compiler, and a changed header changes it."""

import importlib.util
import os
import shlex
import shutil
import subprocess

import interface
import pytest
from cavort._interface import ffi

SOURCE = os.environ["CAVORT_SOURCE"]
COMPILER = shlex.split(os.environ["CAVORT_COMPILER"])


def structs(of):
    """Struct types that have members."""
    typedefs = of.list_types()[0]
    found = [name for name in typedefs if of.typeof(name).kind == "struct" and of.typeof(name).fields]
    assert len(found) > 40
    return found


def measured(of, include, folder):
    """Sizes and offsets by the compiler."""
    lines = []
    for name in structs(of):
        lines.append(f'printf("{name} %zu\\n", sizeof({name}));')
        for member, field in of.typeof(name).fields:
            lines.append(f'printf("{name}.{member} %zu %zu\\n", offsetof({name}, {member}), sizeof((({name} *)0)->{member}));')
    program = os.path.join(folder, "layout")
    with open(program + ".c", "w") as file:
        file.write("#include <cavort/cavort.h>\n#include <stddef.h>\n#include <stdio.h>\nint main(void) {\n")
        file.write("\n".join(lines) + "\n}\n")
    subprocess.run([*COMPILER, "-std=gnu17", "-I", include, program + ".c", "-o", program], check=True)
    return subprocess.run([program], capture_output=True, text=True, check=True).stdout.split("\n")


def believed(of):
    """Sizes and offsets of an interface, in the same words."""
    lines = []
    for name in structs(of):
        lines.append(f"{name} {of.sizeof(name)}")
        for member, field in of.typeof(name).fields:
            lines.append(f"{name}.{member} {field.offset} {of.sizeof(field.type)}")
    return [*lines, ""]


def made_from(include, folder):
    """The interface that headers lead to."""
    output = os.path.join(folder, "made.py")
    interface.write(output, include, COMPILER)
    spec = importlib.util.spec_from_file_location("made", output)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.ffi


def test_layout(tmp_path):
    include = os.path.join(SOURCE, "include")
    assert measured(ffi, include, str(tmp_path)) == believed(ffi)


def test_changed_header(tmp_path):
    include = str(tmp_path / "include")
    shutil.copytree(os.path.join(SOURCE, "include"), include)
    header = os.path.join(include, "cavort", "model.h")
    with open(header) as file:
        text = file.read()
    changed = text.replace("  int nq, nv, nu;", "  char odd;\n  int nq, first, nv, nu;")
    assert changed != text
    with open(header, "w") as file:
        file.write(changed)
    other = made_from(include, str(tmp_path))
    told = measured(other, include, str(tmp_path))
    assert told == believed(other)
    # the check above can fail: the interface of before does not fit these headers
    assert measured(ffi, include, str(tmp_path)) != believed(ffi)


def test_constants():
    known = ffi.typeof("cav_status").elements
    assert known[0] == "CAV_OK" and "CAV_BAD_INPUT" in known.values()


def test_refused_headers(tmp_path):
    with pytest.raises(SystemExit, match="cannot be preprocessed"):
        interface.write(str(tmp_path / "none.py"), str(tmp_path), COMPILER)
