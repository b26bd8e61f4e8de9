"""Where ROS writes its logs: without such a place it starts nothing, and says so in many lines."""

import os
from collections.abc import Mapping
from pathlib import Path

from tripod_host.failures import RemediedError


class LogPlaceError(RemediedError):
    """ROS has no place for its logs; the message says why and what to do."""


def check_log_place(environment: Mapping[str, str]) -> None:
    """Make the directory of ROS's logs where there is none. Raises LogPlaceError where that is not possible."""
    place = log_place(environment)
    if place is None:
        raise LogPlaceError(
            "HOME is not set, so ROS has no place for its logs", "set ROS_LOG_DIR to a directory"
        )
    try:
        place.mkdir(parents=True, exist_ok=True)
        why = "" if os.access(place, os.W_OK | os.X_OK) else "Permission denied"
    except OSError as error:
        why = error.strerror or str(error)
    if why:
        raise LogPlaceError(
            f"ROS cannot write its logs into {place}: {why}", "set ROS_LOG_DIR to another directory"
        )


def log_place(environment: Mapping[str, str]) -> Path | None:
    """Return the directory that ROS takes: ROS_LOG_DIR, else `log` in ROS_HOME, else `.ros/log` at home; None: none."""
    home = environment.get("HOME", "")

    def named(name: str) -> str:
        value = environment.get(name, "")
        return home + value[1:] if value.startswith("~") else value

    if place := named("ROS_LOG_DIR"):
        return Path(place)
    if place := named("ROS_HOME"):
        return Path(place) / "log"
    return Path(home) / ".ros" / "log" if home else None
