"""Keys and a line of progress for what plays a recording, where there is a terminal."""

import sys
from typing import Any, Protocol

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from tripod_teleop.escape import KeyParser
from tripod_teleop.terminal import Terminal, TerminalError

PERIOD = 0.05
"""Time between two looks at the keys [s]."""
BAR = 16
"""Characters of the bar: the line fits into 80 columns."""


class Player(Protocol):
    """A node that plays a recording."""

    done: str
    duration: float

    @property
    def waiting(self) -> str:
        """What it waits for, empty once it plays."""

    @property
    def paused(self) -> bool:
        """Whether it stands still."""

    @property
    def place(self) -> float:
        """Place in the recording [s]."""

    def toggle(self) -> None:
        """Pause, or go on."""

    def step(self) -> None:
        """While paused: go on by one step."""


ENDED = "ended by q"
"""How a player ends that the user ends."""


class Controls:
    """Gives the keys of the terminal to a player: space pauses and goes on, `.` and the right arrow step, q ends."""

    def __init__(self, node: Node, player: Player) -> None:
        """The node keeps the object."""
        self._player, self._parser = player, KeyParser()
        self._terminal: Terminal | None = None
        self._told = ""
        if sys.stdin.isatty() and sys.stdout.isatty():
            self._terminal = Terminal()
            self._terminal.enter()
        look = self._look if self._terminal else self._tell
        node.create_timer(PERIOD, look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def close(self) -> None:
        """Restore the terminal."""
        if self._terminal:
            self._terminal.show("")
            self._terminal.restore()

    def _look(self) -> None:
        assert self._terminal
        try:
            self.press(self._terminal.read())
        except TerminalError as error:
            self._player.done = str(error)
            return
        self._terminal.show(progress_line(self._player))

    def _tell(self) -> None:
        """Say once what it waits for, where there is no line to redraw."""
        if (waiting := self._player.waiting) and waiting != self._told:
            print(f"tripod bag play: {waiting}", file=sys.stderr, flush=True)
        self._told = waiting

    def press(self, data: bytes) -> None:
        """Do what the keys of which the terminal sent `data` say."""
        for key in self._parser.feed(data):
            if key == "space":
                self._player.toggle()
            elif key in (".", "right"):
                self._player.step()
            elif key == "q":
                self._player.done = self._player.done or ENDED


def progress_line(player: Any) -> str:
    """Return place, duration and what the keys do, or what it waits for."""
    if player.waiting:
        return f"{player.waiting}  q: end"
    share = player.place / player.duration if player.duration else 1.0
    bar = "#" * round(BAR * min(max(share, 0.0), 1.0))
    state = "paused " if player.paused else "playing"
    return (
        f"{state} [{bar:<{BAR}}] {player.place:7.2f} / {player.duration:.2f} s  space: pause  .: step  q: end"
    )
