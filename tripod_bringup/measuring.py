"""`tripod calibrate --identify`: plays poses on the robot and measures each, by hand, by its IMU or by a camera."""

import math
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np

from tripod_bringup.calibrate_command import DECISION, FAILED, PATIENCE, Console
from tripod_driver.calibration import Calibration
from tripod_driver.choose_session import common_bounds
from tripod_driver.driver import Driver
from tripod_driver.link import Link
from tripod_driver.memory import Memory, state_folder
from tripod_driver.ports.port import Port
from tripod_driver.pose_player import SPEED, Phase, PosePlayer
from tripod_driver.safety import Safety, State
from tripod_driver.session import Session
from tripod_graph.command import CommandLimits
from tripod_graph.names import servo_names
from tripod_identify.errors import DataError
from tripod_teleop.escape import KeyParser

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tripod_identify.marker import MarkerFinder

    FloatArray = NDArray[np.float64]

KEYS: Final = """\
  g            begin; go on
  space        stop: the servos keep their place
  q            leave: the servos park; what was measured is kept"""

UNANSWERED: Final = 5.0
"""Time after which a sensor that says nothing is given up [s]."""

HIGHEST: Final = 1000.0
"""Heights beyond it are mistyped [mm]."""

STALE: Final = 4
"""Images that a camera may have kept from before."""


class Sensor(Protocol):
    """What measures a pose.

    Attributes:
        help: What users should do, one line.
    """

    help: str

    def begin(self, now: float) -> None:
        """The robot stands in a new pose. Raises DataError."""

    def key(self, key: str) -> bool:
        """Take a key; return whether it means something here."""

    def poll(self, now: float, session: Session) -> tuple[float, ...] | None:
        """Return what was measured, in mm or degrees, NaN where nothing was; None: not yet. Raises DataError."""

    def line(self) -> str:
        """Return what to show meanwhile."""


class HeightSensor:
    """Somebody with a ruler."""

    help = "Type the height of the disc's centre [mm], above the table or anything that stays; Enter; empty: left out."

    def __init__(self) -> None:
        self._text, self._entered, self._refused = "", False, ""

    def begin(self, now: float) -> None:
        """Ask for a new height."""
        self._text, self._entered, self._refused = "", False, ""

    def key(self, key: str) -> bool:
        """Take a character of a number."""
        if key == "enter":
            self._entered = True
        elif key == "backspace":
            self._text = self._text[:-1]
        elif key in "0123456789.,-" and len(self._text) < 10:
            self._text += key.replace(",", ".")
        else:
            return False
        return True

    def poll(self, now: float, session: Session) -> tuple[float, ...] | None:
        """Return the height once Enter was pressed behind a number that can be one."""
        if not self._entered:
            return None
        text, self._text, self._entered = self._text, "", False
        if not text:
            return (math.nan,)
        with suppress(ValueError):
            if abs(height := float(text)) <= HIGHEST:
                return (height,)
        self._refused = f"{text} is not a height; allowed: up to {HIGHEST:g}; "
        return None

    def line(self) -> str:
        """What was typed so far."""
        return f"{self._refused}height [mm], Enter: {self._text}"


class ImuSensor:
    """The IMU on the disc, by way of the board."""

    help = "The IMU on the disc is read."
    wanted: Final = 20
    """Readings of which the median is taken."""

    def __init__(self) -> None:
        self._readings: list[FloatArray] = []
        self._begun = 0.0

    def begin(self, now: float) -> None:
        """Take readings from now on."""
        self._readings, self._begun = [], now

    def key(self, key: str) -> bool:
        """None."""
        return False

    def poll(self, now: float, session: Session) -> tuple[float, ...] | None:
        """Return the median of some readings. Raises DataError where none come."""
        from scipy.spatial.transform import Rotation  # noqa: PLC0415 - slow to import

        for reading in session.readings:
            if reading.time > self._begun:
                self._readings.append(Rotation.from_quat(reading.quaternion).as_rotvec(degrees=True))
        session.readings.clear()
        if len(self._readings) >= self.wanted:
            rx, ry, _ = np.median(self._readings, axis=0)
            return float(rx), float(ry)
        if now - self._begun > UNANSWERED:
            raise DataError(
                f"the board sent {len(self._readings)} IMU readings within {UNANSWERED:g} s; is an IMU "
                "connected? --identify heights needs none"
            )
        return None

    def line(self) -> str:
        """How many readings there are."""
        return f"{len(self._readings)} of {self.wanted} readings"


class MarkerSensor:
    """A camera that sees a marker on the disc."""

    help = "The camera must stand still from now on and see the marker on the disc in all poses."
    wanted: Final = 10
    """Images in which the marker must be seen; the median is taken."""

    def __init__(self, finder: "MarkerFinder", image: "Callable[[], NDArray[np.uint8]]") -> None:
        """`image`: takes one; raises DataError."""
        self._finder, self._image = finder, image
        self._seen: list[FloatArray] = []
        self._begun, self._looked, self._ever = 0.0, 0, False

    def begin(self, now: float) -> None:
        """Take images from now on; those that the camera has kept are let go."""
        for _ in range(STALE):
            self._image()
        self._seen, self._begun, self._looked = [], now, 0

    def key(self, key: str) -> bool:
        """None."""
        return False

    def poll(self, now: float, session: Session) -> tuple[float, ...] | None:
        """Return the median place; NaN where the marker is hidden here. Raises DataError where it never was seen."""
        self._looked += 1
        found = self._finder.find(self._image())
        if found is not None:
            self._ever = True
            self._seen.append(found)
        if len(self._seen) >= self.wanted:
            x, y, z = 1e3 * np.median(self._seen, axis=0)
            return float(x), float(y), float(z)
        if now - self._begun <= UNANSWERED:
            return None
        if self._ever:
            return (math.nan,) * 3
        raise DataError(
            f"the camera sees no marker 4x4_50 number {self._finder.number} in {self._looked} images; is it whole in "
            "the picture, flat, bright, with white around it?"
        )

    def line(self) -> str:
        """How often it was seen."""
        return f"marker seen in {len(self._seen)} of {self._looked} images"


def reach(sessions: Sequence[Session], known: Calibration) -> "tuple[FloatArray, FloatArray]":
    """Return the smallest and largest angles [rad] that are safe and that packets can carry, shape (s,) each."""
    low, high = common_bounds(sessions)
    return np.maximum(known.lower, low), np.minimum(known.upper, high)


class MeasureSession:
    """A tour of poses from the opening of the port to the last measured one. Nothing moves before the key g.

    Attributes:
        code: Exit code, once it has ended: 0, also when the user has left.
        console: The terminal.
        left: Whether the user has left before the last pose.
    """

    def __init__(
        self,
        port: Port,
        sessions: Sequence[Session],
        known: Calibration,
        poses: "FloatArray",
        sensor: Sensor,
        keep: Callable[[int, tuple[float, ...]], None],
        console: Console,
    ) -> None:
        """`poses` [rad], shape (k, s); `keep` gets each one's number and what was measured; it may raise OSError."""
        lower, upper = reach(sessions, known)
        self._flat = np.clip(0.0, lower, upper)
        limits = CommandLimits(
            angle_min=float(lower.min()), angle_max=float(upper.max()), angle_speed=2 * SPEED, park_after=3600.0,
            park=(*self._flat.tolist(), 0.0), count=len(known.servos),
        )  # fmt: skip
        self._safety = Safety(limits, lower.tolist(), upper.tolist())
        self._link = Link(port, *sessions, retry_min=0.5, retry_max=2.0)
        self._driver = Driver(self._link, self._safety, memory=Memory(state_folder(os.environ)))
        self._poses, self._sensor, self._keep = poses, sensor, keep
        self.console, self._parser = console, KeyParser()
        self._player: PosePlayer | None = None
        self._asks = False
        self._notice = ""
        self._bounds, self._outcome = (lower, upper), 0
        self._heard = float("inf")
        self.code: int | None = None
        self.left = False

    def begin(self, now: float) -> None:
        """Open the port, and say what the keys do."""
        self.console.print(
            f"{self._sensor.help}\nKeys:\n{KEYS}\ng begins: the servos then go slowly to {len(self._poses)} poses."
        )
        self._driver.connect()

    def step(self, now: float) -> None:
        """Do what the keys, the sensor and the clock ask for at `now` [s]; `code` is set when it is over."""
        for key in self._parser.feed(self.console.read()):
            self._key(key, now)
            self._heard = now
        player = self._player
        if now - self._heard > PATIENCE and player and (player.held or self._asks) and not self.left:
            self.console.print(f"no key for {PATIENCE / 60:.0f} minutes: the servos park")
            self.park()
        self._safety.control_mode(DECISION, 0.0, now)
        if player and self._safety.listens:
            arrived = np.allclose(self._safety.place, player.angles, rtol=0, atol=1e-9)
            goal = player.advance(now, arrived=arrived)
            names = servo_names(len(goal))
            self._safety.trajectory(names, [0.0], [goal.tolist()], now, source=DECISION.source)
            if player.phase is Phase.STANDING and not player.held:
                self._measure(player, now)
            else:
                self._asks = False
        self._driver.tick(now)
        self.console.show(self._line())
        if self._safety.state is State.FAULT:
            self._end(FAILED, self._safety.message)
        elif player and player.phase is Phase.PARKED and self._driver.at_rest:
            self._end(self._outcome, "the servos are parked")

    def stop(self, asked: int) -> bool:
        """Return whether to end at once, having been asked to stop so often; the first time it parks."""
        if asked and not self.left:
            self.park()
        return asked > 1

    def park(self) -> None:
        """Leave the tour; `step` goes on until the servos are parked."""
        self.left = True
        if self._player is None or not self._safety.can_move:
            said = (
                "nothing was moved"
                if self._player is None
                else f"the servos stay where they are: {self._safety.message}"
            )
            self._end(self._outcome, said)
            return
        self._player.park()

    def close(self, now: float) -> None:
        """Send nothing more and close the port."""
        self._driver.disconnect(now)

    def _measure(self, player: PosePlayer, now: float) -> None:
        try:
            if not self._asks:
                self._asks = True
                self._sensor.begin(now)
            found = self._sensor.poll(now, self._link.session)
            if found is None:
                return
            self._keep(player.number, found)
        except (DataError, OSError) as error:
            why = f"{error.filename}: {error.strerror}" if isinstance(error, OSError) else error
            self.console.print(f"tripod calibrate: {why}")
            self._outcome = FAILED
            self.park()
            return
        self._asks, self._heard = False, now
        if not all(map(math.isfinite, found)):
            self.console.print(f"pose {player.number + 1}: left out")
        player.next()

    def _key(self, key: str, now: float) -> None:
        self._notice = ""
        if key == "q":
            self.park()
        elif key == "space":
            if self._player:
                self._player.hold()
        elif key == "g":
            if self._player:
                self._player.go_on()
            elif self._safety.state is State.READY:
                self._safety.activate(now)
                start = np.clip(self._safety.place, *self._bounds)
                self._player = PosePlayer(self._poses, start.tolist(), self._flat.tolist())
            else:
                self._notice = "not yet: the board is not ready"
        elif key == "?":
            self.console.print(f"{self._sensor.help}\nKeys:\n{KEYS}")
        elif not (self._asks and self._sensor.key(key)):
            self._notice = f"{key} does nothing here; ? shows the keys"

    def _end(self, code: int, said: str) -> None:
        self.console.print(said)
        self.code = code

    def _line(self) -> str:
        said = self._notice or self._safety.message
        player = self._player
        if player is None:
            return f"{self._safety.state.name.lower()}  {said}"
        what = "stopped, g goes on" if player.held else player.phase.value
        if self._asks:
            what = self._sensor.line()
        number = min(player.number + 1, len(self._poses))
        return f"pose {number} of {len(self._poses)}: {what}  {said}"
