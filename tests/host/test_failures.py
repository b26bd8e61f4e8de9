"""Failures of the machine name the file and what to do; also those inside Numba, which names neither."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.messages import assert_names, names
from tripod_host.failures import failure_words, reason

ROOT = Path(__file__).parents[2]
HEAD = "from tripod_host.program import program\nwith program('it'):\n    import toy\n"
TOY = "from numba import njit\n@njit(cache=True)\ndef f(x):\n    return x + 1\n"
LIMIT = "    import resource\n    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))\n"
"""No file may grow: the disk is as good as full."""


def told(folder: Path, lines: str, **environment: str) -> str:
    """Return the one line that a program with a compiled loop ends with, with code 1."""
    (folder / "toy.py").write_text(TOY, encoding="utf-8")
    kept = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_CACHE")}
    done = subprocess.run(
        [sys.executable, "-c", HEAD + lines],
        cwd=folder, capture_output=True, text=True, check=False,
        env={**kept, "PYTHONPATH": f"{folder}:{ROOT}", **environment},
    )  # fmt: skip
    assert (done.returncode, done.stderr.count("\n")) == (1, 1), done.stderr
    return done.stderr


def test_where_compiled_loops_can_be_kept_nowhere_the_variable_to_set_is_named(tmp_path: Path) -> None:
    (tmp_path / "__pycache__").touch()  # a file where the folder would be: nobody can make one, nor root
    said = told(tmp_path, "    print(toy.f(1))\n", XDG_CACHE_HOME="/proc/none")
    assert_names(said, "it:", "compiled loops", "/proc/none/numba", "NUMBA_CACHE_DIR")


def test_where_compiled_loops_do_not_fit_the_place_and_the_variable_are_named(tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    said = told(tmp_path, f"{LIMIT}    print(toy.f(1))\n", NUMBA_CACHE_DIR=str(cache))
    assert_names(said, "it:", "compiled loops", str(cache), os.strerror(errno.EFBIG), "NUMBA_CACHE_DIR")


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT])
def test_a_full_disk_is_told_with_the_file_and_what_to_do(number: int) -> None:
    error = OSError(number, os.strerror(number), "/big/run.npz")
    assert_names(failure_words(error), "/big/run.npz", "free space", "another")
    assert os.strerror(number) in failure_words(error)
    named = OSError(number, reason(error), "/big/run.npz")
    assert failure_words(named) == failure_words(error), "the remedy is told once"
    assert not names(failure_words(OSError(errno.EACCES, os.strerror(errno.EACCES), "/big")), "room")


def test_another_failure_of_a_program_keeps_its_traceback() -> None:
    command = (
        "from tripod_host.program import program\nwith program('it'): raise RuntimeError('cannot cache')"
    )
    done = subprocess.run(
        [sys.executable, "-c", command], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert "Traceback" in done.stderr
