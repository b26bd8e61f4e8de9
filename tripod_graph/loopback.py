"""How far the messages of ROS reach: this machine, by sockets of the loopback interface alone, or the subnet.

`ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST` looks for nobody else, but binds its sockets to all interfaces, even beside
those of a profile that binds to 127.0.0.1. So the profile alone is given, with the range that adds nothing to it.
Who has chosen transports, peers or another middleware himself keeps them, with that range.
"""

import os
import socket
from pathlib import Path
from typing import Final

from tripod_host.failures import RemediedError

RANGE: Final = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILES: Final = "FASTRTPS_DEFAULT_PROFILES_FILE"
OWN_PROFILES: Final = Path(__file__).with_name("loopback.xml")

CHOICES: Final = (PROFILES, "FASTDDS_BUILTIN_TRANSPORTS", "ROS_STATIC_PEERS", "ROS_DISCOVERY_SERVER")
"""Environment variables by which somebody has chosen how DDS communicates."""

PROFILES_HERE: Final = Path("DEFAULT_FASTRTPS_PROFILES.xml")
"""Fast DDS reads a file of this name in the working directory."""


PATIENCE: Final = 2.0
"""A packet to this machine itself is there at once; one that is not there after this time [s] is lost."""


def keep_local(*, subnet: bool = False) -> None:
    """Choose how far ROS discovery reaches; call it before the first `rclpy.init`.

    This machine unless `subnet`: then machines of the same subnet find each other. What is started here inherits it.
    """
    if os.environ.get(PROFILES) == str(OWN_PROFILES):
        del os.environ[PROFILES]
    if subnet:
        os.environ[RANGE] = "SUBNET"
    elif _somebody_chose():
        os.environ[RANGE] = "LOCALHOST"
    else:
        os.environ[RANGE] = "SYSTEM_DEFAULT"
        os.environ[PROFILES] = str(OWN_PROFILES)


def _somebody_chose() -> bool:
    """Whether the profile would be overridden by a choice of the user's, override it, or not be read."""
    known = os.environ.get("RMW_IMPLEMENTATION") or "rmw_fastrtps_cpp"
    distribution = os.environ.get("ROS_DISTRO") or "jazzy"
    chosen = any(os.environ.get(name) for name in CHOICES) or PROFILES_HERE.exists()
    return chosen or (known, distribution) != ("rmw_fastrtps_cpp", "jazzy") or not OWN_PROFILES.is_file()


class LoopbackError(RemediedError):
    """No message can go from this machine to itself; the message says why and what to do."""


def check_loopback() -> None:
    """Raise LoopbackError unless this machine can send a packet to itself."""
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.settimeout(PATIENCE)
            probe.bind(("127.0.0.1", 0))
            probe.sendto(b"?", probe.getsockname())
            probe.recv(1)  # where there is another way out, a packet takes that without an error
    except OSError as error:
        why = error.strerror or str(error)
        raise LoopbackError(
            f"the loopback interface does not work ({why})", "bring it up: sudo ip link set lo up"
        ) from None
