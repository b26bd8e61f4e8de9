"""What `make setup` compiles is not compiled again by a run."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.messages import line_naming, lines_naming

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
    def compiled() -> set[Path]:
        return set(Path(environ["NUMBA_CACHE_DIR"]).rglob("*.nbc"))

    told = run(environ, "-m", "tools.compile_loops", "pendulum")
    last = line_naming(told, "1 of 1 scenes", "pendulum")
    assert told.splitlines()[-1] == last
    assert lines_naming(told, "compiling", "once", "loop")
    loops = compiled()
    assert loops
    assert run(environ, "-m", "tools.compile_loops", "pendulum").splitlines() == [last]
    run(environ, "-m", "tripod_bringup", "run", "pendulum", "--duration", "0.1")
    assert compiled() == loops
