"""The whole driver without ROS on a bench: a board in memory, and a clock."""

from collections.abc import Callable
from dataclasses import replace

from tests.decisions import SOURCE, said
from tests.messages import names
from tripod_driver.calibration import Calibration
from tripod_driver.choose_session import choose_sessions, common_bounds
from tripod_driver.driver import Driver
from tripod_driver.framed import VERSION
from tripod_driver.framed_messages import BoardState, Flags, HelloReply, ResetCause
from tripod_driver.link import Link
from tripod_driver.memory import Memory
from tripod_driver.ports.mock import MockPort
from tripod_driver.ports.mock_board import MockBoard
from tripod_driver.protocol import AngleMapping
from tripod_driver.safety import Safety, State
from tripod_graph.command import CommandLimits
from tripod_graph.mode import Mode
from tripod_graph.names import SERVOS

TICK = 0.005
LIMITS = CommandLimits(angle_speed=2.0, park_after=1.0)
CALIBRATION = Calibration()
START = (-0.5, -0.5, -0.5)


def hello_reply(**changed: object) -> HelloReply:
    """What a fresh board of the default build answers to a hello, with fields `changed`."""
    limits = (5440, 24000, 500, 475)
    told = (ResetCause.POWER_ON, BoardState.IDLE, Flags(0), (0, 0, 0))
    return replace(HelloReply((2, 2), VERSION, 3, *limits, *told), **changed)


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


class Bench:
    """The whole driver without ROS, a board in memory, and a clock."""

    def __init__(
        self,
        board: object | None = None,
        *,
        protocol: str = "framed",
        calibration: Calibration = CALIBRATION,
        boot_time: float = 0.0,
        known: bool = True,
        resets: bool = True,
        memory: Memory | None = None,
    ) -> None:
        """`known`: the driver remembers that the servos are at START. `resets`: opening the port resets the board."""
        self.clock = Clock()
        self.board = MockBoard(self.clock) if board is None else board
        self.port = MockPort(self.board, boot_time=boot_time)
        self.port.resets = resets
        sessions = choose_sessions(protocol, AngleMapping.ROUNDED, calibration, start=START)
        self.link = Link(self.port, *sessions, retry_min=0.5, retry_max=2.0)
        self.safety = Safety(LIMITS, *common_bounds(sessions), start=START)
        self.driver = Driver(
            self.link,
            self.safety,
            period=0.0195,  # a change at each fourth tick
            memory=memory,
        )
        if known:
            self.driver.memory.turn_to(self.port.identity)
            self.driver.memory.keep(sessions[0].pulses(sessions[0].content(START)))
        self.sent: list[tuple[float, tuple[float, ...]]] = []
        self.states: list[State] = []
        self.driver.connect()
        self.safety.activate(self.clock.now)

    def run(self, duration: float, command: Callable[[], None] | None = None) -> "Bench":
        for k in range(round(duration / TICK)):
            self.clock.now += TICK
            if command is not None and k % 4 == 0:
                command()
            if self.driver.tick(self.clock.now):
                self.sent.append((self.clock.now, self.driver.sent))
            if not self.states or self.states[-1] is not self.safety.state:
                self.states.append(self.safety.state)
        return self

    @property
    def lost_frames(self) -> int:
        """Frames that were lost on the line, as the diagnostics say."""
        [count] = [n for key, n in self.link.session.diagnostics.items() if names(key, "frames lost")]
        return count

    def goto(self, *angles: float, time: float = 0.0) -> None:
        self.safety.trajectory(SERVOS, [time], [list(angles)], self.clock.now, source=SOURCE)

    def asked(self) -> "Bench":
        """Ask it to be where it is: from now on it sends packets."""
        self.safety.control_mode(said(Mode.TELEOP, self.clock.now), self.clock.now, self.clock.now)
        self.goto(*START)
        return self.run(0.1)

    def moving(self) -> "Bench":
        """Bring it into motion towards -1.5 rad, half way there."""
        self.safety.control_mode(said(Mode.TELEOP, self.clock.now), self.clock.now, self.clock.now)
        self.run(0.1)
        self.goto(-1.5, -1.5, -1.5, time=1.0)
        self.run(0.5)
        assert self.safety.state is State.ACTIVE
        return self

    def stream(self) -> None:
        self.goto(-1.5, -1.5, -1.5, time=0.05)
