"""`tripod calibrate`: finds the calibration of the servos by hand, in the terminal."""

import math
import os
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final, Protocol

import numpy as np

from tripod_driver.calibration import Calibration, CalibrationError, ServoCalibration
from tripod_driver.calibration_file import calibration_text, read_calibration
from tripod_driver.calibrator import SPEED, Calibrator, any_pulse, help_text, shaft_calibration
from tripod_driver.choose_session import choose_sessions, common_bounds
from tripod_driver.driver import Driver
from tripod_driver.link import Link
from tripod_driver.memory import Memory, state_folder
from tripod_driver.ports.choose import choose_port
from tripod_driver.ports.port import Port
from tripod_driver.protocol import SERVO_COUNT, AngleMapping
from tripod_driver.safety import Safety, State
from tripod_driver.session import Session
from tripod_graph.command import CommandLimits
from tripod_graph.mode import Decision, Mode
from tripod_graph.names import servo_names
from tripod_host.stop import taken
from tripod_host.writing import check_place, replaced_text
from tripod_teleop.escape import KeyParser
from tripod_teleop.terminal import Terminal, TerminalError

TICK: Final = 0.01
"""Time between two looks for keys [s]."""

PATIENCE: Final = 300.0
"""Time without a key after which a robot that waits for one parks [s]: servos that hold for hours burn."""

DECISION: Final = Decision(Mode.TELEOP, "calibrate")
"""Whoever calibrates is in charge, and says so at each step."""

BAD_ARGUMENTS: Final = 2
FAILED: Final = 1
INTERRUPTED: Final = 130


class Console(Protocol):
    """Keys in, lines out: `tripod_teleop.terminal.Terminal`, or a test."""

    def read(self) -> bytes:
        """Return the keys pressed since the last call."""

    def show(self, line: str) -> None:
        """Draw one line in place of the last."""

    def print(self, text: str) -> None:
        """Write lines that stay."""


class Nobody:
    """A console in the place of a terminal that is gone."""

    def read(self) -> bytes:
        """Return no key."""
        return b""

    def show(self, line: str) -> None:
        """Draw nothing."""

    def print(self, text: str) -> None:
        """Write nothing."""


class ServoSession(Protocol):
    """A conversation with servos and somebody at a terminal, from the opening of the port to its end.

    Attributes:
        code: Exit code, once it has ended.
        console: The terminal.
    """

    code: int | None
    console: Console

    def begin(self, now: float) -> None:
        """Open the port, and say what the keys do."""

    def step(self, now: float) -> None:
        """Do what the keys and the clock ask for at `now` [s]."""

    def stop(self, asked: int) -> bool:
        """Return whether to end at once, having been asked to stop so often."""

    def park(self) -> None:
        """Leave; `step` goes on until the servos are parked."""

    def close(self, now: float) -> None:
        """Send nothing more and close the port."""


class CalibrateSession:
    """One calibration from the opening of the port to the file.

    Nothing moves before the key g. In the end, and after `PATIENCE` without a key, all shafts go to where the piece is
    flat.

    Attributes:
        code: Exit code, once it has ended.
        console: The terminal.
        calibrator: What the keys have found.
    """

    def __init__(
        self, port: Port, sessions: Sequence[Session], known: Calibration, file: Path, console: Console
    ) -> None:
        """`sessions`: see `calibrating_sessions`; `known`: where to begin; `file`: to write."""
        lower, upper = common_bounds(sessions)
        count = len(known.servos)
        self._names, self._pulses, self._help = servo_names(count), any_pulse(count), help_text(count)
        self.calibrator = Calibrator(known, self._pulses.pulses(lower), self._pulses.pulses(upper))
        self.code: int | None = None
        begin = self._pulses.angles(self.calibrator.pulses)
        limits = CommandLimits(
            angle_min=0.0,
            angle_max=math.pi,
            angle_speed=2 * SPEED,
            park_after=3600.0,
            park=(*begin, 0.0),
            count=count,
        )
        self._safety = Safety(limits, lower, upper, start=begin)
        self._link = Link(port, *sessions, retry_min=0.5, retry_max=2.0)
        self._driver = Driver(self._link, self._safety, memory=Memory(state_folder(os.environ)))
        self._file, self._parser = file, KeyParser()
        self.console = console
        self._sure = self._left = False
        self._heard = float("inf")

    def begin(self, now: float) -> None:
        """Open the port, and say what the keys do."""
        self.console.print(
            f"Keys:\n{self._help}\ng begins: all servos then go slowly to where the piece should be flat."
        )
        self._driver.connect()

    def step(self, now: float) -> None:
        """Do what the keys and the clock ask for at `now` [s]; `code` is set when it is over."""
        if self._safety.listens or self._safety.state is State.READY:
            self.calibrator.board(self._link.session.pulse_range)
        for key in self._parser.feed(self.console.read()):
            self._key(key, now)
            self._heard = now
        if now - self._heard > PATIENCE and self._safety.can_move:
            self._heard = float("inf")
            self.console.print(
                f"no key for {PATIENCE / 60:.0f} minutes: the servos park; what was found is kept"
            )
            self.calibrator.park()
        angles = self._pulses.angles(self.calibrator.advance(now))
        self._safety.control_mode(DECISION, 0.0, now)
        if self._safety.listens:
            self._safety.trajectory(self._names, [0.0], [angles], now, source=DECISION.source)
        self._driver.tick(now)
        there = np.allclose(self._safety.place, angles, rtol=0, atol=1e-9)
        self.console.show(self._line())
        if self._safety.state is State.FAULT:
            self._end(FAILED, self._safety.message)
        elif self._left and not self._safety.can_move:
            self._end(0, f"the servos stay where they are: {self._safety.message}")
        elif self._left and self.calibrator.parked and there and self._driver.at_rest:
            self._end(0, "the servos are parked")

    def stop(self, asked: int) -> bool:
        """Return whether to end at once, having been asked to stop so often; the first time it parks."""
        if asked and not self._left:
            self.park()
        return asked > 1

    def park(self) -> None:
        """Leave; `step` goes on until the servos are parked."""
        if self._safety.can_move:
            self._left = True
            self.calibrator.park()
        else:
            self._end(0, "nothing was moved")

    def close(self, now: float) -> None:
        """Send nothing more and close the port."""
        self._driver.disconnect(now)

    def _key(self, key: str, now: float) -> None:
        if key == "q":
            if self.calibrator.changed and not self._sure:
                self._sure = True
                self.calibrator.notice = "not written: w writes, q again leaves"
                return
            self.park()
            return
        self._sure = self._left = False
        if key == "g":
            if self._safety.state is State.READY:
                self._safety.activate(now)
        elif key == "w":
            self._write()
        elif key == "?":
            self.console.print(f"Keys:\n{self._help}")
        elif not self._safety.can_move and key in ("up", "down", "+", "-", "p"):
            self.calibrator.notice = "nothing moves yet: g begins"
        elif not self.calibrator.press(key, now):
            self.calibrator.notice = f"{key} does nothing here; ? shows the keys"

    def _write(self) -> None:
        try:
            with replaced_text(self._file) as file:
                file.write(calibration_text(self.calibrator.calibration()))
        except OSError as error:
            self.calibrator.notice = f"not written: {self._file}: {error.strerror}"
            return
        self.calibrator.saved()
        servos = zip(self._names, self.calibrator.calibration().servos, strict=True)
        untouched = [name for name, servo in servos if servo == ServoCalibration()]
        missing = f"; still as without a calibration: {', '.join(untouched)}" if untouched else ""
        self.console.print(
            f"written: {self._file}{missing}; use it: tripod driver --set calibration={self._file}"
        )

    def _end(self, code: int, said: str) -> None:
        self.console.print(said)
        self.code = code

    def _line(self) -> str:
        """Return the line to be shown: the only place with degrees."""
        found, i = self.calibrator, self.calibrator.chosen
        draft, shaft = found.drafts[i], found.shafts[i]
        said = [text] if (text := found.notice or self._safety.message) else []
        begin = " | ".join([self._safety.state.name.lower(), *said, f"{self._names[i]}: "])
        if found.finds_range:
            low, high = draft.pulse_range
            return f"{begin}{found.pulses[i]:.0f} us; 0 deg at {low:.0f} us, 180 deg at {high:.0f} us"
        low, high = sorted(math.degrees(draft.joint(end)) for end in draft.ends)
        return (
            f"{begin}shaft {math.degrees(shaft):.1f}, joint {math.degrees(draft.joint(shaft)):.1f}, "
            f"safe {low:.1f} to {high:.1f} deg, {found.pulses[i]:.0f} us"
        )


def calibrating_sessions(protocol: str, known: Calibration) -> list[Session]:
    """Return the conversations of `protocol` that carry any pulse, see `any_pulse`.

    The board must make those of all shaft angles of `known`. Raises ValueError.
    """
    pulses = any_pulse(len(known.servos))
    return choose_sessions(protocol, AngleMapping.ROUNDED, pulses, needed=shaft_calibration(known))


def servo_calibration(file: Path) -> Calibration:
    """Return the calibration in a file, of a robot of servos. Raises CalibrationError."""
    known = read_calibration(file)
    if known.channels:
        raise CalibrationError(
            f"{file} has winches and pressures ({', '.join(known.channels)}), which this command cannot measure; "
            "measure drum and sensor, and write their fields into the file by hand"
        )
    return known


def known_calibration(file: Path, servos: int | None) -> Calibration:
    """Return the calibration to begin with: that of `file`, else the workshop's of `servos` servos, by default three.

    Raises CalibrationError: the file, or it is of another number of servos.
    """
    if not os.path.lexists(file):
        return Calibration((ServoCalibration(),) * (servos or SERVO_COUNT))
    known = servo_calibration(file)
    if servos not in (None, len(known.servos)):
        raise CalibrationError(
            f"{file} is the calibration of {len(known.servos)} servos, but --servos is {servos}; give another file"
        )
    return known


def calibrate_command(
    port: str, file: Path, *, protocol: str, baud: int, boot_time: float, servos: int | None = None
) -> int:
    """Calibrate in this terminal; return the exit code. `servos`: see `known_calibration`."""
    try:
        known = known_calibration(file, servos)
        check_place(file)
        sessions = calibrating_sessions(protocol, known)
        place = choose_port(port, baud=baud or sessions[0].baud, boot_time=boot_time, write_timeout=0.05)
        terminal = Terminal(program="it")
    except (ValueError, TerminalError) as error:
        print(f"tripod calibrate: {error}", file=sys.stderr)
        return BAD_ARGUMENTS
    except OSError as error:
        print(f"tripod calibrate: {file} cannot be written: {error.strerror}", file=sys.stderr)
        return BAD_ARGUMENTS
    with terminal, taken() as asked:
        terminal.enter()
        session = CalibrateSession(place, sessions, known, file, terminal)
        code = calibrate(session, stopped=lambda: asked.count)
    return INTERRUPTED if asked.count else code


def calibrate(
    session: ServoSession,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
    stopped: Callable[[], int] = lambda: 0,
) -> int:
    """Run `session` until it is over or fails; the port is closed in any case. Return the exit code.

    `stopped`: how often one has asked it to stop. Where the terminal is gone, it parks.
    """
    session.begin(clock())
    gone = False
    try:
        while session.code is None and not session.stop(stopped()):
            try:
                session.step(clock())
            except TerminalError as error:
                gone, session.console = True, Nobody()
                session.park()
                with suppress(OSError):  # standard error may be the same terminal
                    print(f"tripod calibrate: {error}", file=sys.stderr, flush=True)
            sleep(TICK)
    finally:
        session.close(clock())
    return session.code or (FAILED if gone else 0)
