"""Which key means what.

The keys are those of the public Tripod tutorial, which are pressed there with Ctrl; here Ctrl may be left out. Catch
and throw are Q and z alone: Ctrl+Q and Ctrl+Z leave or suspend other programs, so that nothing may jump by them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, auto
from types import MappingProxyType
from typing import Final


class Act(Enum):
    """What a key asks for besides moving one joint."""

    STOP = auto()
    TELEOP = auto()
    IK = auto()
    WORK = auto()
    PARK = auto()
    CATCH = auto()
    THROW = auto()
    HELP = auto()
    QUIT = auto()


CHOSEN: Final = -1


@dataclass(frozen=True)
class Move:
    """Move one joint while the key is down.

    Attributes:
        servo: Its number; CHOSEN: the one that a digit chose last.
        sign: +1: its command grows, the strip of a servo goes up; -1: it falls.
    """

    servo: int
    sign: int


@dataclass(frozen=True)
class Choose:
    """Choose the joint that + and - move.

    Attributes:
        servo: Its number.
    """

    servo: int


Intent = Act | Move | Choose


@dataclass(frozen=True)
class Binding:
    """Keys that mean the same.

    Attributes:
        keys: As `escape.KeyParser` names them.
        intent: What they ask for.
        label: The keys as people know them; empty for what the help leaves out.
        help: What they do.
    """

    keys: tuple[str, ...]
    intent: Intent
    label: str = ""
    help: str = ""


BINDINGS: Final = (
    Binding(("up", "ctrl+up"), Move(0, +1), "Up, Down", "servo_0, or joint 0, up, down"),
    Binding(("down", "ctrl+down"), Move(0, -1)),
    Binding(("left", "ctrl+left"), Move(1, +1), "Left, Right", "servo_1, or joint 1, up, down"),
    Binding(("right", "ctrl+right"), Move(1, -1)),
    Binding(
        ("+", "=", "ctrl++", "ctrl+="), Move(CHOSEN, +1), "+, -", "servo_2, or the chosen joint, up, down"
    ),
    Binding(("-", "_", "ctrl+-", "ctrl+_"), Move(CHOSEN, -1)),
    Binding(("0",), Choose(0), "0 to 9", "choose the joint that + and - move"),
    *(Binding((str(i),), Choose(i)) for i in range(1, 10)),
    Binding(("space", "ctrl+space", "alt+space"), Act.STOP, "space", "stop: hold the pose, then park slowly"),
    Binding(("t", "T", "ctrl+t", "b", "B", "ctrl+b"), Act.TELEOP, "t or b", "drive by these keys"),
    Binding(("i", "I", "ctrl+i"), Act.IK, "i", "inverse kinematics drives"),
    Binding(("a", "A", "ctrl+a"), Act.WORK, "a", "go to the working pose"),
    Binding(("p", "P", "ctrl+p"), Act.PARK, "p", "go to the park position"),
    Binding(("Q",), Act.CATCH, "Q", "catch: strips down, at once"),
    Binding(("z", "Z"), Act.THROW, "z", "throw: strips up, at once"),
    Binding(("?", "h"), Act.HELP, "?", "show this"),
    Binding(("q", "ctrl+c", "ctrl+d"), Act.QUIT, "q", "stop and leave; Ctrl-C too"),
)

KEYS: Final[Mapping[str, Intent]] = MappingProxyType({k: b.intent for b in BINDINGS for k in b.keys})
"""What each key asks for."""

HELP: Final = "\n".join(f"  {b.label:<12} {b.help}" for b in BINDINGS if b.label)
"""The keys, one line for each meaning; Ctrl may be held with any of them but Q, q and z."""
