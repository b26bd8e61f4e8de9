"""A study that takes no time, for tests: errors h², and points that end badly in every way."""

import os
import signal
import time
from pathlib import Path

from tripod_sim.errors import SceneError, StepError
from tripod_sim.study.plan import Knob, Plan, Quantity, Reference, Settings, grid
from tripod_sim.study.task import Measured

ENDS = ("ok", "diverge", "refuse", "bug", "exit", "kill", "hang")

DEFAULT: Settings = {"dt": 0.4, "end": "ok", "pause": 0.0, "log": ""}


def rungs(settings: Settings) -> tuple[Settings, ...]:
    return tuple({**settings, "dt": h, "end": "ok"} for h in (0.02, 0.01))


def make(
    *, ends: tuple[str, ...] = ("ok",), steps: tuple[float, ...] = (0.4, 0.2, 0.1), pause: float = 0.0, log: str = "",
    limit: float = 20.0,
) -> Plan:  # fmt: skip
    default = {**DEFAULT, "pause": pause, "log": log}
    return Plan(
        name="toy", title="Toy", scene="none", module="tests.bringup.toy_study", version=1,
        others=(Knob("end", "end", "how it ends"),), default=default,
        points=tuple(grid(default, end=ends, dt=steps)),
        quantities=(Quantity("x", "m", "a number", scale="largest"),),
        references=(Reference("reference", rungs, order=2.0, sizes=(2.0, 1.0)),),
        group="end", quick=False, order_knob="dt", order_quantity="x", limit=limit,
    )  # fmt: skip


def plan(*, quick: bool) -> Plan:
    return make()


def task(settings: Settings) -> Measured:
    time.sleep(float(settings["pause"]))
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
            time.sleep(60)
    h = float(settings["dt"])
    return Measured({"x": [[1.0 + h**2, 0.1 * h**2]]}, [1e-3 / h, 1.5e-3 / h, 2e-3 / h], 2.0, 5)
