"""Segments of a recording: where the simulator was restarted, killed, or got another scene by hand."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from tests.messages import assert_names, raises_naming
from tests.record.bags import START, Foreign, cdr_string, write_foreign
from tripod_graph import names
from tripod_record.bag import Bag
from tripod_record.errors import RecordError
from tripod_record.segments import (
    Segment,
    chosen_segment,
    log_times,
    read_segments,
    segment_lines,
    simulators,
)

STORE = get_typestore(Stores.ROS2_JAZZY)
ARRAY = "std_msgs/msg/Float64MultiArray"

Row = tuple[int, int, int]
"""Number of resets, first and last step."""


def commands(rows: Sequence[Row], time: float, *, columns: int = 5) -> bytes:
    """Return a message of commands whose steps end at `time` [s]."""
    T = STORE.types
    table = np.zeros((len(rows), columns))
    table[:, :3], table[:, 3] = np.reshape(rows, (len(rows), 3)), START + 1e9 * time
    dim = [T["std_msgs/msg/MultiArrayDimension"](label="", size=n, stride=0) for n in table.shape]
    layout = T["std_msgs/msg/MultiArrayLayout"](dim=dim, data_offset=0)
    return bytes(STORE.serialize_cdr(T[ARRAY](layout=layout, data=table.ravel()), ARRAY))


@pytest.fixture
def segments(tmp_path: Path) -> Callable[..., list[Segment]]:
    """Return what finds the segments of scenes and commands, (place [s], text) and (place [s], rows)."""

    def find(
        scenes: Sequence[tuple[float, str]], given: Sequence[tuple[float, Sequence[Row]]]
    ) -> list[Segment]:
        text = STORE.generate_msgdef(ARRAY, ros_version=2)[0]
        file = write_foreign(
            tmp_path / "a.mcap",
            Foreign(f"/{names.SCENE}", "std_msgs/msg/String", [(t, cdr_string(s)) for t, s in scenes]),
            Foreign(f"/{names.COMMANDS}", ARRAY, [(t, commands(rows, t)) for t, rows in given], text),
        )
        bag = Bag(file)
        assert simulators(bag) == ["/"]
        return read_segments(bag, "/")

    return find


def test_a_session_with_resets_is_one_segment(segments: Callable[..., list[Segment]]) -> None:
    found = segments([(0.0, "A")], [(0.5, [(0, 1, 10)]), (1.0, [(0, 11, 12), (1, 1, 5)]), (1.5, [(1, 6, 6)])])
    (one,) = found
    assert (one.scene, one.first, one.last, one.steps) == ("A", 0, 2, 18)
    assert (one.start - START, one.end - START) == (5 * 10**8, 15 * 10**8)
    assert one.stamps == (-np.inf, np.inf)


def test_a_killed_simulator_that_was_started_again_makes_two_also_of_the_same_scene(
    segments: Callable[..., list[Segment]],
) -> None:
    first, second = segments(
        [(0.0, "A"), (2.0, "A")], [(0.5, [(0, 1, 10)]), (1.0, [(0, 11, 20)]), (2.5, [(0, 1, 10)])]
    )
    assert (first.scene, first.first, first.last) == ("A", 0, 1)
    assert (second.scene, second.first, second.last) == ("A", 2, 2)
    assert second.stamps[0] == first.stamps[1]
    assert first.stamps == (-np.inf, pytest.approx(START + 1e9))


def test_one_is_chosen_by_its_number_else_the_longest(
    segments: Callable[..., list[Segment]], tmp_path: Path
) -> None:
    found = segments([(0.0, "A")], [(0.5, [(0, 1, 10)]), (1.0, [(0, 1, 20)]), (2.5, [(0, 1, 15)])])
    bag = Bag(tmp_path / "a.mcap")
    assert [chosen_segment(bag, found, n).number for n in (None, 1, 3)] == [2, 1, 3]
    for number in (0, 4):
        with raises_naming(RecordError, tmp_path / "a.mcap", f"segment {number}", 3, "tripod bag info"):
            chosen_segment(bag, found, number)
    assert log_times(found, 1) == (-np.inf, START + 5 * 10**8 + 1)
    assert log_times(found, 2) == (START + 5 * 10**8 + 1, START + 10**9 + 1)
    assert log_times(found, 3) == (START + 10**9 + 1, np.inf)


def test_a_scene_that_is_received_after_its_first_commands_is_theirs(
    segments: Callable[..., list[Segment]],
) -> None:
    first, second = segments(
        [(0.0, "A"), (2.6, "B")],
        [(0.5, [(0, 1, 9)]), (2.5, [(0, 1, 2)]), (2.55, [(0, 3, 4)]), (2.7, [(0, 5, 99)])],
    )
    assert (first.scene, second.scene) == ("A", "B")
    assert (second.first, second.last, second.steps) == (1, 3, 99)


def test_another_scene_without_a_restart_begins_a_segment_and_one_without_commands_makes_none(
    segments: Callable[..., list[Segment]],
) -> None:
    found = segments(
        [(0.0, "A"), (5.0, "B"), (9.0, "C"), (20.0, "D")],
        [(1.0, [(0, 1, 9)]), (5.5, [(1, 10, 20)]), (6.0, [(1, 21, 22)]), (12.0, [(2, 23, 24)])],
    )
    assert [one.scene for one in found] == ["A", "B", "C"]
    assert [one.number for one in found] == [1, 2, 3]


def test_a_recording_that_begins_late_has_the_scene_that_it_received_first(
    segments: Callable[..., list[Segment]],
) -> None:
    (one,) = segments([(3.0, "A")], [(0.0, [(4, 100, 110)]), (1.0, [(4, 111, 111)])])
    assert (one.scene, one.steps) == ("A", 12)


def test_lines_tell_place_steps_and_what_changed(
    segments: Callable[..., list[Segment]], tmp_path: Path
) -> None:
    a = 'name = "plate"\ndt = 0.01\n[mesh]\nlevel = 1\n'
    found = segments(
        [(0.0, a), (2.0, a.replace("level = 1", "level = 3"))], [(0.0, [(0, 1, 9)]), (2.5, [(0, 1, 4)])]
    )
    first, second = segment_lines(Bag(tmp_path / "a.mcap"), found)
    assert_names(first, "segment 1", "0.00 to 0.00 s", "9 steps", "plate")
    assert "level" not in first
    assert_names(second, "segment 2", "2.50 to 2.50 s", "4 steps", "plate", "mesh.level = 3")
    assert "dt" not in second


def test_what_is_no_commands_is_refused(tmp_path: Path) -> None:
    text = STORE.generate_msgdef(ARRAY, ros_version=2)[0]
    file = write_foreign(
        tmp_path / "a.mcap",
        Foreign(f"/{names.SCENE}", "std_msgs/msg/String", [(0.0, cdr_string("A"))]),
        Foreign(f"/{names.COMMANDS}", ARRAY, [(0.0, commands([(0, 1, 2)], 0.0, columns=4)[:-8])], text),
    )
    with raises_naming(RecordError, f"/{names.COMMANDS}"):
        read_segments(Bag(file), "/")
