"""A point's record: what it shows, what it costs, or how it ended."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from tripod_sim.errors import SceneError, StepError
from tripod_study.calibration import lately
from tripod_study.plan import Observed, Settings

SHORT, LONG, MOST = 0.5, 5.0, 5
"""Runs are repeated until they have taken SHORT [s] of CPU time in all and three times, unless they would pass LONG
[s]; at most MOST times."""


@dataclass
class Measured:
    """What a point shows and costs.

    Attributes:
        observed: Rows by quantity.
        cpu: CPU time of each repetition [s].
        amount: Simulated time of a repetition [s], or its static solutions.
        unknowns: Of a step.
    """

    observed: Observed
    cpu: list[float] = field(default_factory=list)
    amount: float = 1.0
    unknowns: int = 0


def repeated(run: Callable[[], float]) -> list[float]:
    """Return the CPU times [s] that `run` gives, as often as it takes to trust them."""
    taken: list[float] = []
    while len(taken) < MOST:
        taken.append(run())
        enough = len(taken) >= 3 and sum(taken) >= SHORT
        if enough or sum(taken) + taken[-1] > LONG:
            break
    return taken


def outcome(task: Callable[[Settings], Measured], settings: Settings) -> dict[str, Any]:
    """Return the record of a point, whatever happens to it.

    Returns:
        status (`ok`, `diverged`, `refused` by the scene's checks, or `failed`), message (empty if ok), observed, cpu
        [s], amount, unknowns, calibration [s].
    """
    record: dict[str, Any] = {"status": "ok", "message": "", "observed": {}, "cpu": [], "amount": 1.0}
    try:
        measured = task(settings)
    except SceneError as error:
        record.update(status="refused", message=_line(error))
    except StepError as error:
        record.update(status="diverged", message=_line(error))
    except Exception as error:  # noqa: BLE001 - whatever a point raises is its row, not the end of the study
        record.update(status="failed", message=f"{type(error).__name__}: {_line(error)}")
    else:
        record.update(
            observed=measured.observed,
            cpu=measured.cpu,
            amount=measured.amount,
            unknowns=measured.unknowns,
        )
    record["calibration"] = lately()
    return record


def _line(error: Exception) -> str:
    return " ".join(str(error).split())
