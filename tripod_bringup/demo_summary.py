"""What the demo measured and how it says so; what was not measured is never printed as a number. Pure."""

import statistics
from dataclasses import dataclass, field
from math import sqrt
from pathlib import Path

from tripod_host.slow_machine import CHEAPER, WHAT_TO_DO

ERROR_WANTED = 0.5e-3
"""Root mean square of the tracking error that the demo should stay below [m]."""

KEPT_UP = 0.95
"""Median real-time factor below which the simulation is called too slow."""

COARSER = f'make demo ARGS="{CHEAPER}"'
"""The demo with the setting for slow machines."""

SAMPLE = 1000
"""Most numbers of one stream that are kept for their median."""


@dataclass
class Spread:
    """Running root mean square and maximum of a stream of numbers."""

    count: int = 0
    square_sum: float = 0.0
    largest: float = 0.0

    def add(self, value: float) -> None:
        """Take one number."""
        self.count += 1
        self.square_sum += value * value
        self.largest = max(self.largest, abs(value))

    @property
    def rms(self) -> float | None:
        """Root mean square, None before the first number."""
        return sqrt(self.square_sum / self.count) if self.count else None


@dataclass
class Sample:
    """Numbers of a stream, evenly spaced over all of it and never more than `SAMPLE`: it may last for days.

    Attributes:
        values: Every `stride`-th number that came.
        stride: Doubled, and every second value dropped, whenever there are `SAMPLE`.
        count: Numbers that came.
    """

    values: list[float] = field(default_factory=list)
    stride: int = 1
    count: int = 0

    def add(self, value: float) -> None:
        """Take one number."""
        if self.count % self.stride == 0:
            self.values.append(value)
        self.count += 1
        if len(self.values) == SAMPLE:
            del self.values[1::2]
            self.stride *= 2

    @property
    def median(self) -> float | None:
        """Median of the values, None before the first."""
        return statistics.median(self.values) if self.values else None


@dataclass
class Measurements:
    """What the demo node heard while the targets lasted.

    Attributes:
        real_time_factor: One a status message.
        step_time_median: The same [s].
        step_time_p99: The same [s].
        tracking: Distance of the simulated effector from the target of the same moment [m], after the first
            second.
        ik_solved: How often inverse kinematics had an answer after the first second.
        ik_states: How often inverse kinematics was in which state.
        body_states: Messages of node positions.
        packets: Packets that the driver sent since it started; None if it never said.
        packets_before: The same when the session began.
        port: What the driver calls its port.
        session_failure: Why the session broke off, empty if it did not.
    """

    real_time_factor: Sample = field(default_factory=Sample)
    step_time_median: Sample = field(default_factory=Sample)
    step_time_p99: Sample = field(default_factory=Sample)
    tracking: Spread = field(default_factory=Spread)
    ik_solved: int = 0
    ik_states: dict[str, int] = field(default_factory=dict)
    body_states: int = 0
    packets: int | None = None
    packets_before: int | None = None
    port: str = ""
    session_failure: str = ""


@dataclass(frozen=True)
class RecordingFacts:
    """What is on the disk.

    Attributes:
        path: The recording.
        size: In bytes.
        messages: What can be read, in all topics; None if the file could not be read.
        problem: Why that is not all; empty if it is.
    """

    path: Path
    size: int
    messages: int | None
    problem: str = ""


def summary_rows(measured: Measurements, recording: RecordingFacts | None) -> list[tuple[str, str]]:
    """Return the rows of the closing table: what, and the figure or why there is none."""
    tracking = measured.tracking
    return [
        ("real-time factor, median", _median(measured.real_time_factor.median, 1.0, "x", 2)),
        ("step time, median", _median(measured.step_time_median.median, 1e3, " ms", 2)),
        ("step time, p99 (median of seconds)", _median(measured.step_time_p99.median, 1e3, " ms", 2)),
        ("distance of the simulated effector from the target, rms", _tracking(tracking)),
        (
            "distance of the simulated effector from the target, largest",
            _millimetres(tracking.largest if tracking.count else None),
        ),
        ("IK states", ", ".join(f"{k.lower()} {n}" for k, n in measured.ik_states.items()) or NOT_MEASURED),
        ("packets sent", _packets(measured)),
        ("body states received", str(measured.body_states)),
        ("recording", _recording(recording)),
    ]


def conclusion(measured: Measurements) -> str:
    """Return what a chain that ran whole shows, and what to do where the effector lagged behind its target."""
    works = "the installation works: simulation, inverse kinematics and driver ran together"
    if measured.tracking.rms is None or measured.tracking.rms < ERROR_WANTED:
        return works
    factor = measured.real_time_factor.median
    if factor is None or factor > KEPT_UP:
        return f"{works}; the effector was farther from its target than usual, as on a busy machine"
    return (
        f"{works}, but the simulation ran at {factor:.2f} of real time and so lagged behind its target; "
        f"{WHAT_TO_DO}: {COARSER}"
    )


def problems(measured: Measurements, recording: RecordingFacts | None) -> list[str]:
    """Return what shows that the chain did not run, empty if it ran."""
    found = [measured.session_failure] if measured.session_failure else []
    if not found or measured.real_time_factor.count:  # else it broke off before anything was measured
        found += _missing(measured)
    if recording is not None and (recording.problem or not recording.messages):
        found.append(recording.problem or "nothing was recorded")
    return found


def _missing(measured: Measurements) -> list[str]:
    """Return which parts of the chain told nothing."""
    found = []
    if not measured.real_time_factor.count:
        found.append("no status of the simulation")
    if not measured.body_states:
        found.append("no body states")
    if not measured.tracking.count:
        found.append("the effector was not measured against the target")
    if not measured.ik_solved:
        found.append("inverse kinematics solved nothing")
    if not measured.packets or measured.packets == measured.packets_before:
        found.append("no packets to the servos")
    return found


NOT_MEASURED = "not measured"


def _median(value: float | None, scale: float, unit: str, digits: int) -> str:
    return NOT_MEASURED if value is None else f"{value * scale:.{digits}f}{unit}"


def _millimetres(value: float | None) -> str:
    return NOT_MEASURED if value is None else f"{value * 1e3:.3f} mm"


def _tracking(spread: Spread) -> str:
    if spread.rms is None:
        return NOT_MEASURED
    wanted = "usual" if spread.rms < ERROR_WANTED else "MORE THAN USUAL"
    return f"{_millimetres(spread.rms)} ({wanted}: below {ERROR_WANTED * 1e3:g} mm; {spread.count} samples after 1 s)"


def _packets(measured: Measurements) -> str:
    if measured.packets is None:
        return NOT_MEASURED
    return f"{measured.packets} on {measured.port or 'an unnamed port'}"


def _recording(recording: RecordingFacts | None) -> str:
    if recording is None:
        return "none (not recorded)"
    if recording.messages is None:
        return f"{recording.path} ({recording.problem})"
    part = ", not whole" if recording.problem else ""
    return f"{recording.path} ({recording.size / 1e6:.1f} MB, {recording.messages} messages{part})"
