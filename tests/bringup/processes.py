"""Waiting for what other processes do, however busy the machine."""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from tests.domains import own_domain

DEADLINE = 120.0
"""For a loaded machine [s]; nothing waits so long unless it fails."""


def alive(pid: int) -> bool:
    """Return whether a process still runs; one that has ended and was not waited for does not."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[0] not in "ZX"


def wait_until(condition: Callable[[], object]) -> bool:
    """Wait until `condition` holds; return whether it did within `DEADLINE`."""
    end = time.monotonic() + DEADLINE
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def play_to_simulator(file: Path) -> str:
    """Return what `tripod bag play --to sim` says of a recording, played as fast as it can be in a ROS domain of its
    own. It must end well.
    """
    with own_domain() as domain:
        found = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        words = ["bag", "play", str(file), "--to", "sim", "--rate", "inf"]
        played = subprocess.run(
            [sys.executable, "-m", "tripod_bringup", *words],
            env=os.environ | found,
            cwd=file.parent,
            capture_output=True,
            text=True,
            timeout=DEADLINE,
            check=False,
        )
    assert played.returncode == 0, played.stderr
    return played.stdout
