"""What an identification left unknown of the pose where the robot rests is told while the node runs."""

import subprocess
import sys
from pathlib import Path

import numpy as np

from tests.ik.plant import SpringRobot
from tests.messages import assert_names, names, raises_naming
from tripod_ik.errors import IkError
from tripod_ik.prediction_interval import APART, STILL, ExpectedError, PredictedError
from tripod_ik.settings import PARAMETERS, expected
from tripod_sim import load_scene

ROBOT, ANGLES = SpringRobot(slide=0.035), np.array([-1.2, -1.4, -0.9])
ERROR = PredictedError(np.array([1e-4, 0, 2e-4, 0, 0, 1e-3]), np.full(6, 3e-4))


class Bars:
    """Gives the same error everywhere, and counts how often it is asked."""

    def __init__(self, off: float = 0.0, failure: Exception | None = None) -> None:
        self.off, self.failure, self.asked = off, failure, 0

    def __call__(self, angles: np.ndarray, slide: float) -> tuple[np.ndarray, PredictedError]:
        self.asked += 1
        if self.failure:
            raise self.failure
        return ROBOT.state(angles).equilibrium + self.off, ERROR


def standing(bars: Bars, angles: np.ndarray = ANGLES, seconds: float = 2 * STILL) -> ExpectedError:
    told = ExpectedError(bars)
    stand(told, angles, 0.0, seconds)
    return told


def stand(told: ExpectedError, angles: np.ndarray, since: float, seconds: float) -> None:
    for now in since + np.arange(0.0, seconds, 0.02):
        told.look(ROBOT.state(angles), 0.035, float(now))
        told.close()


def test_it_is_computed_once_where_the_robot_stands_and_forgotten_where_it_moves() -> None:
    bars = Bars()
    told = standing(bars, seconds=STILL - 0.05)
    assert told.found is None
    assert bars.asked == 0
    stand(told, ANGLES + 4e-4, STILL, 3 * STILL)  # the noise of a servo
    assert told.found is ERROR
    assert bars.asked == 1
    shown = told.values()
    assert list(shown.values()) == ["0.0001 0 0.0002", "0 0 0.001", *["0.0003 0.0003 0.0003"] * 2]
    for key, unit in zip(shown, ("[m]", "[rad]") * 2, strict=True):
        assert_names(key, "expected error", unit)
    assert [names(key, "90 %") for key in shown] == [False, False, True, True]
    told.look(ROBOT.state(ANGLES + 0.1), 0.035, 5.0)
    assert told.found is None
    assert all(names(value, "robot moves") for value in told.values().values())
    stand(told, ANGLES + 0.1, 5.0, 2 * STILL)
    assert (bars.asked, told.found) == (2, ERROR)


def test_another_robot_than_the_identified_one_is_named() -> None:
    assert_names(standing(Bars(off=2 * APART)).reason, "1.00 mm", "identified scene", "model in use")
    failure = ValueError("slide 0.023")
    bars = Bars(failure=failure)
    told = standing(bars)
    assert (told.found, told.reason, bars.asked) == (None, str(failure), 1)


def test_a_file_without_posterior_is_refused(tmp_path: Path) -> None:
    values = {p.name: p.default for p in PARAMETERS}
    with raises_naming(IkError, "'posterior'", "missing.json"):
        expected(values | {"posterior": str(tmp_path / "missing.json")}, load_scene("tripod"))


def test_nothing_is_loaded_where_nobody_asks() -> None:
    code = (
        "import sys, tripod_ik.node\n"
        "from tripod_ik.settings import PARAMETERS, expected\n"
        "from tripod_sim import load_scene\n"
        "assert expected({p.name: p.default for p in PARAMETERS}, load_scene('tripod')) is None\n"
        "assert not {'tripod_ik.prediction_interval', 'tripod_identify'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
