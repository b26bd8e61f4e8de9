"""The framed conversation against anything that may come: it never fails, and only an answer makes it ready."""

from hypothesis import given
from hypothesis import strategies as st

from tests.driver.bench import hello_reply
from tests.messages import assert_names
from tripod_driver.calibration import Calibration
from tripod_driver.framed import Decoder, encode
from tripod_driver.framed_messages import (
    Acknowledgement,
    BoardState,
    Error,
    ErrorCode,
    Flags,
    Hello,
    HelloReply,
    Hold,
    ImuLine,
    Release,
    ResetCause,
    SetPulses,
)
from tripod_driver.framed_session import SILENCE, FramedSession
from tripod_driver.session import READINGS_MAX, SessionState

byte, word = st.integers(0, 255), st.integers(0, 65535)
pulses = st.tuples(word, word, word)
flags = st.integers(0, 15).map(Flags)
causes = byte.map(ResetCause)
state = st.sampled_from(BoardState)
message = st.one_of(
    st.just(Hello()),
    st.just(Hold()),
    st.just(Release()),
    st.builds(SetPulses, pulses),
    st.builds(
        HelloReply, st.tuples(byte, byte), byte, byte, word, word, word, word, causes, state, flags, pulses
    ),
    st.builds(Acknowledgement, state, flags, pulses, word),
    st.builds(Error, st.sampled_from(ErrorCode), byte, word),
    st.builds(ImuLine, st.from_regex(r"[-0-9.,a-z ]{0,32}", fullmatch=True)),
)
piece = st.one_of(st.binary(max_size=60), st.builds(encode, message, byte))
GOOD = hello_reply(firmware=(1, 2))


def asked(session: FramedSession, now: float) -> int:
    """Return the sequence of the hello that is due."""
    (frame,) = Decoder().feed(session.say(now))
    assert frame.message == Hello()
    return frame.sequence


@given(st.lists(st.tuples(piece, st.floats(0.0, 0.2), st.booleans()), max_size=30))
def test_whatever_comes_it_goes_on_or_says_why_not(pieces) -> None:
    session = FramedSession(Calibration())
    session.begin(0.0, 0.5)
    now = 0.0
    for data, pause, sends in pieces:
        now += pause
        session.hear(data, now)
        session.say(now)
        if sends and session.state is SessionState.READY:
            session.packet(session.content([-0.5] * 3), now)
        assert bool(session.message) == (session.state is not SessionState.READY)
        assert "\n" not in session.message and len(session.message) < 300
        assert len(session.readings) <= READINGS_MAX


@given(st.lists(piece, max_size=10), byte)
def test_only_the_answer_to_its_own_hello_makes_it_ready(pieces, sequence: int) -> None:
    session = FramedSession(Calibration())
    session.begin(0.0, 0.5)
    own = asked(session, 0.0)
    for data in (encode(GOOD, sequence), *pieces):
        session.hear(b"\0" + data, 0.01)
    if sequence != own and session.state is SessionState.READY:
        frames = [frame for data in pieces for frame in Decoder().feed(data)]
        assert any(frame.sequence == own for frame in frames)
    again = FramedSession(Calibration())
    again.begin(0.0, 0.5)
    again.hear(encode(GOOD, asked(again, 0.0)), 0.004)
    assert (again.state, again.firmware, again.place) == (SessionState.READY, "1.2", None)
    assert again.round_trip == 0.004


def test_a_board_that_is_told_nothing_is_greeted_and_missed_when_it_is_gone() -> None:
    session = FramedSession(Calibration())
    session.begin(0.0, 0.0)
    session.hear(encode(GOOD, asked(session, 0.0)), 0.01)
    assert session.say(0.5) == b""
    sequence = asked(session, 1.1)
    session.hear(encode(GOOD, sequence), 1.11)
    assert session.state is SessionState.READY
    asked(session, 2.2)
    assert session.say(2.2 + SILENCE + 0.01) == b""
    assert session.state is SessionState.LOST
    assert_names(session.message, "acknowledgement", "0.3 s", "cable", "power")


def test_answers_to_hellos_that_waited_are_no_other_writer_and_their_numbers_can_be_used_again() -> None:
    session, now = FramedSession(Calibration()), 0.0
    session.begin(now, 2.0)
    hellos = []
    while len(hellos) < 8:  # the board sleeps, the line keeps them
        now += 0.1
        hellos.append(asked(session, now))
    for sequence in hellos[:4]:
        session.hear(encode(GOOD, sequence), now)
        assert session.state is SessionState.READY
    for _ in range(253):  # the last four answers were lost
        now += 0.02
        frame = session.packet(session.content([-0.5] * 3), now)
        (sent,) = Decoder().feed(frame)
        session.hear(encode(Acknowledgement(BoardState.ACTIVE, Flags(0), (9000,) * 3, 0), sent.sequence), now)
        assert session.settled and session.say(now) == b""
    now += 1.1
    sequence = asked(session, now)
    assert sequence in hellos[4:]
    session.hear(encode(GOOD, sequence), now)
    assert session.settled and session.state is SessionState.READY
