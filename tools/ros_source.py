"""Where ROS 2 Jazzy comes from: the ROS that is sourced in this shell, or else wheels."""

import os
import platform
import sys
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tools.errors import MissingError

DISTRO = "jazzy"
WHEEL_MACHINE = "x86_64"
WHEEL_GLIBC = (2, 28)
WHEEL_PYTHONS = ((3, 11), (3, 13))
"""First and last Python with wheels that the rest of the suite accepts too."""

PATHS = ("AMENT_PREFIX_PATH", "LD_LIBRARY_PATH", "PYTHONPATH")
"""The variables through which a sourced ROS is found."""


@dataclass(frozen=True)
class RosSource:
    """Where the ROS that `.venv` uses comes from.

    Attributes:
        sourced: Entries of each variable of PATHS where ROS is sourced; None where it comes from wheels.
    """

    sourced: Mapping[str, tuple[str, ...]] | None

    @property
    def prefixes(self) -> tuple[str, ...]:
        """Prefixes that hold the sourced ROS packages; empty with wheels."""
        return self.sourced["AMENT_PREFIX_PATH"] if self.sourced else ()

    @property
    def description(self) -> str:
        """For people."""
        return f"ROS 2 Jazzy of {self.prefixes[0]}" if self.sourced else "ROS 2 Jazzy from wheels"


def find_ros(
    environ: Mapping[str, str],
    packages: Sequence[str],
    *,
    machine: str = platform.machine(),
    system: str = sys.platform,
    glibc: tuple[int, ...] | None = None,
    python: tuple[int, int] = (sys.version_info.major, sys.version_info.minor),
) -> RosSource:
    """Return where ROS comes from.

    Args:
        environ: The environment of the shell: ROS_DISTRO and the variables of PATHS.
        packages: ROS packages that the suite uses.
        machine: Processor architecture, as platform.machine() names it.
        system: As in sys.platform.
        glibc: Version of the C library; None asks this machine.
        python: Version of Python for which wheels are wanted.

    Raises:
        MissingError: another ROS is sourced, the sourced one lacks packages, or there are no wheels for this machine.
    """
    distro = environ.get("ROS_DISTRO", "")
    if distro == DISTRO:
        return _sourced(environ, packages)
    if distro:
        raise MissingError(
            f"ROS 2 '{distro}' is sourced, Tripod needs '{DISTRO}': source /opt/ros/{DISTRO}/setup.bash instead, "
            "or use a shell where no ROS is sourced"
        )
    remedy = f"install ROS 2 Jazzy, then source /opt/ros/{DISTRO}/setup.bash and repeat"
    if system != "linux" or machine != WHEEL_MACHINE:
        raise MissingError(
            f"wheels of ROS 2 Jazzy exist for Linux on {WHEEL_MACHINE} only, this is {system} on {machine}: {remedy}"
        )
    glibc = _glibc() if glibc is None else glibc
    if glibc < WHEEL_GLIBC:
        found = ".".join(map(str, glibc)) or "another C library"
        raise MissingError(f"wheels of ROS 2 Jazzy need glibc 2.28 or newer, found {found}: {remedy}")
    first, last = WHEEL_PYTHONS
    if not first <= python <= last:
        raise MissingError(
            "wheels of ROS 2 Jazzy exist for Python {}.{} to {}.{}, this is {}.{}; name another one: "
            "make setup PYTHON=python{}.{}".format(*first, *last, *python, *last)
        )
    return RosSource(None)


def used_packages(root: Path) -> list[str]:
    """Return the ROS packages that the package.xml files of the suite depend on."""
    names = set()
    for path in (root / "package.xml", root / "msgs" / "package.xml"):
        tree = ET.parse(path)
        names |= {e.text or "" for e in tree.getroot() if e.tag.endswith("depend")}
    return sorted(name for name in names - {"tripod_msgs"} if not name.startswith("python3-"))


def _sourced(environ: Mapping[str, str], packages: Sequence[str]) -> RosSource:
    paths = {name: tuple(filter(None, environ.get(name, "").split(os.pathsep))) for name in PATHS}
    index = "share/ament_index/resource_index/packages"
    lacking = [p for p in packages if not any(Path(x, index, p).exists() for x in paths["AMENT_PREFIX_PATH"])]
    if len(lacking) == len(packages):
        raise MissingError(
            f"ROS_DISTRO is {DISTRO} but AMENT_PREFIX_PATH leads to no ROS packages: "
            f"source /opt/ros/{DISTRO}/setup.bash"
        )
    if lacking:
        names = " ".join(f"ros-{DISTRO}-{p.replace('_', '-')}" for p in lacking)
        raise MissingError(
            f"missing: ROS packages {', '.join(lacking)}; to install: sudo apt-get install {names}"
        )
    return RosSource(paths)


def _glibc() -> tuple[int, ...]:
    try:
        text = os.confstr("CS_GNU_LIBC_VERSION") or ""
    except (ValueError, OSError):
        text = ""
    return tuple(int(n) for n in text.removeprefix("glibc ").split(".") if n.isdigit())
