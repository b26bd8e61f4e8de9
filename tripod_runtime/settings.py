"""Parameters of the node."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tripod_graph.limits import (
    JOINT_STATES_PARAMETER,
    LIMIT_PARAMETERS,
    RANGE_TIME_PARAMETER,
    limits_from,
)
from tripod_graph.parameters import Parameter

PARAMETERS: tuple[Parameter, ...] = (
    Parameter("scene", "tripod", "Name of a shipped scene, or the path of a .toml file"),
    Parameter("set", "", "Overrides of the scene, dotted.path=value, separated by semicolons"),
    Parameter(
        "accuracy",
        "",
        "Cheapest setting with an error below this: 5%, draft, real-time, reference; empty: as it is",
    ),
    Parameter("study", "", "File of the study that accuracy looks into; empty: the scene's own"),
    Parameter(
        "body_rate", 30.0, "Node positions published a second", "Hz", low=0.1, high=1000.0, dynamic=True
    ),
    Parameter(
        "pose_rate",
        100.0,
        "Effector poses and joint states a second",
        "Hz",
        low=0.1,
        high=1000.0,
        dynamic=True,
    ),
    Parameter(
        "compliance_rate",
        50.0,
        "Compliances a second, while someone listens",
        "Hz",
        low=0.1,
        high=1000.0,
        dynamic=True,
    ),
    Parameter(
        "publish_clock",
        False,
        "Publish simulated time on /clock and command, stamp and move by it; the others take use_sim_time=true",
    ),
    Parameter("frame_prefix", "", "Stands before every frame on /tf but `world`: two robots have two"),
    *LIMIT_PARAMETERS,
    RANGE_TIME_PARAMETER,
    JOINT_STATES_PARAMETER,
)


def check(values: Mapping[str, Any]) -> None:
    """Raise ValueError where the values do not fit together, or name no accuracy or study; the scene is not read."""
    limits_from(values)
    if values["accuracy"]:
        from tripod_study.accuracy.choice import asked  # noqa: PLC0415 - only where it is asked for

        asked(values["accuracy"])
    if values["study"]:
        from tripod_study.accuracy.stored import read_study  # noqa: PLC0415

        read_study(Path(values["study"]))
