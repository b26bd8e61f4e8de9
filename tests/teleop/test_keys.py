"""The table of the keys."""

import re

import pytest

from tripod_teleop.escape import KeyParser
from tripod_teleop.keys import BINDINGS, CHOSEN, HELP, KEYS, Act, Move

TUTORIAL = [
    ("up", Move(0, +1)),
    ("down", Move(0, -1)),
    ("left", Move(1, +1)),
    ("right", Move(1, -1)),
    ("+", Move(CHOSEN, +1)),
    ("-", Move(CHOSEN, -1)),
    ("a", Act.WORK),
    ("i", Act.IK),
    ("b", Act.TELEOP),
]


@pytest.mark.parametrize(("key", "intent"), TUTORIAL)
def test_the_keys_of_the_tutorial_with_and_without_ctrl(key: str, intent: object) -> None:
    assert KEYS[key] == KEYS["ctrl+" + key] == intent
    if key.isalpha() and len(key) == 1:
        assert KEYS[key.upper()] == intent


@pytest.mark.parametrize(
    ("key", "intent"),
    [
        ("space", Act.STOP),
        ("alt+space", Act.STOP),
        ("t", Act.TELEOP),
        ("p", Act.PARK),
        ("?", Act.HELP),
        ("q", Act.QUIT),
        ("ctrl+c", Act.QUIT),
        ("z", Act.THROW),
        ("Z", Act.THROW),
    ],
)
def test_the_other_keys(key: str, intent: object) -> None:
    assert KEYS[key] is intent


def test_small_q_leaves_and_the_other_catches() -> None:
    assert KEYS["q"] is Act.QUIT
    assert KEYS["Q"] is Act.CATCH


@pytest.mark.parametrize("code", sorted({*range(0x20), 0x7F} - {0x1B}))
def test_no_key_that_means_something_to_a_terminal_makes_servos_jump(code: int) -> None:
    for key in KeyParser().feed(bytes([code])):
        assert KEYS.get(key) not in (Act.CATCH, Act.THROW)


def test_no_key_means_two_things() -> None:
    assert sum(len(b.keys) for b in BINDINGS) == len(KEYS)


def test_the_help_names_every_meaning_once() -> None:
    lines = HELP.splitlines()
    assert len(lines) == len({re.split(r"\s{2,}", line.strip())[0] for line in lines}) == 13
    assert {b.intent for b in BINDINGS if b.label and isinstance(b.intent, Act)} == set(Act)
    assert {b.intent.servo for b in BINDINGS if b.label and isinstance(b.intent, Move)} == {0, 1, CHOSEN}
