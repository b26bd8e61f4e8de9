"""What the demo says at its end, and what it refuses to say."""

from pathlib import Path

import pytest

from tests.messages import assert_names, line_naming, names
from tripod_bringup.demo_summary import (
    COARSER,
    NOT_MEASURED,
    SAMPLE,
    Measurements,
    RecordingFacts,
    Sample,
    Spread,
    conclusion,
    problems,
    summary_rows,
)

RECORDING = RecordingFacts(Path("recordings/one"), 2_500_000, 1234)


def sample(*values: float) -> Sample:
    taken = Sample()
    for value in values:
        taken.add(value)
    return taken


def full() -> Measurements:
    measured = Measurements(
        real_time_factor=sample(0.9, 1.0, 1.0),
        step_time_median=sample(0.5e-3, 0.7e-3, 0.6e-3),
        step_time_p99=sample(2e-3, 3e-3, 10e-3),
        ik_states={"TRACKING": 50},
        ik_solved=50,
        body_states=60,
        packets=300,
        packets_before=100,
        port="mock",
    )
    for error in (3e-4, 4e-4):
        measured.tracking.add(error)
    return measured


def test_every_figure_is_told_with_its_unit() -> None:
    rows = summary_rows(full(), RECORDING)
    table = "\n".join(": ".join(row) for row in rows)
    line_naming(table, "real-time factor", "median", "1.00x")
    line_naming(table, "step time", "median", "0.60 ms")
    line_naming(table, "step time", "p99", "3.00 ms")
    line_naming(table, "effector", "target", "largest", "0.400 mm")
    line_naming(table, "IK states", "tracking 50")
    line_naming(table, "packets", 300, "mock")
    line_naming(table, "recording: recordings/one", "2.5 MB", "1234 messages")
    error = line_naming(table, "effector", "target", "rms", "0.354 mm", "0.5 mm", "2 samples", "1 s")
    assert not names(error, "more")
    assert problems(full(), RECORDING) == []
    assert problems(full(), None) == []


def test_an_error_above_what_is_wanted_is_named_so() -> None:
    measured = full()
    measured.tracking.add(2e-3)
    table = "\n".join(": ".join(row) for row in summary_rows(measured, None))
    line_naming(table, "effector", "target", "rms", "more", "0.5 mm")


def test_a_chain_that_ran_shows_that_the_installation_works_also_where_it_was_slow() -> None:
    measured = full()
    assert_names(conclusion(measured), "installation works")
    assert not names(conclusion(measured), "busy")
    measured.tracking.add(2e-3)
    assert_names(conclusion(measured), "installation works", "busy")
    measured.real_time_factor = sample(0.4, 0.4)
    assert_names(conclusion(measured), "installation works", "0.40", COARSER)


def test_what_was_not_measured_is_no_number() -> None:
    rows = dict(summary_rows(Measurements(), None))
    figures = [name for name in rows if name not in ("recording", "body states received")]
    assert {rows[name] for name in figures} == {NOT_MEASURED}
    assert_names(rows["recording"], "none")


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"real_time_factor": Sample()}, ("status", "simulation")),
        ({"body_states": 0}, ("body states",)),
        ({"tracking": Spread()}, ("effector", "target")),
        ({"ik_solved": 0}, ("inverse kinematics",)),
        ({"packets": None}, ("packets", "servos")),
        ({"packets": 100}, ("packets", "servos")),
        ({"session_failure": "stopped while waiting"}, ("stopped while waiting",)),
    ],
)
def test_each_missing_part_of_the_chain_is_a_problem(
    change: dict[str, object], named: tuple[str, ...]
) -> None:
    measured = full()
    for name, value in change.items():
        setattr(measured, name, value)
    (problem,) = problems(measured, RECORDING)
    assert_names(problem, *named)


def test_of_a_session_that_broke_off_before_anything_was_measured_only_that_is_told() -> None:
    measured = Measurements(session_failure="stopped")
    assert problems(measured, RECORDING) == ["stopped"]
    torn = RecordingFacts(Path("x"), 10, None, "torn")
    assert problems(measured, torn) == ["stopped", "torn"]


def test_an_empty_or_torn_recording_is_a_problem() -> None:
    (empty,) = problems(full(), RecordingFacts(Path("x"), 10, 0))
    assert_names(empty, "nothing", "recorded")
    for messages in (None, 5):
        torn = RecordingFacts(Path("x"), 10, messages, "torn")
        assert problems(full(), torn) == ["torn"]
    table = "\n".join(": ".join(row) for row in summary_rows(full(), torn))
    line_naming(table, "recording", "5 messages", "not whole")


@pytest.mark.parametrize("count", [SAMPLE - 1, SAMPLE, 10 * SAMPLE + 7, 1_000_000])
def test_a_demo_of_days_keeps_a_sample_of_its_figures_that_has_their_median(count: int) -> None:
    taken = sample(*range(count))
    assert taken.count == count
    assert len(taken.values) < SAMPLE
    assert taken.values == [float(i) for i in range(0, count, taken.stride)]
    assert taken.median == pytest.approx((count - 1) / 2, abs=taken.stride)
