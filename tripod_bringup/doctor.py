"""Checks of the machine, each a small function of what it looks at, each with what to do when it fails."""

import errno
import importlib.metadata
import importlib.util
import os
import socket
import statistics
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from shutil import which

from tripod_bringup.check import Check, Verdict
from tripod_bringup.doctor_ports import ask_device, check_ports
from tripod_bringup.lock import DomainError, domain_id
from tripod_graph.log_place import check_log_place, log_place
from tripod_graph.loopback import check_loopback
from tripod_host.failures import ELSEWHERE, RemediedError, existing, first_writable, kernel_places
from tripod_host.slow_machine import WHAT_TO_DO
from tripod_record.errors import RecordError
from tripod_record.place import check_place, free_space

PYTHON_NEEDED = (3, 11)
ENOUGH_SPACE = 200_000_000
"""Free space without which no recording begins [bytes]."""
SLOW_PRODUCT = 0.080
"""Time of the calibration product above which the default scene may not keep up with real time [s]."""


def check_python(version: Sequence[int] = tuple(sys.version_info[:3])) -> Check:
    """Whether the interpreter is new enough."""
    found = ".".join(str(n) for n in version[:3])
    wanted = ".".join(str(n) for n in PYTHON_NEEDED)
    if tuple(version[:2]) < PYTHON_NEEDED:
        return Check("Python", Verdict.FAIL, found, f"install Python {wanted} or newer")
    return Check("Python", Verdict.OK, found)


@dataclass(frozen=True)
class Probe:
    """What a Python program did: exit code, standard output, last line of standard error."""

    code: int
    out: str
    error: str = ""


def probe(program: str) -> Probe:
    """Run a Python program in a process of its own: a wrong middleware ends the whole process that imports it."""
    command = [sys.executable, "-c", program]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        return Probe(1, "", str(error))
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    return Probe(done.returncode, done.stdout.strip(), lines[-1] if lines else f"exit code {done.returncode}")


_RCLPY = "import rclpy.utilities; print(rclpy.utilities.get_rmw_implementation_identifier())"


def check_rclpy(
    environment: Mapping[str, str] = os.environ,
    run: Callable[[str], Probe] = probe,
    version: Callable[[], str] | None = None,
) -> Check:
    """Whether rclpy can be imported, its version and its middleware."""
    tried = run(_RCLPY)
    if tried.code == 0:
        return Check("rclpy", Verdict.OK, f"{(version or _rclpy_version)()}, {tried.out}")
    advice = "run `make setup`, or source /opt/ros/jazzy/setup.bash"
    if asked := environment.get("RMW_IMPLEMENTATION"):
        advice = f"unset RMW_IMPLEMENTATION, which asks for {asked}; or {advice}"
    return Check("rclpy", Verdict.FAIL, tried.error, advice)


def _rclpy_version() -> str:
    for name in ("ros-jazzy-rclpy", "rclpy"):
        try:
            return importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return "unknown version"


def check_discovery(environment: Mapping[str, str] = os.environ) -> Check:
    """How far ROS discovery reaches: the nodes of this suite choose it themselves, other tools read it."""
    try:
        domain = domain_id(environment)
    except DomainError as error:
        return Check("ROS discovery", Verdict.FAIL, str(error), "unset ROS_DOMAIN_ID or correct it")
    reach = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "")
    if environment.get("ROS_LOCALHOST_ONLY") == "1":
        return Check(
            "ROS discovery",
            Verdict.WARN,
            f"domain {domain}, ROS_LOCALHOST_ONLY=1",
            "unset it: it is out of date and overrides ROS_AUTOMATIC_DISCOVERY_RANGE",
        )
    found = f"domain {domain}, {reach or 'range not set'}"
    if reach != "LOCALHOST":
        advice = "nodes of this suite stay on this machine unless --subnet is given; for other ROS tools: "
        return Check(
            "ROS discovery", Verdict.OK, found, advice + "export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST"
        )
    return Check("ROS discovery", Verdict.OK, found)


def check_start(environment: Mapping[str, str] = os.environ) -> Check:
    """Whether a node could start: it needs the loopback interface and a place for ROS's logs."""
    try:
        check_loopback()
        check_log_place(environment)
    except RemediedError as error:
        return Check("start of nodes", Verdict.FAIL, error.found, error.remedy)
    return Check("start of nodes", Verdict.OK, f"loopback works, logs in {log_place(environment)}")


def check_messages(run: Callable[[str], Probe] = probe) -> Check:
    """Whether the messages are built and complete."""
    wanted = ("BodyState", "Compliance", "ControlMode", "IkStatus", "RobotStatus", "SimStatus")
    tried = run(f"from tripod_msgs.msg import {', '.join(wanted)}")
    if tried.code:
        return Check("tripod_msgs", Verdict.FAIL, tried.error, "run `make setup`, which builds msgs/")
    return Check("tripod_msgs", Verdict.OK, f"{len(wanted)} messages")


SIMULATOR = ("numpy", "scipy", "numba", "qdldl", "osqp")
"""What the simulator and inverse kinematics import."""

NODES = ("serial", "websockets", "mcap", "yaml")
"""What the nodes import besides that and ROS."""

OF_NODES = ("rclpy", "tripod_msgs", "packages of nodes")
"""Checks that a machine passes only where it can run nodes; without them it simulates."""


def check_packages(
    name: str, packages: Sequence[str], find: Callable[[str], object] = importlib.util.find_spec
) -> Check:
    """Whether packages are installed, under the name of a check."""
    if missing := [package for package in packages if find(package) is None]:
        return Check(name, Verdict.FAIL, f"without {', '.join(missing)}", "run `make setup`")
    return Check(name, Verdict.OK, ", ".join(packages))


PROGRAMS = {"ffmpeg": "films by --gif and --mp4", "avrdude": "tripod flash"}
"""Programs that only some commands need, and which; Debian's packages have the same names."""


def check_programs(find: Callable[[str], str | None] = which) -> Check:
    """Whether the programs that some commands need are there: without one everything else works."""
    missing = [name for name in PROGRAMS if find(name) is None]
    if not missing:
        return Check("programs", Verdict.OK, ", ".join(PROGRAMS))
    needed = "; ".join(f"{name} is needed for {PROGRAMS[name]}" for name in missing)
    advice = f"{needed}: sudo apt-get install {' '.join(missing)}"
    return Check("programs", Verdict.OK, f"without {', '.join(missing)}", advice)


def check_page_port(number: int = 8080) -> Check:
    """Whether the page can have its port."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", number))
        except OSError as error:
            reason = "in use" if error.errno == errno.EADDRINUSE else error.strerror
            advice = "the page will take the next free port and say which; or choose one with --view-port"
            return Check("page port", Verdict.WARN, f"127.0.0.1:{number} {reason}", advice)
    return Check("page port", Verdict.OK, f"127.0.0.1:{number} free")


def check_recordings(directory: Path, enough: int = ENOUGH_SPACE) -> Check:
    """Whether `directory`, which is not created, can take recordings; `enough`: space needed [bytes]."""
    place = existing(directory)
    try:
        check_place(place, enough)
        space = free_space(place)
    except (RecordError, OSError) as error:
        return Check("recordings", Verdict.FAIL, str(error), "or record elsewhere with --record DIR")
    return Check("recordings", Verdict.OK, f"{directory}: {space / 1e9:.1f} GB free")


def check_kernel_cache(candidates: Sequence[Path] | None = None) -> Check:
    """Whether compiled loops can be kept; where they cannot, Numba refuses to compile any."""
    places = kernel_places() if candidates is None else candidates
    if place := first_writable(places):
        return Check("kernel cache", Verdict.OK, str(place))
    shown = ", ".join(str(place) for place in places)
    return Check("kernel cache", Verdict.FAIL, f"not writable: {shown}", ELSEWHERE)


_PRODUCT = """
import os
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"): os.environ[name] = "1"
import numpy, time
a = numpy.random.default_rng(0).standard_normal((1000, 1000))
a @ a
for _ in range(5):
    start = time.perf_counter(); a @ a; print(time.perf_counter() - start)
"""


def measure_product() -> float:
    """Return the median time of a 1000 x 1000 float64 matrix product in one thread [s]."""
    done = subprocess.run(
        [sys.executable, "-c", _PRODUCT], check=True, capture_output=True, text=True, timeout=60
    )
    return statistics.median(float(line) for line in done.stdout.split())


def check_speed(measure: Callable[[], float] = measure_product) -> Check:
    """How fast one core is, by the calibration that the benchmarks print."""
    try:
        seconds = measure()
    except (subprocess.SubprocessError, OSError, statistics.StatisticsError) as error:
        return Check("speed", Verdict.FAIL, f"numpy does not run: {error}", "run `make setup`")
    found = f"1000 x 1000 product in {seconds * 1e3:.0f} ms, one thread"
    if seconds > SLOW_PRODUCT:
        advice = f"slow or busy: the simulation may fall behind real time; {WHAT_TO_DO}"
        return Check("speed", Verdict.WARN, found, advice)
    return Check("speed", Verdict.OK, found)


def examine(recordings: Path, *, ask: bool = False) -> list[Check]:
    """Run every check; `recordings` is where recordings would go, `ask` whether boards are asked for their firmware."""
    return [
        check_python(),
        check_rclpy(),
        check_discovery(),
        check_start(),
        check_messages(),
        check_packages("packages", SIMULATOR),
        check_packages("packages of nodes", NODES),
        check_programs(),
        *check_ports(answer_of=ask_device if ask else None),
        check_page_port(),
        check_recordings(recordings),
        check_kernel_cache(),
        check_speed(),
    ]
