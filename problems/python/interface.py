"""Writes the module that binds the library, from the library's own headers: nothing of them is copied by hand.

Usage: interface.py OUTPUT INCLUDE COMPILER...  The headers in INCLUDE/cavort go through the C preprocessor, without the
system's headers, and through cffi (ABI mode, out of line). OUTPUT is a Python module with their types and functions; its
name is that of the file.
"""

import contextlib
import io
import os
import subprocess
import sys
import tempfile

import cffi


def declarations(include: str, compiler: list[str]) -> str:
    """All of <cavort/cavort.h> as plain C, without attributes and comments."""
    with tempfile.TemporaryDirectory() as folder:
        # what the headers include of the system's are limits of macros and size_t, which cffi knows
        for name in ("float.h", "stddef.h", "limits.h", "stdint.h"):
            open(os.path.join(folder, name), "w").close()
        command = [*compiler, "-E", "-P", "-nostdinc", "-U__GNUC__", "-I", folder, "-I", include, "-x", "c", "-"]
        done = subprocess.run(command, input="#include <cavort/cavort.h>\n", text=True, capture_output=True)
    if done.returncode:
        raise SystemExit(f"interface.py: the headers in {include} cannot be preprocessed:\n{done.stderr}")
    return done.stdout


def write(output: str, include: str, compiler: list[str]) -> None:
    """Writes the module OUTPUT."""
    builder = cffi.FFI()
    builder.cdef(declarations(include, compiler))
    name = os.path.splitext(os.path.basename(output))[0]
    builder.set_source(name, None)
    with contextlib.redirect_stdout(io.StringIO()):
        builder.emit_python_code(output)


if __name__ == "__main__":
    if len(sys.argv) < 4:
        raise SystemExit(__doc__)
    write(sys.argv[1], sys.argv[2], sys.argv[3:])
