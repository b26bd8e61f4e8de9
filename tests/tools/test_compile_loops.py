"""What `make setup` compiles is not compiled again by a run."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def environ(tmp_path: Path) -> dict[str, str]:
    return {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}


def run(environ: dict[str, str], *words: str) -> str:
    done = subprocess.run(
        [sys.executable, *words], cwd=ROOT, env=environ, capture_output=True, text=True, check=True
    )
    return done.stdout + done.stderr


@pytest.mark.slow
def test_a_scene_that_was_compiled_runs_at_once(environ: dict[str, str]) -> None:
    told = run(environ, "-m", "tools.compile_loops", "pendulum").splitlines()
    assert told[-1] == "compiled the loops of 1 of 1 scenes: pendulum"
    assert any(line.startswith("compiling for this machine, once: loop ") for line in told)
    again = run(environ, "-m", "tools.compile_loops", "pendulum").splitlines()
    assert again == told[-1:]
    assert "compiling" not in run(environ, "-m", "tripod_bringup", "run", "pendulum", "--duration", "0.1")
