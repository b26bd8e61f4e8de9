"""Runs a mesher as a process of its own: with a time limit, and ended with whoever waits for it."""

import importlib.util
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import tripod_host
from tripod_host import stop
from tripod_host.writing import scratch_folder
from tripod_sim.errors import SceneError

Say = Callable[[str], None]
"""Takes what is being done, in words, at least once a second."""

PERIOD = 0.2
"""Between two looks at the process [s]."""

PACKAGES = {"tetwild": ("pytetwild", "cad"), "gmsh_cad": ("gmsh", "step")}
"""The package that each program needs, and the extra that installs it."""

LIBRARY = "cannot open shared object file"
"""What the loader says of a missing system library."""


def run_mesher(program: str, given: dict[str, Any], limit: float, name: str, say: Say) -> dict[str, Any]:
    """Return the arrays that a program of this folder writes.

    Args:
        program: Its name, of `PACKAGES`.
        given: Arrays for it.
        limit: Longest time [s].
        name: What messages call the part.
        say: Told how long it has been running.

    Raises:
        SceneError: its package is not installed; it failed, or took longer than `limit`.
    """
    package, extra = PACKAGES[program]
    if importlib.util.find_spec(package) is None:
        raise SceneError(
            f"{name}: meshing needs the package {package}, which is not installed: pip install 'tripod[{extra}]'"
        )
    with scratch_folder() as folder:
        source, target, said = (folder / file for file in ("in.npz", "out.npz", "said"))
        np.savez(source, allow_pickle=False, **given)
        words = [str(Path(__file__).with_name(f"{program}.py")), str(os.getpid()), str(source), str(target)]
        paths = [str(Path(tripod_host.__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
        with said.open("wb") as out:
            process = subprocess.Popen(
                [sys.executable, "-P", *words],
                cwd=folder,  # where it may leave files of its own
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
            )

        def end() -> None:
            process.kill()
            process.wait()

        start = time.monotonic()
        with stop.first(end):
            try:
                while process.poll() is None:
                    taken = time.monotonic() - start
                    if taken > limit:
                        raise SceneError(
                            f"{name}: meshing took more than {limit:g} s and was stopped; give a larger size, simplify "
                            "the part, or allow more time (--time-limit)"
                        )
                    say(f"meshing: {taken:.0f} s")
                    time.sleep(PERIOD)
            finally:
                process.kill()
                process.wait()
        if process.returncode or not target.is_file():
            why = " ".join(said.read_text(errors="replace").split())[:300]
            if LIBRARY in why:
                why += "; install the system library, for gmsh: sudo apt-get install libglu1-mesa libxft2 libxcursor1"
            why = (
                why
                or f"the mesher {package} ended with {process.returncode}; is the file damaged? export it again"
            )
            raise SceneError(f"{name} cannot be meshed: {why}")
        with np.load(target, allow_pickle=False) as found:
            return dict(found)
