"""`tripod doctor`: runs the checks of `doctor` and shows what they found."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from tripod_bringup.check import Check, Verdict
from tripod_bringup.doctor import OF_NODES, examine
from tripod_bringup.long_work import loading

COLOURS = {Verdict.OK: "green", Verdict.WARN: "yellow", Verdict.FAIL: "bold red"}


def doctor_command(recordings: Path, *, as_json: bool, ask: bool = False) -> int:
    """Examine the machine and print the findings; return 1 if a check failed, else 0."""
    with loading("tripod doctor", "checking"):
        checks = examine(recordings, ask=ask)
    if as_json:
        print(json.dumps([asdict(check) | {"verdict": check.verdict.value} for check in checks], indent=1))
    else:
        show(checks)
    return int(any(check.verdict is Verdict.FAIL for check in checks))


def show(checks: Sequence[Check]) -> None:
    """Print one line a check, and below it what to do."""
    from rich.console import Console  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    console = Console(markup=False, highlight=False, soft_wrap=True)
    width = max(len(check.name) for check in checks)
    for check in checks:
        line = Text(f"{check.verdict.value:<5}", style=COLOURS[check.verdict])
        line.append(f" {check.name:<{width}}  {check.found}", style="default")
        console.print(line)
        if check.advice:
            console.print(f"{'':<{width + 8}}{check.advice}", style="dim")
    console.print(verdict_line(checks))


def verdict_line(checks: Sequence[Check]) -> str:
    """Return whether this machine is ready, and which checks ask for something."""
    failed = [check.name for check in checks if check.verdict is Verdict.FAIL]
    if failed and set(failed) <= set(OF_NODES):
        return f"ready to simulate (`tripod run tripod`); for the nodes fix {', '.join(failed)}, as the lines above say"
    if failed:
        return f"not ready: fix {', '.join(failed)}, as the lines above say"
    if warned := [check.name for check in checks if check.verdict is Verdict.WARN]:
        return f"ready; look at {', '.join(warned)}"
    return "ready"
