"""Let `.venv` find the sourced ROS that it was made with, and the messages in it, from any shell.

`install` copies this file into the environment's site-packages with a `.pth` that imports it whenever its Python
starts. The dynamic linker reads LD_LIBRARY_PATH only when a process begins, so a Python that lacks an entry starts
itself again with it, once; its child processes inherit the result. What the shell has set comes first.
"""

import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path

NAME = "_tripod_sourced_ros"


def completed(environ: Mapping[str, str], entries: Mapping[str, list[str]]) -> dict[str, str]:
    """Return `environ` with those of the `entries` of each search path that it lacks, appended."""
    result = dict(environ)
    for name, wanted in entries.items():
        present = [p for p in environ.get(name, "").split(os.pathsep) if p]
        if lacking := [p for p in wanted if p not in present]:
            result[name] = os.pathsep.join(present + lacking)
    return result


def restart_if_incomplete() -> None:
    """Start this Python again if its environment lacks an entry that `install` noted."""
    entries = json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8"))
    environ = completed(os.environ, entries)
    if environ != dict(os.environ):
        os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], environ)


def install(site: Path, venv: Path, sourced: Mapping[str, tuple[str, ...]]) -> None:
    """Make the Python whose site-packages is `site` find `sourced` (search path to entries) and the messages."""
    own = {
        "AMENT_PREFIX_PATH": [str(venv)],
        "LD_LIBRARY_PATH": [str(venv / "lib")],
        "PYTHONPATH": [],
    }
    entries = {name: [*own[name], *found] for name, found in sourced.items()}
    (site / f"{NAME}.json").write_text(json.dumps(entries, indent=1), encoding="utf-8")
    (site / f"{NAME}.py").write_text(Path(__file__).read_text(encoding="utf-8"), encoding="utf-8")
    (site / f"{NAME}.pth").write_text(f"import {NAME}\n", encoding="utf-8")


if __name__ == NAME:
    restart_if_incomplete()
