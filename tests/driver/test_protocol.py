"""Bytes of the legacy protocol, against tables worked out by hand."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.messages import raises_naming
from tripod_driver.protocol import (
    BYTE_MAX,
    BYTE_MIN,
    RESOLUTION,
    WORKSHOP,
    AngleMapping,
    LegacyDecoder,
    LegacyProtocol,
    ProtocolError,
)

ROUNDED, TUTORIAL = LegacyProtocol(AngleMapping.ROUNDED), LegacyProtocol(AngleMapping.TUTORIAL)
EPSILON = 1e-12  # [rad], what conversion to degrees and back loses
angles = st.tuples(*[st.floats(ROUNDED.lowest, ROUNDED.highest)] * 3)


@pytest.mark.parametrize(
    ("degrees", "rounded", "tutorial"),
    [  # rounded: nearest integer + 180; tutorial: floor + 179; both within 60..180
        (0.0, 180, 179),
        (0.4, 180, 179),
        (1.5, 180, 180),
        (2.5, 180, 180),
        (90.0, 180, 180),
        (-0.4, 180, 178),
        (-0.6, 179, 178),
        (-29.5001, 150, 149),
        (-29.4999, 151, 149),
        (-30.0, 150, 149),  # math.degrees(math.radians(-30)) is a little above -30
        (-45.0, 135, 134),
        (-85.743, 94, 93),  # the working pose
        (-90.0, 90, 89),
        (-118.7, 61, 60),
        (-120.0, 60, 60),
        (-150.0, 60, 60),
    ],
)
def test_bytes_match_the_table_worked_out_by_hand(degrees: float, rounded: int, tutorial: int) -> None:
    angle = math.radians(degrees)
    assert ROUNDED.encode([angle, 0.0, 0.0]) == bytes([255, rounded, 180, 180])
    assert TUTORIAL.encode([0.0, 0.0, angle]) == bytes([255, 179, 179, tutorial])


def test_servos_keep_their_order() -> None:
    assert ROUNDED.encode([math.radians(d) for d in (-10, -20, -30)]) == bytes([255, 170, 160, 150])
    assert ROUNDED.decode(bytes([255, 170, 160, 150])) == pytest.approx(
        [math.radians(d) for d in (-10, -20, -30)]
    )


EVERY = [protocol(mapping) for protocol in WORKSHOP.values() for mapping in AngleMapping]


@pytest.mark.parametrize("protocol", EVERY, ids=lambda p: f"{p.name}-{p.mapping}")
def test_every_byte_survives_decoding_and_encoding(protocol: LegacyProtocol) -> None:
    packets = set()
    for byte in range(BYTE_MIN, BYTE_MAX + 1):
        packet = protocol.packet([byte, BYTE_MAX + BYTE_MIN - byte, 150])
        assert protocol.encode(protocol.decode(packet)) == packet
        packets.add(packet)
    assert len(packets) == BYTE_MAX - BYTE_MIN + 1


@given(st.sampled_from(EVERY), st.tuples(*[st.floats(0.0, 1.0)] * 3))
def test_every_angle_in_range_survives_within_the_resolution(protocol: LegacyProtocol, fractions) -> None:
    wanted = [protocol.lowest + f * (protocol.highest - protocol.lowest) for f in fractions]
    for angle, decoded in zip(wanted, protocol.decode(protocol.encode(wanted)), strict=True):
        assert abs(angle - decoded) <= RESOLUTION + EPSILON


def test_ranges_are_those_of_the_bytes() -> None:
    assert (ROUNDED.lowest, ROUNDED.highest) == pytest.approx((math.radians(-120.5), math.radians(0.5)))
    assert (TUTORIAL.lowest, TUTORIAL.highest) == pytest.approx((math.radians(-119), math.radians(2)))


@pytest.mark.parametrize(
    ("given_angles", "named"),
    [
        ([0.0, math.nan, 0.0], ("servo_1", "nan", "finite")),
        ([0.0, 0.0, -math.inf], ("servo_2", "-inf", "finite")),
        ([0.0, 0.0], ("2 angles", 3)),
        ([0.0] * 4, ("4 angles", 3)),
    ],
)
def test_encode_refuses_by_value(given_angles: list[float], named: tuple[object, ...]) -> None:
    with raises_naming(ProtocolError, *named):
        ROUNDED.encode(given_angles)


@pytest.mark.parametrize(
    ("packet", "named"),
    [
        ([255, 59, 150, 150], ("servo_0", 59, "60 to 180")),
        ([255, 150, 150, 181], ("servo_2", 181, "60 to 180")),
        ([255, 150, 255, 150], ("servo_1", 255, "60 to 180")),
        ([254, 150, 150, 150], (254, 255)),
        ([255, 150, 150], ("3 bytes", 4)),
        ([], ("0 bytes", 4)),
    ],
)
def test_decode_refuses_by_value(packet: list[int], named: tuple[object, ...]) -> None:
    with raises_naming(ProtocolError, *named):
        ROUNDED.decode(bytes(packet))


def test_decoder_finds_packets_between_the_garbage_worked_out_by_hand() -> None:
    decoder = LegacyDecoder()
    stream = [
        7,
        150,
        255,
        60,
        61,
        62,
        99,
        255,
        100,
        255,
        255,
        63,
        64,
        65,
        255,
        70,
        0,
        71,
        72,
        255,
        80,
        81,
        82,
    ]
    found = decoder.feed(bytes(stream))
    assert [list(ROUNDED.encode(a)[1:]) for a in found] == [[60, 61, 62], [63, 64, 65], [80, 81, 82]]
    assert decoder.skipped == len(stream) - 3 * 4


garbage = st.binary(max_size=6).map(lambda data: data.replace(b"\xff", b"\x00"))


@given(st.lists(st.tuples(garbage, angles), max_size=20), garbage, st.randoms(use_true_random=False))
def test_decoder_finds_every_packet_however_the_stream_is_cut(parts, tail: bytes, random) -> None:
    stream = b"".join(noise + ROUNDED.encode(a) for noise, a in parts) + tail
    decoder, found = LegacyDecoder(), []
    while stream:
        cut = random.randint(1, 7)
        found += decoder.feed(stream[:cut])
        stream = stream[cut:]
    assert [ROUNDED.encode(a) for a in found] == [ROUNDED.encode(a) for _, a in parts]
    assert decoder.skipped == sum(len(noise) for noise, _ in parts) + len(tail)


@given(st.binary(max_size=200), angles)
def test_decoder_survives_any_bytes_and_recovers_within_one_packet(noise: bytes, wanted) -> None:
    decoder = LegacyDecoder()
    for found in decoder.feed(noise):
        assert all(ROUNDED.lowest <= a <= ROUNDED.highest for a in found)
    packet = ROUNDED.encode(wanted)
    assert decoder.feed(packet + packet)[-2:] == [ROUNDED.decode(packet)] * 2
