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
from tripod_record.segments import chosen_segment, segment_lines
from tripod_record.selection import is_selected, patterns
from tripod_runtime.resimulation import Resimulation
from tripod_sim.errors import SceneError, StepError

RATES = (0.01, 100.0)
"""Smallest and largest rate, but for the simulator, which may also run as fast as it can."""

THEN = {To.SIM: " and building its simulation", To.ROBOT: " for its motion", To.TOPICS: ""}
"""What is done beside reading before anything plays."""

INTERRUPTED = 130
"""Exit code where it was ended before anything was played."""


def play_command(
    file: Path,
    *,
    to: To,
    rate: float,
    start: float,
    topics: str,
    subnet: bool,
    ros: Sequence[str],
    segment: int | None = None,
) -> int:
    """Play, print how it ended and return the exit code.

    Into the simulator, all segments are played in turn, or only `segment`.

    0; 1 it broke off or differs; 2 bad input, or no driver can play it; 130 it was ended before anything was played.
    """
    try:
        check(to, rate, start)
        if segment is not None and to is not To.SIM:
            raise RecordError(f"--segment belongs to --to sim; with --to {to.value} use --start")
        if sys.stderr.isatty():
            print(f"tripod bag play: reading {printable(str(file))}{THEN[to]}", file=sys.stderr, flush=True)
        bag = Bag(file)
        with bag.accounted():
            if to is To.SIM:
                players = _into_simulator(bag, topics, start, rate, segment)
            else:
                players = {"": (_to_robot if to is To.ROBOT else _as_topics)(bag, topics, start, rate)}
    except (RecordError, SceneError, OSError) as error:
        return complain(error, BAD_ARGUMENTS)
    except StepError as error:
        return complain(error, FAILED)
    tell_unread("play", bag)
    words = [*(["--subnet"] if subnet else []), "--ros-args", *ros]
    codes, goes_on = [0], True
    for name, make in players.items():
        if goes_on:
            code, goes_on = _play(name, make, words)
            codes.append(code)
    return max(codes) or tell_unread("play", bag)


def _play(name: str, make: Callable[[], Any], words: Sequence[str]) -> tuple[int, bool]:
    """Play what `make` returns; return the exit code, and whether it came to its end. `name`: before how it ended."""
    from tripod_bringup.bag_controls import ENDED, Controls  # noqa: PLC0415 - not needed for the help

    made: list[Any] = []
    controls: list[Controls] = []

    def build() -> Any:
        made.append(make())
        controls.append(Controls(made[0], made[0]))
        return made[0]

    with first(lambda: INTERRUPTED):
        code = run_node("tripod bag play", build, words, until=lambda: bool(made[0].done))
    for control in controls:
        control.close()
    done = made[0].done if made else ""
    if done:
        failed = getattr(made[0], "failed", False)
        said = f"{name}{done}"
        print(
            said if not failed else f"tripod bag play: {said}",
            file=sys.stderr if failed else sys.stdout,
        )
        refused = getattr(made[0], "refused", False)
        code = code or (BAD_ARGUMENTS if refused else FAILED if failed else 0)
    elif made and made[0].waiting:
        code = code or INTERRUPTED
    return code, bool(done) and done != ENDED


def check(to: To, rate: float, start: float) -> None:
    """Raise RecordError for a rate or a start that is out of range."""
    low, high = RATES
    if not (low <= rate <= high or (to is To.SIM and rate == math.inf)):
        also = ", or inf: as fast as it can" if to is To.SIM else ""
        raise RecordError(f"--rate is {rate:g}; allowed: {low:g} to {high:g}{also}")
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


def _into_simulator(
    bag: Bag, topics: str, start: float, rate: float, number: int | None
) -> dict[str, Callable[[], Any]]:
    """Return what makes the players of the segments that end after `start` [s], by what tells them apart."""
    from tripod_bringup.bag_session import Session, read_sessions  # noqa: PLC0415 - not needed for the help

    check_start(bag.info.duration, start)
    sessions = read_sessions(bag, chosen(topics))
    segments = [session.segment for session in sessions]
    if number is not None:
        sessions = [sessions[chosen_segment(bag, segments, number).number - 1]]
    elif len(sessions) > 1:  # those before the start are not built
        sessions = [s for s in sessions if 1e-9 * (s.segment.end - bag.start) > start] or sessions[-1:]
    lines = segment_lines(bag, segments)
    with compiling_told("tripod bag play"):
        resimulations = [session.resimulation() for session in sessions]

    def player(session: Session, resimulation: Resimulation) -> Callable[[], Any]:
        def make() -> Any:
            from tripod_bringup.bag_simulator import SimPlayer  # noqa: PLC0415

            return SimPlayer(session, resimulation, start=start, rate=rate)

        return make

    return {
        f"{lines[s.segment.number - 1]}: " if len(segments) > 1 else "": player(s, resimulation)
        for s, resimulation in zip(sessions, resimulations, strict=True)
    }


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
        from tripod_record.play_node import COMMANDING, OF_EVERY_NODE, TopicPlayer  # noqa: PLC0415

        moving = () if topics else tuple(f"*/{name}" for name in COMMANDING)
        wanted = patterns(topics, "/") or ("/*",)

        def played(topic: str) -> bool:
            return is_selected(topic, "/", wanted, (*OF_EVERY_NODE, *moving))

        left = [t for t in bag.topics if not played(t) and is_selected(t, "/", wanted, ())]
        if left:
            print(
                f"tripod bag play: not played: {printable(', '.join(left))}; these topics command robots, or "
                "every node publishes them: name those that you want with --topics",
                file=sys.stderr,
            )
        return TopicPlayer(bag, played, start=start, rate=rate)

    return make


def check_start(duration: float, start: float) -> None:
    """Raise RecordError for a start behind the end."""
    if start and not start < duration:
        raise RecordError(f"--start is {start:g} s; the recording ends at {duration:.2f} s")
