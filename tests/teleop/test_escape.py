"""From bytes to keys: what terminals send, torn anywhere, and garbage."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tripod_teleop.escape import LONGEST, KeyParser
from tripod_teleop.keys import KEYS

SENT = [
    # what terminals send, and the key it stands for
    (b"a", ["a"]),
    (b"A", ["A"]),
    (b"+", ["+"]),
    (b" ", ["space"]),
    (b"\r", ["enter"]),
    (b"\n", ["enter"]),
    (b"\x7f", ["backspace"]),
    (b"\x00", ["ctrl+space"]),
    (b"\x01", ["ctrl+a"]),
    (b"\x03", ["ctrl+c"]),
    (b"\x09", ["ctrl+i"]),
    (b"\x11", ["ctrl+q"]),
    (b"\x1a", ["ctrl+z"]),
    (b"\x1f", ["ctrl+_"]),
    (b"\x1b[A", ["up"]),
    (b"\x1b[B", ["down"]),
    (b"\x1b[C", ["right"]),
    (b"\x1b[D", ["left"]),
    (b"\x1bOA", ["up"]),  # application mode
    (b"\x1bOD", ["left"]),
    (b"\x1b[1;5A", ["ctrl+up"]),
    (b"\x1b[1;5B", ["ctrl+down"]),
    (b"\x1b[1;5C", ["ctrl+right"]),
    (b"\x1b[1;5D", ["ctrl+left"]),
    (b"\x1bO1;5A", ["ctrl+up"]),
    (b"\x1bOa", ["ctrl+up"]),  # rxvt
    (b"\x1b[1;A", ["up"]),
    (b"\x1b[1;2A", ["shift+up"]),
    (b"\x1b[1;3A", ["alt+up"]),
    (b"\x1b[1;8A", ["ctrl+alt+shift+up"]),
    (b"\x1bOk", ["+"]),  # keypad
    (b"\x1bOm", ["-"]),
    (b"\x1b[43;5u", ["ctrl++"]),
    (b"\x1b[27;5;43~", ["ctrl++"]),
    (b"\x1b[45;5u", ["ctrl+-"]),
    (b"\x1b[97u", ["a"]),
    (b"\x1b[65;2u", ["A"]),
    (b"\x1b[32;5u", ["ctrl+space"]),
    (b"\x1ba", ["alt+a"]),
    (b"\x1b ", ["alt+space"]),
    (b"\x1bO ", ["space"]),  # keypad
    (b"\x1b[ ", ["space"]),  # Alt with [, then space: STOP
    (b"\x1b[1;5 ", ["space"]),
    (b"\x1b\x1b[A", ["escape", "up"]),
    (b"\x1b\x1b\x1b[1;5A", ["escape", "escape", "ctrl+up"]),
]
MEANINGLESS = [
    b"\x1b[[A",  # F1 on the Linux console: no key A, which would move the robot
    b"\x1b[[E",
    b"\x1b[11~",
    b"\x1b[2~",
    b"\x1b[3;5~",
    b"\x1b[M !!",  # mouse
    b"\x1b[<0;10;20M",
    b"\x1b[I",  # focus
    b"\x1b[?1;2c",  # an answer of the terminal
    b"\x1b[5;10R",
    b"\x1b[1;9A",
    b"\x1b[1;0A",
    b"\x1b[1;5;7A",
    b"\x1b[999999999999u",
    b"\x1b[27;5~",
    b"\x1b[" + b"1" * (LONGEST + 100) + b"A",
    b"\x1bOP",
    b"\xc3\xa9",
    b"\xff\xfe\x80",
    b"\x1b\xff",
    b"\x1b[200~aA p\x1b[201~",  # pasted
    b"\x1b[200~a\x1b[A\x1b[[\x1b[201~",
]


@pytest.mark.parametrize(("data", "keys"), SENT)
def test_what_terminals_send(data: bytes, keys: list[str]) -> None:
    assert KeyParser().feed(data) == keys


@pytest.mark.parametrize("data", MEANINGLESS)
def test_what_means_nothing_gives_no_key_and_does_not_spoil_the_next(data: bytes) -> None:
    assert KeyParser().feed(data + b"\x1b[Aq") == ["up", "q"]


PIECES = st.lists(
    st.sampled_from([data for data, _ in SENT] + MEANINGLESS) | st.binary(max_size=6), max_size=12
)


@given(pieces=PIECES, cuts=st.lists(st.integers(0, 200), max_size=20))
def test_any_split_of_the_bytes_gives_the_same_keys(pieces: list[bytes], cuts: list[int]) -> None:
    data = b"".join(pieces)
    whole = KeyParser().feed(data)
    parser, edges = KeyParser(), [0, *sorted(min(c, len(data)) for c in cuts), len(data)]
    parts = [data[a:b] for a, b in pairwise(edges)]
    assert b"".join(parts) == data
    assert [key for part in parts for key in parser.feed(part)] == whole


@given(keys=st.lists(st.sampled_from(SENT), max_size=20))
def test_keys_in_a_row_do_not_disturb_each_other(keys: list[tuple[bytes, list[str]]]) -> None:
    data = b"".join(d for d, _ in keys)
    assert KeyParser().feed(data) == [k for _, names in keys for k in names]


@given(garbage=st.binary(max_size=300))
def test_garbage_gives_only_keys_with_names_and_stop_gets_through(garbage: bytes) -> None:
    parser = KeyParser()
    for key in parser.feed(garbage):
        assert key.isascii()
        assert key.isprintable()
        assert key == "escape" or not key.startswith("\x1b")
    parser.feed(b"\x1b[201~")  # the end of a paste, if the garbage began one
    assert [KEYS.get(k) for k in parser.feed(b"\x1b ")] == [KEYS["space"]]


def test_a_torn_arrow_never_becomes_a_letter() -> None:
    for whole, name in ((b"\x1b[A", "up"), (b"\x1bOA", "up"), (b"\x1b[1;5A", "ctrl+up")):
        parser = KeyParser()
        keys = [parser.feed(bytes([byte])) for byte in whole]
        assert keys == [[]] * (len(whole) - 1) + [[name]]
