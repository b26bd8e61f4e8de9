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
        (1, [5, 1, 6, 2], 1),  # of two publishers
    ],
)
def test_what_is_missing_since_the_first_message_is_lost(told: int, sequences: list[int], lost: int) -> None:
    losses = Losses(told)
    for sequence in sequences:
        losses.take(sequence)
    assert losses.lost == lost
