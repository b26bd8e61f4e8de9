"""Random histories of operator, driver, line and board, in the board's virtual time; measured are the servos' pulses.

The driver is the real one without ROS, the board the real firmware, or what the workshop's boards do, under simavr. The
driver dies by being dropped: what lives on is the board and the files. Each history follows from its number.
"""

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from tests.decisions import SOURCE, said
from tests.firmware.session import PERIOD
from tests.firmware.simulated_board import Pulse, SimulatedBoard
from tripod_driver.calibration import Calibration
from tripod_driver.choose_session import choose_sessions, common_bounds
from tripod_driver.driver import Driver
from tripod_driver.framed import Decoder, SetPulses, encode
from tripod_driver.link import Link
from tripod_driver.memory import Memory
from tripod_driver.ports.port import Port, PortError
from tripod_driver.protocol import AngleMapping
from tripod_driver.safety import Safety, State
from tripod_graph.command import CommandLimits
from tripod_graph.mode import Mode
from tripod_graph.names import SERVOS

EVENTS = 8
BOOT_TIME = 0.6
"""A boot loader swallows what comes within so long after a reset, or less [s]."""

START_TIME = 0.065
"""An ATmega328P as the Arduino sets its fuses begins so long after a reset [s]."""

LIMITS = CommandLimits()
CALIBRATION = Calibration()
US_PER_RAD = (2400 - 544) / 3.141592653589793
ATTACHED = 1500.0
"""Pulse to which the workshop's firmware attaches its servos [us]."""

SLEW_STEP = LIMITS.angle_speed * PERIOD * US_PER_RAD
"""What the slew rate allows from pulse to pulse [us]."""

QUANTUM = {"framed": 0.5, "legacy": 1856 / 180 + 1}
"""Coarseness of pulses [us]: a tick of the timer; a whole degree, cut to whole microseconds."""

JITTER = (1.0, 1.0, 6.0)
"""A pulse of the pins D9, D10, D11 may be off by so much [us], see tests/firmware/session.py."""


@dataclass
class Result:
    """What the servos saw in one history.

    Attributes:
        events: What happened, with the time [s].
        steps: Largest step from pulse to pulse of each servo beyond JITTER [us].
        at: When the largest of them came [s].
        hidden: Largest step that follows from what no driver can know of [us], see `World.hide`, or from another
            program whose packets were the last ones before a loss of power, or are the first ones after it.
        pulses: How many pulses there were.
        way: How far the servos moved, all steps together [us].
    """

    events: list[str] = field(default_factory=list)
    steps: list[float] = field(default_factory=lambda: [0.0] * 3)
    at: float = 0.0
    hidden: float = 0.0
    pulses: int = 0
    way: float = 0.0

    @property
    def step(self) -> float:
        """Largest step [us]."""
        return max(self.steps)


class Line(Port):
    """A USB port and its cable, seen from one driver."""

    boot_time = BOOT_TIME

    def __init__(self, world: "World") -> None:
        self._world, self._generation = world, -1
        self.resets = world.opening_resets

    @property
    def name(self) -> str:
        return "board"

    @property
    def identity(self) -> str:
        return "board" if self._world.recognised else ""

    def open(self) -> None:
        if not self._world.plugged:
            raise PortError("the board is unplugged")
        self._generation = self._world.generation
        if self._world.opening_resets:
            self._world.reset(told=True)

    def write(self, data: bytes) -> None:
        self._check()
        self._world.say(data)

    def read(self) -> bytes:
        self._check()
        return self._world.board.read(self._world.board.in_waiting)

    def close(self) -> None:
        self._generation = -1

    def _check(self) -> None:
        if not self._world.plugged or self._generation != self._world.generation:
            raise PortError("the board was lost")


class World:
    """A board, its line, an operator, and a driver, which may be dead.

    Attributes:
        board: The board.
        plugged: Whether the cable is in.
        generation: Counts the losses of the port: what was opened before is gone.
        opening_resets: Whether opening the port resets the board.
        recognised: Whether the driver can tell the board from others, and so remembers it.
    """

    def __init__(
        self,
        board: SimulatedBoard,
        protocol: str,
        folder: Path,
        seed: int,
        *,
        hidden: bool,
        resets: bool = True,
    ) -> None:
        """`hidden`, `resets`: in `legacy`, play also what no driver can know of; opening the port resets the board."""
        self.board, self.protocol, self.folder, self.rng = board, protocol, folder, random.Random(seed)
        self.plugged, self.generation, self.recognised = True, 0, True
        self.opening_resets = resets if protocol == "legacy" else self.rng.random() < 0.5
        self.result = Result()
        self._workshop = protocol == "legacy"
        self._plays_hidden = hidden or protocol == "framed"
        self._boots_until = 0.0
        self._wall = 1e9
        self._driver: Driver | None = None
        self._pulses: list[Pulse] = []
        self._starts: list[float] = [board.now]
        self._hidden_since: float | None = None
        self._hidden: list[tuple[float, float]] = []
        self._foreign, self._powerless_at = 0, board.now
        self._foreign_moves = self._commanded = (
            False  # whose the last packet was; any since the board has power
        )
        self._forgotten: list[float] = []

    # what the board hears ---------------------------------------------------------------------------------------

    def say(self, data: bytes) -> None:
        """The driver writes."""
        if self.board.now < self._boots_until:
            return
        self.board.write(data)
        if any(isinstance(frame.message, SetPulses) for frame in Decoder().feed(data)):
            self._foreign_moves, self._commanded = False, True
        if self._hidden_since is not None:
            self._hidden.append((self._hidden_since, self.board.now + 2 * PERIOD + 0.005))
            self._hidden_since = None

    def hide(self) -> None:
        """Something happens that a driver cannot know of where nothing is answered: from now to its next packet."""
        if self._workshop and self._hidden_since is None:
            self._hidden_since = self.board.now

    def reset(self, *, told: bool, power: bool = False) -> None:
        """Reset the board between two pulses; `told`: the port was opened or lost at the same time.

        The driver knows of that where the board tells it, or where each opening of the port resets the board.
        """
        end = self.board.now + 1.25 * PERIOD
        while self.board.now < end and not self._between_pulses():
            self.board.run(0.001)
            self._collect()
        if power:
            self.board.power_cycle()
            self._powerless_at, self._commanded = self.board.now, False
            if self._foreign_moves:
                self._forgotten.append(self.board.now)
            self._foreign_moves = False
        else:
            self.board.reset()
        self._boots_until = self.board.now + self.rng.uniform(START_TIME, 0.9 * BOOT_TIME)
        self._starts.append(self.board.now)
        if told and (self.opening_resets or not self._workshop):
            if self._hidden_since is not None:
                self._hidden.append((self._hidden_since, self.board.now))
            self._hidden_since = None
        else:
            self.hide()

    def _between_pulses(self) -> bool:
        last = self._pulses[-1] if self._pulses else None
        return last is not None and last.servo == 2 and self.board.now - last.end < 0.002

    # the driver -------------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Start a driver, as a new process would."""
        sessions = choose_sessions(self.protocol, AngleMapping.ROUNDED, CALIBRATION)
        safety = Safety(LIMITS, *common_bounds(sessions))
        link = Link(Line(self), *sessions, retry_min=0.5, retry_max=5.0)
        self._driver = Driver(link, safety, memory=Memory(self.folder))
        self._driver.connect()
        safety.activate(self.board.now)

    def kill(self) -> None:
        """`kill -9`: nothing is said any more; what is not yet on the line may be lost."""
        if self._driver is not None:
            self._driver.memory.close()  # as the kernel closes what a process had open
            self._driver = None
        if self.rng.random() < 0.5:
            self.board.vanish()

    def stop(self) -> None:
        """Ctrl-C: park, within 3 s, and close the port."""
        driver = self._driver
        if driver is not None:
            end = self.board.now + 3.0
            if driver.safety.can_move:
                driver.safety.park(self.board.now)
                while driver.safety.can_move and not driver.at_rest and self.board.now < end:
                    self._pass(0.010)
            driver.disconnect(self.board.now)
            driver.memory.close()
        self._driver = None

    def run(self, duration: float) -> None:
        """Let time pass, with a driver that is called now sooner, now later."""
        end = self.board.now + duration
        while self.board.now < end:
            self._pass(self.rng.uniform(0.002, 0.016))

    def _pass(self, duration: float) -> None:
        self.board.run(duration)
        if self._driver is not None:
            self._driver.tick(self.board.now)
        self._collect()

    def _collect(self) -> None:
        self._pulses += self.board.pulses()

    # the operator -----------------------------------------------------------------------------------------------

    def mode(self, mode: Mode) -> None:
        if self._driver is not None:
            wall = self._wall + self.board.now
            self._driver.safety.control_mode(said(mode, wall), wall, self.board.now)

    def send(self, angles: list[float], time: float) -> None:
        if self._driver is not None:
            self._driver.safety.trajectory(SERVOS, [time], [angles], self.board.now, source=SOURCE)

    def angles(self) -> list[float]:
        return [self.rng.uniform(LIMITS.angle_min, 0.3) for _ in SERVOS]

    # what happens -----------------------------------------------------------------------------------------------

    def play(self) -> Result:
        """Play the history and return what the servos saw."""
        self.start()
        self.run(self.rng.uniform(0.5, 2.5))
        self.command()
        for _ in range(EVENTS):
            event = self.rng.choice(self.events())
            self.result.events.append(f"{self.board.now:.2f} {event.__name__}")
            event()
            self.run(self.rng.choice((0.05, 0.3, 1.0, 2.0)) * self.rng.uniform(0.5, 1.5))
            if self._driver is not None and self._driver.safety.state is State.FAULT:
                self.kill()  # as the message says
            if self._driver is None:
                self.start()
                self.run(self.rng.uniform(0.0, 2.0))
                self.command()
        self.command()
        self.run(2.0)
        return self.judged()

    def events(self) -> list[Callable[[], None]]:
        """Return what may happen."""
        told = [self.switch, self.command, self.stream, self.die, self.restart, self.unplug]
        told += [self.stall, self.step_clock, self.glitch]
        hidden = [self.press_reset, self.brown_out, self.second_writer]
        return [*told, self.command, *(hidden if self._plays_hidden else ())]

    def switch(self) -> None:
        self.mode(self.rng.choice(list(Mode)))

    def command(self) -> None:
        self.mode(Mode.TELEOP)
        self.send(self.angles(), self.rng.choice((0.0, 0.2, 1.0, 3.0)))
        self.run(self.rng.uniform(0.1, 1.2))

    def stream(self) -> None:
        self.mode(Mode.TELEOP)
        for _ in range(self.rng.randrange(2, 8)):
            goal = self.angles()
            for _ in range(self.rng.randrange(2, 12)):
                self.send(goal, 0.1)
                self.run(0.02)

    def die(self) -> None:
        """`kill -9`; the next driver starts soon or late."""
        self.kill()
        self.run(self.rng.choice((0.01, 0.3, 1.5, 3.0)))

    def restart(self) -> None:
        self.stop()
        self.run(self.rng.uniform(0.0, 2.0))

    def unplug(self) -> None:
        """The cable, with or without the power of the board; the driver may die meanwhile."""
        power = self.rng.random() < 0.6
        self.plugged, self.generation = False, self.generation + 1
        self.board.vanish()
        if power:
            self.reset(told=True, power=True)
        self.run(self.rng.choice((0.05, 0.6, 2.0)))
        if self.rng.random() < 0.3:
            self.kill()
        self.plugged = True

    def glitch(self) -> None:
        """The USB bridge and the board are reset together: the host knows of it."""
        self.generation += 1
        self.reset(told=True, power=self.rng.random() < 0.5)

    def press_reset(self) -> None:
        """The button of the board: the port stays open."""
        self.reset(told=False)

    def brown_out(self) -> None:
        """The supply of the board fails for a moment: the port stays open, the memory of the board is lost."""
        self.reset(told=False, power=True)

    def second_writer(self) -> None:
        """Another program writes to the port."""
        if not self.plugged:
            return
        self.hide()
        for _ in range(self.rng.randrange(1, 6)):
            goal = [self.rng.randrange(60, 181) for _ in SERVOS]
            if self.protocol == "framed":
                a, b, c = (10 * (544 + degrees * 1856 // 180) for degrees in goal)
                self._foreign = (self._foreign + 1) % 256
                self.board.write(encode(SetPulses((a, b, c)), self._foreign))
                if not self._commanded:  # the board begins where this packet says
                    self._forgotten.append(self._powerless_at)
                self._foreign_moves = self._commanded = True
            else:
                self.board.write(bytes([255, *goal]))
            self.hide()
            self.run(self.rng.uniform(0.005, 0.1))

    def stall(self) -> None:
        """The computer does nothing, not even answer."""
        end = self.board.now + self.rng.choice((0.03, 0.1, 0.4, 0.8, 2.5))
        while self.board.now < end:
            self.board.run(0.02)
            self._collect()

    def step_clock(self) -> None:
        self._wall += self.rng.choice((-1, 1)) * 10 ** self.rng.uniform(-1, 6)
        self.switch()

    # the servos -------------------------------------------------------------------------------------------------

    def judged(self) -> Result:
        """Return what the servos saw."""
        if self._hidden_since is not None:
            self._hidden.append((self._hidden_since, self.board.now))
        result = self.result
        for servo in range(3):
            last: Pulse | None = None
            for pulse in (p for p in self._pulses if p.servo == servo):
                result.pulses += 1
                if last is not None:
                    self._judge_step(servo, last, pulse)
                last = pulse
        return result

    def _judge_step(self, servo: int, last: Pulse, pulse: Pulse) -> None:
        result, raw = self.result, abs(pulse.width - last.width)
        result.way += raw
        if self._workshop and any(last.start < start < pulse.start for start in self._starts):
            assert abs(pulse.width - ATTACHED) < 6, f"{pulse} is not where the workshop's firmware starts"
            return  # the firmware's own doing
        step = max(0.0, raw - JITTER[servo])
        forgotten = any(last.start < at < pulse.start for at in self._forgotten)
        if forgotten or any(begin <= pulse.start <= end for begin, end in self._hidden):
            result.hidden = max(result.hidden, step)
        elif step > result.steps[servo]:
            result.steps[servo] = step
            if step == result.step:
                result.at = pulse.start


def play(
    board: SimulatedBoard, protocol: str, folder: Path, seed: int, *, hidden: bool = True, resets: bool = True
) -> Result:
    """Play history number `seed` on a board just switched on; the files of its drivers are in `folder`. See `World`."""
    return World(board, protocol, folder, seed, hidden=hidden, resets=resets).play()


def allowed(protocol: str) -> float:
    """Return the largest step that may be [us]."""
    return SLEW_STEP + QUANTUM[protocol]
