"""A command that is interrupted at any instant, its first milliseconds included, ends without a traceback."""

import signal
from pathlib import Path

import pytest

from benchmarks.signals import NODES, QUICK, WELL, instants, interrupted
from tests.tiers import sampled

SIGNALS = (signal.SIGINT, signal.SIGTERM)


def check(words: tuple[str, ...], number: signal.Signals, delay: float, folder: Path) -> None:
    ended = interrupted(words, number, delay, folder)
    assert ended.verdict == WELL, f"{' '.join(words)} after {delay:g} s: {ended}"


@pytest.mark.parametrize("number", SIGNALS)
def test_the_first_tenth_of_a_second_is_no_exception(number: signal.Signals, tmp_path: Path) -> None:
    """The interpreter starts, and starts itself again; then the imports begin."""
    for delay in range(0, 100, 8):
        check(QUICK["print scene"], number, delay / 1000, tmp_path)


@pytest.mark.parametrize("name", sampled(QUICK, "run", "study"))
def test_every_command_may_be_interrupted(name: str, tmp_path: Path) -> None:
    for k, delay in enumerate(instants(4, 1.5)[1:]):
        check(QUICK[name], SIGNALS[k % 2], delay, tmp_path)


@pytest.mark.ros
@pytest.mark.usefixtures("domain")
@pytest.mark.parametrize("name", sampled(NODES, "sim"))
def test_every_node_may_be_interrupted(name: str, tmp_path: Path) -> None:
    for k, delay in enumerate((0.05, 0.8, 2.0)):
        check(NODES[name], SIGNALS[k % 2], delay, tmp_path)
