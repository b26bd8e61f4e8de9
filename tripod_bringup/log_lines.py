"""What the lines that a node prints mean to the supervisor. Pure."""

import re
from dataclasses import dataclass
from enum import IntEnum

_ROS = re.compile(r"^\[(DEBUG|INFO|WARN|ERROR|FATAL)\] \[[0-9.]+\] \[[^\]]*\]: (.*)$")
_FACTS = {
    "page": re.compile(r"page (\S.*)"),
    "recording": re.compile(r"recording (\S.*)"),
    "recorded": re.compile(r"(?:recorded|the recording ended:) (\S.*)"),
}


class Level(IntEnum):
    """How much a line matters; the names are those of the ROS log."""

    DEBUG = 10
    INFO = 20
    WARN = 30
    ERROR = 40
    FATAL = 50


@dataclass(frozen=True)
class LogLine:
    """One line of a node's output.

    Attributes:
        level: As the node logged it; what it prints without a level, such as why it refuses to start, counts as ERROR.
        text: Without level, time and node name.
        fact: "page" or "recording" when the line tells where the page or the recording is, "recorded" when it tells how
            the recording ended, else empty.
        value: The address, the path, or what was recorded and what is missing.
    """

    level: Level
    text: str
    fact: str = ""
    value: str = ""


def parse(line: str) -> LogLine:
    """Return what `line` says.

    >>> parse("page http://127.0.0.1:8080").value
    'http://127.0.0.1:8080'
    >>> parse("[WARN] [1700000000.5] [driver]: no port").text
    'no port'
    """
    level, text = Level.ERROR, line
    if match := _ROS.match(line):
        level, text = Level[match[1]], match[2]
    for fact, pattern in _FACTS.items():
        if match := pattern.fullmatch(text):
            return LogLine(level if fact == "recorded" else Level.INFO, text, fact, match[1].strip())
    return LogLine(level, text)
