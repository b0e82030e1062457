"""Builds the package: its modules, the shared library, and the interface made from that library's headers.

The library is the installed one that pkg-config knows (PKG_CONFIG names another pkg-config), where it is shared and of this
version; else it is built from the checkout around this folder, by meson. Either way a copy goes into the package, so the
two fit each other whatever is installed later.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py

try:
    from setuptools.command.bdist_wheel import bdist_wheel
except ImportError:
    from wheel.bdist_wheel import bdist_wheel

HERE = os.path.dirname(os.path.abspath(__file__))
CHECKOUT = os.path.dirname(os.path.dirname(HERE))
sys.path.insert(0, HERE)


def pkg_config(*arguments):
    """What pkg-config says of the installed library; "" where there is none."""
    command = [*shlex.split(os.environ.get("PKG_CONFIG", "pkg-config")), *arguments, "cavort"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""


def in_checkout():
    """Whether this folder stands in the library's sources."""
    return os.path.exists(os.path.join(CHECKOUT, "include", "cavort", "cavort.h"))


def version():
    """Of the checkout, or of the installed library."""
    if not in_checkout():
        return pkg_config("--modversion") or "0"
    with open(os.path.join(CHECKOUT, "meson.build"), encoding="utf-8") as file:
        return re.search(r"version: '([\d.]+)'", file.read()).group(1)


def installed():
    """(library, headers) of the installed shared library of this version, or None."""
    library = os.path.join(pkg_config("--variable=libdir"), "libcavort.so")
    if pkg_config("--modversion") != version() or not os.path.exists(library):
        return None
    return library, pkg_config("--variable=includedir")


def built(folder):
    """(library, headers) built from the checkout."""
    if not in_checkout():
        raise SystemExit(
            "cavort: no installed shared library of this version (pkg-config cavort), and no sources around this folder "
            "to build it from. Install the library by 'meson setup build -Ddefault_library=shared -Dtests=false && meson install -C build', "
            "or run pip on problems/python of a checkout"
        )
    for program in ("meson", "ninja"):
        if not shutil.which(program):
            raise SystemExit(f"cavort: {program} is needed to build the library (sh problems/install.sh build)")
    options = ["-Ddefault_library=shared", "-Dpython=disabled", "-Dpeers=disabled", "--buildtype=release"]
    again = ["--reconfigure"] if os.path.exists(os.path.join(folder, "build.ninja")) else []
    subprocess.run(["meson", "setup", *again, folder, CHECKOUT, *options], check=True)
    subprocess.run(["meson", "compile", "-C", folder, "cavort:shared_library"], check=True)
    return os.path.join(folder, "libcavort.so"), os.path.join(CHECKOUT, "include")


class Build(build_py):
    """The modules, and what is made beside them."""

    def run(self):
        super().run()
        import interface

        package = os.path.join(self.build_lib, "cavort")
        library, headers = installed() or built(os.path.abspath("build/library"))
        print(f"cavort: the library is {library}")
        shutil.copyfile(library, os.path.join(package, "libcavort.so"))
        compiler = shlex.split(os.environ.get("CC", "cc"))
        interface.write(os.path.join(package, "_interface.py"), headers, compiler)


class Wheel(bdist_wheel):
    """Of one platform, for any Python: nothing in it is compiled against one."""

    def finalize_options(self):
        super().finalize_options()
        self.root_is_pure = False

    def get_tag(self):
        return "py3", "none", super().get_tag()[2]


class Binary(Distribution):
    """It carries a library."""

    def has_ext_modules(self):
        return True


setup(version=version(), distclass=Binary, cmdclass={"build_py": Build, "bdist_wheel": Wheel})
