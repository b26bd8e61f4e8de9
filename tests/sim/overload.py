"""A machine that is as slow as a test says, and a study of two settings that are built in no time."""

import json
from pathlib import Path

from tripod_sim.accuracy.pace import Look

ASKED = {"mesh.element": "h20", "mesh.level": 1, "inertia.scheme": "tr_bdf2", "dt": 0.002}
CHEAP = {"mesh.element": "h8_modes", "mesh.level": 1, "inertia.scheme": "bdf2", "dt": 0.005}
SET = "mesh.level=1"
"""Of the scene tripod: with it, it is the dearer setting."""


def write_study(path: Path, *settings: dict[str, object]) -> Path:
    """Write a study of these settings of the Tripod, each with a fifth of the costs and twice the error of the last."""
    points = [
        {"settings": s, "status": "ok", "error": 0.01 * 2**k, "bound": 0.01 * 2**k, "cpu": 0.5 / 5**k}
        for k, s in enumerate(settings or (ASKED, CHEAP))
    ]
    made = {
        "format": 1, "study": "two", "scene": "tripod", "base": {}, "cpu": "s per simulated second",
        "quantities": [{"what": "how far the effector has moved"}], "points": points,
    }  # fmt: skip
    path.write_text(json.dumps(made))
    return path


class Said:
    """Stands for `Meter`: a second passes with each look, and the machine gives the steps what the test says."""

    def __init__(self) -> None:
        self.now, self.factor, self.cost, self.idle = 0.0, 1.0, 0.2, 2.0

    def look(self) -> Look:
        self.now += 1.0
        return Look(self.now, self.factor, self.cost, self.idle)

    def rest(self) -> None:
        pass

    def burden(self) -> None:
        self.factor, self.cost, self.idle = 0.31, 0.5, 0.0

    def relieve(self) -> None:
        self.factor, self.cost, self.idle = 1.0, 0.1, 2.0
