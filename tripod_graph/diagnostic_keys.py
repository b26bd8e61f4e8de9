"""Keys and words of the values in `/diagnostics` that other programs of the suite read: none reads a sentence."""

from enum import StrEnum
from typing import Final

STATE: Final = "state"
"""Of every node: a name of its states; of the recorder one of `Recording`."""

PATH: Final = "path"
"""Of the recorder: the recording."""

CONNECTION_ERROR: Final = "connection error"
"""Of the driver: why the servos cannot be reached; empty while they can."""

LOAD: Final = "load [N]"
LOAD_HALF: Final = "load, half of 90 % [N]"
PUSH: Final = "push along x and y [N]"
"""Of the inverse kinematics: the load on the effector, half its 90 % interval, the force across it."""

EXPECTED_ERROR: Final = "expected error [m]"
EXPECTED_ERROR_HALF: Final = "expected error, half of 90 % [m]"
"""Of the inverse kinematics: the expected error of the pose, and half its 90 % interval."""


class Recording(StrEnum):
    """State of the recorder."""

    OFF = "not recording"
    ON = "recording"
    ENDED = "ended by an error"
