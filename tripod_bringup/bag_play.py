"""`tripod bag play`: a recording into the simulator, to the robot, or as topics."""

import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tripod_bringup.compiling import compiling_told
from tripod_bringup.options import To
from tripod_bringup.run_command import BAD_ARGUMENTS, FAILED
from tripod_graph.run import run_node
from tripod_host.stop import first
from tripod_record.bag import Bag
from tripod_record.errors import RecordError
from tripod_record.info import printable
from tripod_record.selection import is_selected, patterns
from tripod_sim.errors import SceneError, StepError

RATES = (0.01, 100.0)
"""Smallest and largest rate, but for the simulator, which may also run as fast as it can."""

THEN = {To.SIM: " and building its simulation", To.ROBOT: " for its motion", To.TOPICS: ""}
"""What is done beside reading before anything plays."""

INTERRUPTED = 130
"""Exit code where it was ended before anything was played."""


def play_command(
    file: Path, *, to: To, rate: float, start: float, topics: str, subnet: bool, ros: Sequence[str]
) -> int:
    """Play, print how it ended and return the exit code.

    0; 1 it broke off or differs; 2 bad input, or no driver can play it; 130 it was ended before anything was played.
    """
    try:
        check(to, rate, start)
        if sys.stderr.isatty():
            print(f"tripod bag play: reading {printable(str(file))}{THEN[to]}", file=sys.stderr, flush=True)
        bag = Bag(file)
        with bag.accounted():
            make = MAKERS[to](bag, topics, start, rate)
    except (RecordError, SceneError, OSError) as error:
        return complain(error, BAD_ARGUMENTS)
    except StepError as error:
        return complain(error, FAILED)
    from tripod_bringup.bag_controls import Controls  # noqa: PLC0415 - not needed for the help

    tell_unread("play", bag)
    made: list[Any] = []
    controls: list[Controls] = []

    def build() -> Any:
        made.append(make())
        controls.append(Controls(made[0], made[0]))
        return made[0]

    words = [*(["--subnet"] if subnet else []), "--ros-args", *ros]
    with first(lambda: INTERRUPTED):
        code = run_node("tripod bag play", build, words, until=lambda: bool(made[0].done))
    for control in controls:
        control.close()
    if made and made[0].done:
        failed = getattr(made[0], "failed", False)
        print(
            made[0].done if not failed else f"tripod bag play: {made[0].done}",
            file=sys.stderr if failed else sys.stdout,
        )
        refused = getattr(made[0], "refused", False)
        code = code or (BAD_ARGUMENTS if refused else FAILED if failed else 0)
    elif made and made[0].waiting:
        code = code or INTERRUPTED
    return code or tell_unread("play", bag)


def check(to: To, rate: float, start: float) -> None:
    """Raise RecordError for a rate or a start that is out of range."""
    low, high = RATES
    if not (low <= rate <= high or (to is To.SIM and rate == math.inf)):
        also = ", or inf: as fast as it can" if to is To.SIM else ""
        raise RecordError(f"--rate is {rate:g}; allowed is {low:g} to {high:g}{also}")
    if not 0 <= start < math.inf:
        raise RecordError(f"--start is {start:g} s; it must not be negative")


def complain(error: Exception, code: int) -> int:
    """Say in one line what is wrong and return the exit code."""
    print("tripod bag play: " + printable(" ".join(str(error).split())), file=sys.stderr)
    return code


def tell_unread(command: str, bag: Bag) -> int:
    """Say in one line what could not be read of a recording, if that is news; return the exit code: 0, 1 damaged."""
    if left := bag.left_out():
        print(f"tripod bag {command}: {left}", file=sys.stderr)
    return FAILED if bag.damaged else 0


def chosen(topics: str) -> Callable[[str], bool]:
    """Return whether a topic is asked for; nothing asked for means all."""
    wanted = patterns(topics, "/")
    return lambda topic: not wanted or is_selected(topic, "/", wanted, ())


def _into_simulator(bag: Bag, topics: str, start: float, rate: float) -> Callable[[], Any]:
    from tripod_bringup.bag_session import read_session  # noqa: PLC0415 - not needed for the help

    check_start(bag.info.duration, start)
    session = read_session(bag, chosen(topics))
    with compiling_told("tripod bag play"):
        rerun = session.rerun()

    def make() -> Any:
        from tripod_bringup.bag_simulator import SimPlayer  # noqa: PLC0415

        return SimPlayer(session, rerun, start=start, rate=rate)

    return make


def _to_robot(bag: Bag, topics: str, start: float, rate: float) -> Callable[[], Any]:
    from tripod_bringup.bag_motion import joint_path  # noqa: PLC0415

    path = joint_path(bag, chosen(topics))
    check_start(path.end, start)

    def make() -> Any:
        from tripod_play.replay_node import ReplayNode  # noqa: PLC0415

        return ReplayNode(path, start=max(start, float(path.times[0])), rate=rate)

    return make


def _as_topics(bag: Bag, topics: str, start: float, rate: float) -> Callable[[], Any]:
    check_start(bag.info.duration, start)

    def make() -> Any:
        from tripod_record.play_node import COMMANDING, TopicPlayer  # noqa: PLC0415

        moving = () if topics else tuple(f"*/{name}" for name in COMMANDING)
        wanted = patterns(topics, "/") or ("/*",)
        return TopicPlayer(bag, lambda t: is_selected(t, "/", wanted, moving), start=start, rate=rate)

    return make


MAKERS = {To.SIM: _into_simulator, To.ROBOT: _to_robot, To.TOPICS: _as_topics}


def check_start(duration: float, start: float) -> None:
    """Raise RecordError for a start behind the end."""
    if start and not start < duration:
        raise RecordError(f"--start is {start:g} s; the recording ends at {duration:.2f} s")
