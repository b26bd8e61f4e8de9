"""With what a recording was made: versions of the suite and of what it rests on."""

import json
import platform
import shutil
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = ("tripod", "numpy", "scipy", "numba", "qdldl", "osqp", "mcap", "ros-jazzy-rclpy")
"""Those of which results depend."""

PATIENCE = 5.0
"""Longest time that git may take [s]."""


def versions_json() -> str:
    """Return versions of packages, Python, machine and, from a checkout, the git revision, as a JSON object."""
    found = {name: _version(name) for name in PACKAGES}
    return json.dumps(
        {"git": git_revision(), "python": platform.python_version(), "machine": platform.platform(), **found},
        indent=2,
    )


def git_revision(folder: Path = Path(__file__).parent) -> str:
    """Return the revision of the checkout that this code is in, "-dirty" behind it if files differ; empty: none."""
    if not (folder.parent / ".git").exists() or not (git := shutil.which("git")):
        return ""
    try:
        done = subprocess.run(
            [git, "-C", str(folder.parent), "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"],
            capture_output=True,
            timeout=PATIENCE,
            check=False,
            text=True,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
