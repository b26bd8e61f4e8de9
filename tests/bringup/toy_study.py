"""A study that takes no time, for tests: errors h², and points that end badly in every way."""

import itertools
import os
import signal
import time
from dataclasses import replace
from pathlib import Path

from tripod_sim.errors import SceneError, StepError
from tripod_study.plan import Plan, Settings, grid
from tripod_study.plan_file import read_plan
from tripod_study.task import Measured

ENDS = ("ok", "diverge", "refuse", "bug", "exit", "kill", "hang")

FILE = Path(__file__).with_name("toy.toml")
"""Its plan."""

BEFORE_GATE = 6
"""How many points are measured before those that follow wait at the gate."""


def make(
    *, ends: tuple[str, ...] = ("ok",), steps: tuple[float, ...] = (0.4, 0.2, 0.1), gate: str = "", log: str = "",
    limit: float = 600.0,
) -> Plan:  # fmt: skip
    """Return a plan.

    Args:
        ends: How points end, see `ENDS`.
        steps: Values of dt [s].
        gate: A folder; all points but the first `BEFORE_GATE` wait until it has a file `open`. Empty: none waits.
        log: A file that gets a line for each point that is measured; empty: none.
        limit: Longest time of a point [s]; by default more than any takes on a loaded machine.
    """
    made = read_plan(FILE, quick=False)
    default = {**made.default, "gate": gate, "log": log}
    return replace(made, default=default, points=tuple(grid(default, end=ends, dt=steps)), limit=limit)


def waiting(gate: Path) -> list[int]:
    """Return the processes that wait at a gate, or did."""
    return [int(file.name) for file in gate.glob("*/*")]


def _wait_at(gate: Path) -> None:
    """Take a number; if the first have gone through, tell this process's id and wait until the gate is open."""
    for number in itertools.count():
        try:
            (gate / str(number)).mkdir(parents=True)
            break
        except FileExistsError:
            continue
    if number < BEFORE_GATE:
        return
    (gate / str(number) / str(os.getpid())).touch()
    while not (gate / "open").exists():
        time.sleep(0.02)


def task(settings: Settings) -> Measured:
    if settings["gate"]:
        _wait_at(Path(str(settings["gate"])))
    if settings["log"]:
        with Path(str(settings["log"])).open("a") as file:
            file.write(f"{settings['dt']}\n")
    print("what a task prints is no record")
    match settings["end"]:
        case "diverge":
            raise StepError("element 7\nis inverted")
        case "refuse":
            raise SceneError("dt is 2 s")
        case "bug":
            raise ZeroDivisionError("float division by zero")
        case "exit":
            os._exit(3)
        case "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        case "hang":
            signal.pause()
    h = float(settings["dt"])
    return Measured({"x": [[1.0 + h**2, 0.1 * h**2]]}, [1e-3 / h, 1.5e-3 / h, 2e-3 / h], 2.0, 5)
