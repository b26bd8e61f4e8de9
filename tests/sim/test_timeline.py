"""Timelines on one line: what they say at any time, and what is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.messages import assert_names, raises_naming
from tripod_sim.errors import SceneError
from tripod_sim.tables import timeline
from tripod_sim.tables.timeline import Timeline, parse_slide, parse_timeline


def refusal(text: str, width: int = 3) -> str:
    with pytest.raises(SceneError) as caught:
        parse_timeline(text, width, "--servo", "rad")
    message = str(caught.value)
    assert message.startswith("--servo")
    assert message.isprintable()
    assert len(message) < 300
    return message


@pytest.mark.parametrize(
    ("text", "times", "values"),
    [
        ("0:0,0,0; 1:-0.7854,-0.7854,-0.7854", [0, 1], [[0, 0, 0], [-0.7854, -0.7854, -0.7854]]),
        ("0:1,2,3", [0], [[1, 2, 3]]),
        ("0.5:1,2,3;", [0.5], [[1, 2, 3]]),
        (" 0 : 1 , 2 ,3 ;; 1e-3:+1,-2e0,.5 ", [0, 0.001], [[1, 2, 3], [1, -2, 0.5]]),
        ("0: 180deg, -9e1 deg,1", [0], [[np.pi, -np.pi / 2, 1]]),
    ],
)
def test_text_is_read_as_times_and_values(text: str, times: list, values: list) -> None:
    line = parse_timeline(text, 3, "--servo", "rad")
    assert line.times.tolist() == times
    assert line.values.tolist() == values


@pytest.mark.parametrize(
    ("time", "values"),
    [(0, [1, 0]), (0.5, [1, 0]), (1, [1, 0]), (1.25, [0.5, 1]), (2, [-1, 4]), (2.5, [-1, 2]), (9, [-1, 0])],
)  # fmt: skip
def test_values_are_held_before_and_after_and_linear_between(time: float, values: list[float]) -> None:
    line = parse_timeline("1: 1,0; 2: -1,4; 3: -1,0", 2, "--servo", "rad")
    assert line.at(time).tolist() == values


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", ("0 entries", "1 to 100000", "'time: value, ...'")),
        (" ; ;", ("0 entries",)),
        ("-85", ("'-85'", "'time: value, ...'", "3 finite values", "'0: -85deg, -85deg, -85deg'")),
        ("1, 2, 3", ("'1, 2, 3'", "'time: value, ...'", "3 finite values", "'0: 1, 2, 3'")),
        ("0:", ("'0:'",)),
        ("0:1,2", ("'0:1,2'", "'time: value, ...'", "3 finite values")),
        ("0:1,2,3,4", ("'0:1,2,3,4'",)),
        ("0:1,2,", ("'0:1,2,'",)),
        ("0:1,2,x", ("'0:1,2,x'", "3 finite values", "'x'", "no number in rad", "(rad, deg)")),
        ("0:1,2,deg", ("'0:1,2,deg'",)),
        ("0:1,2,3mm", ("'0:1,2,3mm'",)),
        ("0:1,2,3degdeg", ("'0:1,2,3degdeg'",)),
        ("-85deg", ("'-85deg'", "'time: value, ...'", "3 finite values", "'0: -85deg, -85deg, -85deg'")),
        ("0:1:2,3,4", ("'0:1:2,3,4'",)),
        ("x:1,2,3", ("'x:1,2,3'",)),
        (":1,2,3", ("':1,2,3'",)),
        ("0:1,2,3; 1:1,nan,3", ("'1:1,nan,3'",)),
        ("0:1,2,3; 1:1,-inf,3", ("'1:1,-inf,3'",)),
        ("0:1,2,1e999", ("'0:1,2,1e999'",)),
        ("nan:1,2,3", ("'nan:1,2,3'",)),
        ("0:1,2,3; inf:1,2,3", ("'inf:1,2,3'",)),
        ("0:1,2,3; x", ("'x'",)),
        ("-1:1,2,3", ("times -1 s", "must increase", "from 0")),
        ("0:1,2,3; 0:1,2,3", ("times 0, 0 s", "must increase")),
        ("0:1,2,3; 2:1,2,3; 1:1,2,3", ("times 0, 2, 1 s", "must increase")),
        ("0:1,2,3\n1:1,2,3", (r"'0:1,2,3\n1:1,2,3'",)),
        ("0:" + "1" * 9999, ("--servo: '0:", "3 finite values")),
    ],
)  # fmt: skip
def test_anything_else_is_refused_with_the_part_that_is_wrong(text: str, named: tuple[str, ...]) -> None:
    assert_names(refusal(text), *named)


def test_a_timeline_with_too_many_entries_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timeline, "MOST_KEYS", 3)
    assert len(parse_timeline("0:1;1:1;2:1", 1, "--servo", "rad").times) == 3
    assert_names(refusal("0:1;1:1;2:1;3:1", 1), "4 entries", "1 to 3")


NUMBERS = st.floats(-1e300, 1e300)


@given(st.lists(st.floats(0, 1e300), min_size=1, max_size=6, unique=True).map(sorted), st.data())
def test_what_is_written_is_read_back_exactly_and_never_overshot(times: list[float], data) -> None:
    values = data.draw(st.lists(st.tuples(NUMBERS, NUMBERS), min_size=len(times), max_size=len(times)))
    text = "; ".join(f"{t!r}: {a!r}, {b!r}" for t, (a, b) in zip(times, values, strict=True))
    line = parse_timeline(text, 2, "--servo", "rad")
    for t, value in zip(times, values, strict=True):
        assert tuple(line.at(t)) == value
    between = line.at(data.draw(st.floats(0, 1e300)))
    low, high = np.min(values, axis=0), np.max(values, axis=0)
    room = 1e-12 * np.maximum(abs(low), abs(high))
    assert ((low - room <= between) & (between <= high + room)).all()


@given(st.text("0123456789.,:;- einfax\x00", max_size=20), st.integers(1, 3))
def test_any_text_is_read_or_refused(text: str, width: int) -> None:
    try:
        line = parse_timeline(text, width, "--servo", "rad")
    except SceneError as error:
        assert str(error).isprintable()
    else:
        assert line.values.shape == (len(line.times), width)
        assert np.isfinite(line.values).all()
        assert (np.diff(line.times) > 0).all()
        assert line.times[0] >= 0


SERVO = parse_timeline("0.5:0,0,0; 1:-1,-1,-1; 2.5:-1,-1,-1", 3, "--servo", "rad")


def at(line: Timeline, *times: float) -> list[float]:
    assert line.values.shape[1] == 1
    return [float(line.at(t)[0]) for t in times]


def test_one_number_slides_in_proportion_with_the_servo_timeline() -> None:
    """From 0 at its first time to the number at its last: 35 mm at once would crush the flat piece."""
    line = parse_slide("0.035", SERVO)
    assert at(line, 0, 0.5, 1, 1.5, 2.5, 9) == pytest.approx(
        [0, 0, 0.035 / 4, 0.035 / 2, 0.035, 0.035], abs=1e-17
    )


@pytest.mark.parametrize("servo", [None, parse_timeline("0:-1,-1,-1", 3, "--servo", "rad")])
def test_one_number_without_a_motion_of_the_servos_holds_from_the_start(servo: Timeline | None) -> None:
    for text in (" 0.02 ", "20mm", " 20 mm"):
        assert at(parse_slide(text, servo), 0, 1, 100) == [0.02, 0.02, 0.02]


@pytest.mark.parametrize("servo", [None, SERVO])
def test_a_slide_timeline_is_taken_as_it_is(servo: Timeline | None) -> None:
    assert at(parse_slide("1:0.01; 2:0.03", servo), 0, 1, 1.5, 3) == pytest.approx([0.01, 0.01, 0.02, 0.03])


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", ("''", "number", "m", "mm", "cm", "'time: value; ...'")),
        ("nan", ("'nan'",)),
        ("inf", ("'inf'",)),
        ("35 ft", ("'35 ft'",)),
        ("0.01; 0.02", ("'0.01; 0.02'",)),
        ("0:0.01,0.02", ("'0:0.01,0.02'", "'time: value, ...'", "1 finite value")),
        ("1:0; 0:0.03", ("times 1, 0 s", "must increase")),
        ("9" * 9999 + "x", ("number", "'time: value; ...'")),
    ],
)
def test_a_bad_slide_is_refused(text: str, named: tuple[str, ...]) -> None:
    with raises_naming(SceneError, "--slide", *named) as caught:
        parse_slide(text, SERVO)
    assert len(str(caught.value)) < 300
