"""Whether something is done as often as it should be."""

import pytest

from tests.messages import assert_names
from tripod_graph.rate_check import Turns, short


def test_the_rate_is_that_since_the_last_question() -> None:
    turns = Turns()
    for _ in range(1000):
        turns.add()
    assert turns.rate(10.0) is None, "since when is not known"
    for _ in range(41):
        turns.add()
    assert turns.rate(11.0) == pytest.approx(41.0)
    assert turns.rate(13.0) == 0.0


def test_a_question_that_comes_at_once_again_has_the_same_answer() -> None:
    turns = Turns()
    turns.rate(0.0)
    for _ in range(50):
        turns.add()
    assert turns.rate(1.0) == turns.rate(1.1) == 50.0


@pytest.mark.parametrize("rate", [None, 50.0, 47.5])
def test_95_percent_is_enough(rate: float | None) -> None:
    assert short("packets", rate, 50.0) == ""


def test_less_than_95_percent_is_told() -> None:
    assert_names(short("packets", 47.0, 50.0), "packets", 47, "50 Hz")
