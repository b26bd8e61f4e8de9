"""The command limits set by parameters."""

import pytest

pytest.importorskip("rclpy")

from tests.messages import raises_naming
from tripod_graph.command import CommandError, CommandLimits
from tripod_graph.limits import LIMIT_PARAMETERS, limits_from

DEFAULTS = {p.name: p.default for p in LIMIT_PARAMETERS}


def test_defaults_are_those_of_the_limits_and_within_their_own_ranges() -> None:
    assert limits_from(DEFAULTS) == CommandLimits()
    for parameter in LIMIT_PARAMETERS:
        parameter.check(parameter.default)


def test_each_parameter_sets_the_limit_of_its_name() -> None:
    values = {
        "angle_min": -1.0,
        "angle_max": 0.25,
        "angle_speed": 2.0,
        "slide_max": 0.02,
        "slide_speed": 0.05,
        "timeout": 0.2,
        "park_after": 1.0,
        "park": [-0.5, -0.4, -0.3, 0.01],
    }
    limits = limits_from(values)
    assert {**values, "park": (-0.5, -0.4, -0.3, 0.01)} == {name: getattr(limits, name) for name in values}


def test_limits_that_contradict_each_other_are_refused() -> None:
    with raises_naming(CommandError, "park", "servo_1", "-1 rad", "-0.5 to 0.6 rad"):
        limits_from({**DEFAULTS, "angle_min": -0.5, "park": [0.0, -1.0, 0.0, 0.0]})
    with raises_naming(CommandError, "park", "3 values", 4):
        limits_from({**DEFAULTS, "park": [0.0, 0.0, 0.0]}, 3)
