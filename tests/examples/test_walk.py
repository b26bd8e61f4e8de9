"""The walk from a clone to one's own mesh seen moving, by the commands that examples/README.md tells."""

import base64
import json
import os
import re
import shlex
import signal
import subprocess
import zlib
from pathlib import Path
from urllib.request import urlopen

import numpy as np
import pytest

from tripod_view.player.packing import KINDS

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "examples" / "README.md").read_text(encoding="utf-8")
BLOCK = re.search(r"## From nothing to your own mesh moving\n\n```sh\n(.*?)```", TEXT, re.S)
COMMANDS = BLOCK[1].splitlines() if BLOCK else []
PATIENCE = 600
"""Longest time of one command on a loaded machine [s]."""


def test_there_are_at_most_eight_commands() -> None:
    assert 4 <= len(COMMANDS) <= 8


def test_they_lead_from_a_clone_to_a_page_on_which_the_mesh_moves(tmp_path: Path) -> None:
    try:
        subprocess.run(["git", "rev-parse"], cwd=ROOT, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout")
    done, last = COMMANDS[:-1], COMMANDS[-1]
    assert "make setup" in done
    # what it would install is what this test runs in; its code, compiled, too
    short = [f"ln -s {shlex.quote(str(ROOT))}/.venv .venv" if c == "make setup" else c for c in done]
    script = "set -e\n" + "\n".join(short).replace("ADDRESS", shlex.quote(str(ROOT)))
    environ = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run(
        ["bash", "-c", script], cwd=tmp_path, env=environ, check=True, capture_output=True, timeout=PATIENCE
    )

    folder = tmp_path / "tripod"
    assert (folder / "finger.vtk").exists()
    activated = f"source .venv/bin/activate && exec {last}"
    with subprocess.Popen(
        ["bash", "-c", activated],
        cwd=folder,
        env=environ,
        text=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    ) as shown:
        assert shown.stderr
        try:
            told = []
            for line in shown.stderr:
                told.append(line)
                if "Ctrl-C" in line:
                    break
            address = re.search(r"(http://127\.0\.0\.1:\S+)", "".join(told))
            assert address, told
            url = address[1].rstrip("/")
            assert "finger" in urlopen(f"{url}/", timeout=PATIENCE).read().decode()
            heights = lowest(json.load(urlopen(f"{url}/reel?from=0", timeout=PATIENCE)))
        finally:
            shown.send_signal(signal.SIGINT)
            shown.wait(PATIENCE)
    assert heights[0] == pytest.approx(-6e-3, abs=1e-3)  # [m]: half the height of the finger
    assert heights[-1] < heights[0] - 4e-3  # it has sunk


def lowest(answer: dict) -> np.ndarray:
    """The height of the lowest node in each picture that the page gets [m]."""
    reel = answer["reel"]
    data, (body,) = zlib.decompress(base64.b64decode(reel["data"])), reel["bodies"]
    entries = [body[name] for name in ("low", "step", "positions")]
    low, step, positions = (np.frombuffer(data, KINDS[e[0]], e[2], e[1]) for e in entries)
    whole = np.cumsum(positions.reshape(len(low) // 3, -1, 3), axis=0, dtype=np.uint16)
    return (low.reshape(-1, 1, 3) + step.reshape(-1, 1, 3) * whole)[..., 2].min(axis=1)
