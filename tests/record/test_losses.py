"""What counts as lost of a topic."""

import pytest

from tripod_record.losses import Losses


@pytest.mark.parametrize(
    ("told", "sequences", "lost"),
    [
        (0, [], 0),
        (2, [], 2),
        (1, [7], 0),  # it was thrown away before the first came
        (3, [7, 8, 9], 0),
        (1, [7, 9], 1),
        (2, [7, 8, 11, 12], 2),
        (1, [0, 0], 1),  # a middleware that does not number
        (1, [5, 1, 6, 2], 1),  # of two publishers, one of which was not seen
    ],
)
def test_what_is_missing_since_the_first_message_is_lost(told: int, sequences: list[int], lost: int) -> None:
    losses = Losses(told, publishers={b"one"})
    for sequence in sequences:
        losses.take(sequence)
    assert losses.lost == lost


@pytest.mark.parametrize(
    ("sequences", "lost"),
    [
        ([5, 1, 6, 2], 0),  # one of them threw four away before the recorder came
        ([1, 1, 2, 2, 3], 0),
        ([1, 5, 7, 2], 1),
        ([5, 6, 9], 0),  # the second may have begun at 9
        ([], 1),
    ],
)
def test_each_publisher_has_a_series_of_its_own(sequences: list[int], lost: int) -> None:
    losses = Losses(1, publishers={b"one", b"two"})
    for sequence in sequences:
        losses.take(sequence)
    assert losses.lost == lost


def test_long_losses_take_no_memory() -> None:
    losses = Losses(1, reliable=False, publishers={b"one"})
    for sequence in range(0, 100_000, 2):
        losses.take(sequence)
    assert losses.lost == 1 and len(losses._ends) <= 65
