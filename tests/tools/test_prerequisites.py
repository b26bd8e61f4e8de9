"""What is missing on the machine is named with the package to install."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tools.prerequisites import missing_things

VERSION = f"python{sys.version_info.major}.{sys.version_info.minor}"


def test_nothing_is_missing_where_the_environment_was_made() -> None:
    assert missing_things(os.environ) == []


def test_missing_compilers_and_cmake_are_each_one_line(tmp_path: Path) -> None:
    assert missing_things({"PATH": str(tmp_path)}, cmake=True) == [
        "missing: C compiler; to install: sudo apt-get install gcc libc6-dev",
        "missing: C++ compiler; to install: sudo apt-get install g++",
        "missing: cmake; to install: sudo apt-get install cmake",
    ]


def test_a_compiler_named_by_cc_is_the_one_that_counts(tmp_path: Path) -> None:
    lines = missing_things({**os.environ, "CC": str(tmp_path / "no-such-compiler -O2")})
    assert lines == ["missing: C compiler; to install: sudo apt-get install gcc libc6-dev"]


def test_missing_headers_of_python(tmp_path: Path) -> None:
    assert missing_things(os.environ, include=str(tmp_path)) == [
        f"missing: Python headers (Python.h); to install: sudo apt-get install {VERSION}-dev"
    ]


def test_a_compiler_without_the_c_library(tmp_path: Path) -> None:
    compiler = tmp_path / "cc"
    compiler.write_text("#!/bin/sh\nexit 1\n")
    compiler.chmod(0o755)
    lines = missing_things({**os.environ, "CC": str(compiler)})
    assert lines == [
        f"missing: C library headers ({compiler} cannot build a program); to install: sudo apt-get install libc6-dev"
    ]


def test_missing_venv(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ensurepip", None)  # importing it now raises ImportError
    assert missing_things(os.environ) == [
        f"missing: Python's module venv; to install: sudo apt-get install {VERSION}-venv"
    ]


def test_an_old_python_is_told_what_is_needed() -> None:
    code = (
        "import sys; sys.version_info = (3, 9, 2, 'final', 0)\n"
        "from tools.setup_environment import main; sys.exit(main())"
    )
    result = subprocess.run(
        [sys.executable, "-c", code],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 2
    assert result.stderr.startswith("setup: Python 3.11 or newer is needed, found 3.9.2 (")
    assert result.stderr.count("\n") == 1
