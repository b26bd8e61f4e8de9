"""Timelines on one line: what they say at any time, and what is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tripod_sim import timeline
from tripod_sim.errors import SceneError
from tripod_sim.timeline import Timeline, parse_slide, parse_timeline


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
    ("text", "message"),
    [
        ("", "--servo has 0 entries; allowed is 1 to 100000"),
        (" ; ;", "--servo has 0 entries"),
        (
            "-85",
            "--servo: '-85' is not 'time: value, ...' with 3 finite values; from the start on: '0: -85, -85, -85'",
        ),
        (
            "1, 2, 3",
            "--servo: '1, 2, 3' is not 'time: value, ...' with 3 finite values; from the start on: '0: 1, 2, 3'",
        ),
        ("0:", "--servo: '0:' is not"),
        ("0:1,2", "--servo: '0:1,2' is not 'time: value, ...' with 3 finite values"),
        ("0:1,2,3,4", "--servo: '0:1,2,3,4' is not"),
        ("0:1,2,", "--servo: '0:1,2,' is not"),
        (
            "0:1,2,x",
            "with 3 finite values; 'x' is no number in rad, nor with its unit (rad, deg)",
        ),
        ("0:1,2,deg", "--servo: '0:1,2,deg' is not"),
        ("0:1,2,3mm", "--servo: '0:1,2,3mm' is not"),
        ("0:1,2,3degdeg", "--servo: '0:1,2,3degdeg' is not"),
        (
            "-85deg",
            "is not 'time: value, ...' with 3 finite values; from the start on: '0: -85deg, -85deg, -85deg'",
        ),
        ("0:1:2,3,4", "--servo: '0:1:2,3,4' is not"),
        ("x:1,2,3", "--servo: 'x:1,2,3' is not"),
        (":1,2,3", "--servo: ':1,2,3' is not"),
        ("0:1,2,3; 1:1,nan,3", "--servo: '1:1,nan,3' is not"),
        ("0:1,2,3; 1:1,-inf,3", "--servo: '1:1,-inf,3' is not"),
        ("0:1,2,1e999", "--servo: '0:1,2,1e999' is not"),
        ("nan:1,2,3", "--servo: 'nan:1,2,3' is not"),
        ("0:1,2,3; inf:1,2,3", "--servo: 'inf:1,2,3' is not"),
        ("0:1,2,3; x", "--servo: 'x' is not"),
        ("-1:1,2,3", "--servo: times -1 s must rise, from 0 or later"),
        ("0:1,2,3; 0:1,2,3", "--servo: times 0, 0 s must rise"),
        ("0:1,2,3; 2:1,2,3; 1:1,2,3", "--servo: times 0, 2, 1 s must rise"),
        ("0:1,2,3\n1:1,2,3", r"--servo: '0:1,2,3\n1:1,2,3' is not"),
        ("0:" + "1" * 9999, "--servo: '0:111"),
    ],
)  # fmt: skip
def test_anything_else_is_refused_with_the_part_that_is_wrong(text: str, message: str) -> None:
    assert message in refusal(text)


def test_a_timeline_with_too_many_entries_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timeline, "MOST_KEYS", 3)
    assert len(parse_timeline("0:1;1:1;2:1", 1, "--servo", "rad").times) == 3
    assert "--servo has 4 entries; allowed is 1 to 3" in refusal("0:1;1:1;2:1;3:1", 1)


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
    ("text", "message"),
    [
        ("", "--slide '' is neither a number in m or mm or cm nor 'time: value; ...'"),
        ("nan", "--slide 'nan' is neither"),
        ("inf", "--slide 'inf' is neither"),
        ("35 ft", "--slide '35 ft' is neither"),
        ("0.01; 0.02", "--slide '0.01; 0.02' is neither"),
        ("0:0.01,0.02", "--slide: '0:0.01,0.02' is not 'time: value, ...' with 1 finite values"),
        ("1:0; 0:0.03", "--slide: times 1, 0 s must rise"),
        ("9" * 9999 + "x", "--slide '999"),
    ],
)
def test_a_bad_slide_is_refused(text: str, message: str) -> None:
    with pytest.raises(SceneError) as caught:
        parse_slide(text, SERVO)
    assert message in str(caught.value)
    assert len(str(caught.value)) < 300
