"""The codec of the framed protocol: worked-out frames, round trips, and streams with garbage in them."""

from binascii import crc_hqx

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.messages import raises_naming
from tripod_driver.framed import (
    BODY_MAX,
    TEXT_MAX,
    VERSION,
    Acknowledgement,
    BoardState,
    Decoder,
    Drop,
    Error,
    ErrorCode,
    Flags,
    Frame,
    Hello,
    HelloReply,
    Hold,
    ImuLine,
    OtherVersion,
    Release,
    ResetCause,
    SetPulses,
    cobs_decode,
    cobs_encode,
    encode,
)
from tripod_driver.protocol import ProtocolError

u8, u16 = st.integers(0, 0xFF), st.integers(0, 0xFFFF)
pulses = st.tuples(u16, u16, u16)
states = st.sampled_from(BoardState)
flags, causes = u8.map(Flags), u8.map(ResetCause)
texts = st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E), max_size=TEXT_MAX)
messages = st.one_of(
    st.sampled_from([Hello(), Hold(), Release()]),
    st.builds(SetPulses, pulses),
    st.builds(HelloReply, st.tuples(u8, u8), u8, u8, u16, u16, u16, u16, causes, states, flags, pulses),
    st.builds(Acknowledgement, states, flags, pulses, u16),
    st.builds(Error, st.sampled_from(ErrorCode), u8, u16),
    st.builds(ImuLine, texts),
)


def framed(body: bytes) -> bytes:
    """A frame of any body, with the right CRC."""
    return b"\0" + cobs_encode(body + crc_hqx(body, 0xFFFF).to_bytes(2, "little")) + b"\0"


def long_division(data: bytes) -> int:
    """CRC-16 bit by bit: polynomial x^16 + x^12 + x^5 + 1, register starting at all ones."""
    register = 0xFFFF
    for byte in data:
        for bit in range(7, -1, -1):
            top = register >> 15 ^ byte >> bit & 1
            register = (register << 1 & 0xFFFF) ^ (0x1021 if top else 0)
    return register


def test_the_checksum_is_the_published_one() -> None:
    assert long_division(b"123456789") == crc_hqx(b"123456789", 0xFFFF) == 0x29B1


@pytest.mark.parametrize(
    ("message", "sequence", "frame", "body"),
    [
        (Hello(), 7, "00 06020107 2ae1 00", "02 01 07"),
        (Hold(), 255, "00 060203ff 5fe9 00", "02 03 ff"),
        (Release(), 0, "00 03020403 386e 00", "02 04 00"),
        (
            SetPulses((15000, 5440, 24000)),
            0,
            "00 03020209983a4015c05d 1683 00",
            "02 02 00 983a 4015 c05d",
        ),
        (
            HelloReply(
                (1, 2),
                2,
                3,
                5440,
                24000,
                500,
                475,
                ResetCause.EXTERNAL | ResetCause.WATCHDOG,
                BoardState.ACTIVE,
                Flags(5),
                (15000, 15005, 257),
            ),
            7,
            "00 1b028107010202034015c05df401db010a0105983a9d3a0101 e680 00",
            "02 81 07 01 02 02 03 4015 c05d f401 db01 0a 01 05 983a 9d3a 0101",
        ),
        (
            Acknowledgement(BoardState.HOLDING, Flags.WATCHDOG, (15000, 15005, 257), 0x1234),
            1,
            "00 100282010202983a9d3a01013412 08ca 00",
            "02 82 01 02 02 983a 9d3a 0101 3412",
        ),
        (Error(ErrorCode.PULSE, 2, 0x1101), 9, "00 0a02830904020111 21b6 00", "02 83 09 04 02 0111"),
        (
            ImuLine("-3.5,12.25,"),
            2,
            "00 110284022d332e352c31322e32352c 8b91 00",
            "02 84 02 2d332e352c31322e32352c",
        ),
    ],
)
def test_frames_match_those_worked_out_by_hand(message, sequence: int, frame: str, body: str) -> None:
    expected = bytes.fromhex(frame)
    assert encode(message, sequence) == expected
    decoded = cobs_decode(expected[1:-1])
    assert decoded is not None
    assert decoded[:-2] == bytes.fromhex(body)
    assert long_division(decoded[:-2]).to_bytes(2, "little") == decoded[-2:]


@given(messages, u8)
def test_a_message_survives_encoding_and_decoding(message, sequence: int) -> None:
    frame = encode(message, sequence)
    assert frame.count(0) == 2 and len(frame) <= BODY_MAX + 3
    decoder = Decoder()
    assert decoder.feed(frame) == [Frame(sequence, message)]
    assert not decoder.dropped


@given(st.binary(max_size=253))
def test_stuffing_leaves_no_zero_adds_one_byte_and_is_undone(data: bytes) -> None:
    stuffed = cobs_encode(data)
    assert 0 not in stuffed and len(stuffed) == len(data) + 1
    assert cobs_decode(stuffed) == data


@pytest.mark.parametrize("wrong", ["", "00", "02", "01 03 01", "02 00", "05 01 02 03"])
def test_stuffing_that_cannot_be_is_refused(wrong: str) -> None:
    assert cobs_decode(bytes.fromhex(wrong)) is None


garbage = st.binary(max_size=60)


@given(st.lists(st.tuples(garbage, messages, u8), max_size=12), garbage, st.randoms(use_true_random=False))
def test_every_frame_is_found_however_the_stream_is_cut(parts, tail: bytes, random) -> None:
    stream = b"".join(noise + encode(message, sequence) for noise, message, sequence in parts) + tail
    decoder, found = Decoder(), []
    while stream:
        cut = random.randint(1, 50)
        found += decoder.feed(stream[:cut])
        stream = stream[cut:]
    assert found == [Frame(sequence, message) for _, message, sequence in parts]


@given(st.lists(st.binary(max_size=100), max_size=30))
def test_any_bytes_are_survived_in_bounded_memory(pieces: list[bytes]) -> None:
    decoder = Decoder()
    for piece in pieces:
        decoder.feed(piece)
        assert len(decoder._partial) <= BODY_MAX + 1
    assert decoder.feed(encode(Hold(), 3)) == [Frame(3, Hold())]


@given(messages, u8, st.integers(1, 42), st.integers(1, 255))
def test_one_damaged_byte_yields_no_message(message, sequence: int, at: int, change: int) -> None:
    frame = bytearray(encode(message, sequence))
    frame[min(at, len(frame) - 2)] ^= change
    decoder = Decoder()
    assert decoder.feed(bytes(frame)) == []
    assert decoder.dropped.total() >= 1


def body_of(*parts: int, size: int = 0) -> bytes:
    return bytes([*parts, *[1] * size])


@pytest.mark.parametrize(
    ("stream", "reason"),
    [
        (b"\x01" * (BODY_MAX + 2) + b"\0", Drop.TOO_LONG),
        (b"\x05\x01\0", Drop.COBS),
        (b"\x03\x01\x01\0", Drop.TOO_SHORT),
        (encode(Hello(), 1)[:-2] + b"\x01\0", Drop.CRC),
        (framed(body_of(VERSION, 0x09, 0)), Drop.TYPE),
        (framed(body_of(VERSION, 0x06, 0, size=3)), Drop.LENGTH),
        (framed(body_of(VERSION, 0x07, 0)), Drop.LENGTH),
        (framed(body_of(VERSION, 0x85, 0, 1, 0, 3, size=4)), Drop.VALUE),  # kind 3
        (framed(body_of(VERSION, 0x86, 0)), Drop.VALUE),  # no channels
        (framed(body_of(VERSION, 0x86, 0, size=6)), Drop.LENGTH),
        (framed(body_of(VERSION, 0x80, 0)), Drop.TYPE),
        (framed(body_of(VERSION, 0x01, 0, size=1)), Drop.LENGTH),
        (framed(body_of(VERSION, 0x02, 0, size=5)), Drop.LENGTH),
        (framed(body_of(VERSION, 0x02, 0, size=7)), Drop.LENGTH),
        (framed(body_of(VERSION, 0x82, 0, 4, size=9)), Drop.VALUE),  # state 4
        (framed(body_of(VERSION, 0x83, 0, 9, size=3)), Drop.VALUE),  # error code 9
        (framed(body_of(VERSION, 0x84, 0, 0x0A)), Drop.VALUE),
        (framed(body_of(VERSION, 0x84, 0, 0xE9)), Drop.VALUE),
        (framed(body_of(VERSION, 0x84, 0, size=TEXT_MAX + 1)), Drop.VALUE),
    ],
)
def test_what_is_dropped_is_counted_by_its_reason(stream: bytes, reason: Drop) -> None:
    decoder = Decoder()
    assert decoder.feed(stream) == []
    assert decoder.dropped == {reason: 1}
    assert decoder.feed(encode(Hello(), 0)) == [Frame(0, Hello())]


@pytest.mark.parametrize("version", [0, 1, 255])
def test_a_frame_of_another_version_is_reported_not_understood(version: int) -> None:
    decoder = Decoder()
    assert decoder.feed(framed(body_of(version, 0x81, 4, size=3))) == [Frame(4, OtherVersion(version))]


def test_a_frame_as_long_as_allowed_passes_and_one_longer_does_not() -> None:
    decoder = Decoder()
    assert len(decoder.feed(framed(body_of(9, 1, 0, size=BODY_MAX - 5)))) == 1
    assert decoder.feed(framed(body_of(9, 1, 0, size=BODY_MAX - 4))) == []
    assert decoder.dropped == {Drop.TOO_LONG: 1}


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: encode(Hello(), 256), ("sequence", 256, "0 to 255")),
        (lambda: encode(Hello(), -1), ("sequence", -1, "0 to 255")),
        (lambda: SetPulses((0, 65536, 0)), ("pulse", "servo_1", 65536, "0 to 65535")),
        (lambda: SetPulses(()), ("0 pulses", "1 to 10")),
        (lambda: SetPulses((0,) * 11), ("11 pulses", "1 to 10")),
        (lambda: Error(ErrorCode.TYPE, 256, 0), ("type", 256, "0 to 255")),
        (lambda: ImuLine("a\n"), ("IMU line", "'a\\n'", "ASCII", "32 characters")),
        (lambda: ImuLine("a" * 33), ("IMU line", f"{'a' * 33!r}", "ASCII", "32 characters")),
    ],
)
def test_what_cannot_be_sent_is_refused_by_value(make, named: tuple[object, ...]) -> None:
    with raises_naming(ProtocolError, *named):
        make()
