"""What is missing on the machine is named with the package to install."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.messages import assert_names
from tools.prerequisites import missing_things

VERSION = f"python{sys.version_info.major}.{sys.version_info.minor}"


def test_nothing_is_missing_where_the_environment_was_made() -> None:
    assert missing_things(os.environ) == []


def test_missing_compilers_and_cmake_are_each_one_line(tmp_path: Path) -> None:
    c, cpp, cmake = missing_things({"PATH": str(tmp_path)}, cmake=True)
    assert_names(c, "missing", "C compiler", "sudo apt-get install gcc libc6-dev")
    assert_names(cpp, "missing", "C++ compiler", "sudo apt-get install g++")
    assert_names(cmake, "missing", "cmake", "sudo apt-get install cmake")


def test_a_compiler_named_by_cc_is_the_one_that_counts(tmp_path: Path) -> None:
    (line,) = missing_things({**os.environ, "CC": str(tmp_path / "no-such-compiler -O2")})
    assert_names(line, "missing", "C compiler", "sudo apt-get install gcc libc6-dev")


def test_missing_headers_of_python(tmp_path: Path) -> None:
    (line,) = missing_things(os.environ, include=str(tmp_path))
    assert_names(line, "missing", "Python.h", f"sudo apt-get install {VERSION}-dev")


def test_a_compiler_without_the_c_library(tmp_path: Path) -> None:
    compiler = tmp_path / "cc"
    compiler.write_text("#!/bin/sh\nexit 1\n")
    compiler.chmod(0o755)
    (line,) = missing_things({**os.environ, "CC": str(compiler)})
    assert_names(line, "missing", "C library", compiler, "sudo apt-get install libc6-dev")


def test_missing_venv(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ensurepip", None)  # importing it now raises ImportError
    (line,) = missing_things(os.environ)
    assert_names(line, "missing", "module venv", f"sudo apt-get install {VERSION}-venv")


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
    assert_names(result.stderr, "setup: ", "Python 3.11", "found 3.9.2", sys.executable)
    assert result.stderr.count("\n") == 1
