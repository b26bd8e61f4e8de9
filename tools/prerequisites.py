"""What the machine must have before `.venv` can be made: compilers, Python's headers, venv."""

import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Mapping
from pathlib import Path

C_COMPILERS = ("cc", "gcc", "clang")
CXX_COMPILERS = ("c++", "g++", "clang++")


def missing_things(
    environ: Mapping[str, str], *, include: str | None = None, cmake: bool = False
) -> list[str]:
    """Return one line for each thing that is missing, with the Debian package to install; empty if all is there.

    Args:
        environ: The environment: PATH, and CC and CXX where another compiler is wanted.
        include: Folder of Python.h; None takes that of this Python.
        cmake: Whether the machine must have cmake (where ROS is sourced, the wheel is not used).
    """
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    lines = []
    if not _has_venv():
        lines.append(_line("Python's module venv", f"{version}-venv"))
    compiler = _find(environ, "CC", C_COMPILERS)
    if compiler is None:
        lines.append(_line("C compiler", "gcc libc6-dev"))
    elif not _builds(compiler, "c", "#include <stdio.h>\nint main(void) { return putchar(10); }\n"):
        lines.append(_line(f"C library headers ({compiler} cannot build a program)", "libc6-dev"))
    elif not _builds(compiler, "c", "#include <Python.h>\n", include or sysconfig.get_path("include")):
        lines.append(_line("Python headers (Python.h)", f"{version}-dev"))
    compiler = _find(environ, "CXX", CXX_COMPILERS)
    if compiler is None or not _builds(
        compiler, "c++", "#include <vector>\nint main() { return std::vector<int>().size(); }\n"
    ):
        lines.append(_line("C++ compiler", "g++"))
    if cmake and not shutil.which("cmake", path=environ.get("PATH", "")):
        lines.append(_line("cmake", "cmake"))
    return lines


def _line(what: str, package: str) -> str:
    return f"missing: {what}; to install: sudo apt-get install {package}"


def _has_venv() -> bool:
    try:
        import ensurepip  # noqa: PLC0415 - Debian ships it apart
        import venv  # noqa: F401, PLC0415

        return bool(ensurepip.version())
    except (ImportError, AttributeError, OSError):
        return False


def _find(environ: Mapping[str, str], variable: str, names: tuple[str, ...]) -> str | None:
    for name in (environ[variable].split()[0],) if environ.get(variable, "").strip() else names:
        if path := shutil.which(name, path=environ.get("PATH", os.defpath)):
            return path
    return None


def _builds(compiler: str, language: str, source: str, include: str | None = None) -> bool:
    """Whether `source` compiles: to a program, or only checked where an `include` folder is given."""
    with tempfile.TemporaryDirectory() as folder:
        ending = ["-I", include, "-fsyntax-only"] if include else ["-o", str(Path(folder, "program"))]
        words = [compiler, "-x", language, "-", *ending]
        return subprocess.run(words, input=source.encode(), capture_output=True, check=False).returncode == 0
