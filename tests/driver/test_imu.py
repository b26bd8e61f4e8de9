"""IMU lines: two numbers of degrees and nothing else are a reading."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.messages import assert_names
from tripod_driver.calibration import Calibration
from tripod_driver.framed import encode
from tripod_driver.framed_messages import ImuLine
from tripod_driver.framed_session import FramedSession
from tripod_driver.imu import LONGEST_LINE, ImuReading, LineReader, parse_line
from tripod_driver.protocol import AsciiProtocol, LegacyProtocol, ProtocolError
from tripod_driver.session import READINGS_MAX, LegacySession, SessionState


@pytest.mark.parametrize(
    ("line", "degrees"),
    [
        (b"-1.5000,30.0000,", (-1.5, 30.0)),
        (b"-1.5,30,\r", (-1.5, 30.0)),
        (b" 0 , -0 ", (0.0, 0.0)),
        (b"+360,-360,", (360.0, -360.0)),
    ],
)
def test_two_numbers_of_degrees_are_a_reading(line: bytes, degrees: tuple[float, float]) -> None:
    reading = parse_line(line, 7.0)
    assert reading == ImuReading(math.radians(degrees[0]), math.radians(degrees[1]), 7.0)


@pytest.mark.parametrize(
    "line",
    [b"", b"1", b"1,2,3", b"1,2,3,", b"nan,1,", b"inf,1,", b"1e1,1,", b"1_0,2,", b"361,0,", b"0x1,2,", b"1 2,3,",
     b"bno begin success", b"\xff\xfe,1,", "\uff11,2,".encode(), b",,", b"--1,2,", b"1," + b"0" * LONGEST_LINE],
)  # fmt: skip
def test_anything_else_is_none(line: bytes) -> None:
    assert parse_line(line, 0.0) is None


@given(st.binary(max_size=300), st.lists(st.integers(0, 40), max_size=30))
def test_a_stream_of_anything_gives_readings_within_range_and_bounded_memory(
    data: bytes, cuts: list[int]
) -> None:
    reader, at = LineReader(), 0
    for cut in [*cuts, len(data)]:
        for reading in reader.feed(data[at : at + cut], 0.0):
            assert max(abs(reading.roll), abs(reading.pitch)) <= 2 * math.pi
        at += cut
        assert len(reader._partial) <= LONGEST_LINE


def test_a_line_may_come_in_pieces_between_garbage() -> None:
    reader = LineReader()
    stream = b"bno begin success\r\n1.0,2.0,\r\n" + b"x" * 200 + b"\n3.0,4.0,\n5.0"
    found = [r for byte in stream for r in reader.feed(bytes([byte]), 0.0)]
    assert [(round(math.degrees(r.roll)), round(math.degrees(r.pitch))) for r in found] == [(1, 2), (3, 4)]
    assert (reader.good, reader.bad, reader.strange) == (2, 2, b"")


@given(st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi))
def test_the_quaternion_rolls_about_x_and_then_pitches_about_y(roll: float, pitch: float) -> None:
    x, y, z, w = ImuReading(roll, pitch, 0.0).quaternion
    assert x * x + y * y + z * z + w * w == pytest.approx(1.0) and w >= 0
    v, q = np.array([0.3, -0.5, 0.8]), np.array([x, y, z])
    turned = v + 2 * np.cross(q, np.cross(q, v) + w * v)
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    assert turned == pytest.approx(about_y @ about_x @ v, abs=1e-12)


def test_ascii_packets_are_what_the_workshop_writes() -> None:
    protocol = AsciiProtocol()
    assert protocol.encode([0.0, -math.pi / 2, -2.0]) == b"180 90 65\n"
    assert protocol.decode(b"180 90 65\n") == pytest.approx((0.0, -math.pi / 2, math.radians(-115)))
    for bad in (b"180 90\n", b"180 90 65", b"180  90 65\n", b"+80 90 65\n", b"999 90 65\n", b"180 90 59\n"):
        with pytest.raises(ProtocolError):
            protocol.decode(bad)


def test_readings_of_either_protocol_are_kept_the_newest_last_and_few() -> None:
    sessions = [LegacySession(AsciiProtocol(), Calibration()), FramedSession(Calibration())]
    for session in sessions:
        session.begin(0.0, 0.0)
        for k in range(40):
            line = f"{k}.0,1.0,"
            framed = isinstance(session, FramedSession)
            session.hear(encode(ImuLine(line), k) if framed else line.encode() + b"\r\n", 0.1 * k)
        assert [round(math.degrees(r.roll)) for r in session.readings] == list(range(40 - READINGS_MAX, 40))
        assert session.readings[-1].time == pytest.approx(3.9)


def test_a_board_that_passes_its_imu_on_beside_the_workshops_packets_is_heard() -> None:
    session = LegacySession(LegacyProtocol(), Calibration())
    session.begin(0.0, 0.0)
    session.hear(b"\xff\x00\n" + b"1.0,2.0,\n" * 5 + b"crackle\n" + b"3.0,2.0,\n", 0.0)
    session.say(0.0)
    assert session.state is SessionState.READY
    assert math.degrees(session.readings[-1].roll) == pytest.approx(3.0)
    session.hear(b"no\nimu\nat all\n", 0.0)
    assert session.state is SessionState.LOST


def test_an_imu_that_stutters_is_forgiven_one_that_only_babbles_is_not() -> None:
    session = LegacySession(AsciiProtocol(), Calibration())
    session.begin(0.0, 0.0)
    session.say(0.0)
    for _ in range(100):
        session.hear(b"1.0,2.0,\r\n" + b"oops\r\n" * 5, 1.0)
    assert session.state is SessionState.READY
    assert session.diagnostics == {"IMU lines": 100, "bad lines": 500}
    session.hear(b"oops\r\n" * 30, 1.0)
    assert session.state is SessionState.LOST
    assert_names(session.message, "'oops\\r'", "not an IMU", "baud rate and protocol")
