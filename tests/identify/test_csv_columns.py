"""What columns of measured data mean, and what is refused, each in one line that names the offender."""

from pathlib import Path

import numpy as np
import pytest

from tests.identify.robots import beam, tripod
from tests.messages import assert_names, raises_naming
from tripod_identify.csv_columns import Channel, read_header
from tripod_identify.errors import DataError
from tripod_identify.measured import read_csv
from tripod_identify.observe import parse_point
from tripod_sim.tables.joints import Actuator

SOURCES = ("effector", "imu", "tip")
PUMP = Actuator("pump", "m³", 0.0, 2e-6, 0.0)
PULL = Actuator("tip_x", "m", 0.0, 0.03, 0.0, pulls=True)
AIR = Actuator("air", "Pa", -1e4, 2e4, 0.0, is_effort=True)


def servos(count: int) -> tuple[Actuator, ...]:
    return tuple(Actuator(f"servo_{i}", "rad", -1.0, 1.0, 0.0) for i in range(count))


def test_units_and_names_are_read() -> None:
    header = [
        "t_ms",
        "servo_0_deg",
        "servo_1_rad",
        "slide_mm",
        "effector.x_cm",
        "marker.tip.z_m",
        "imu.rx_deg",
        "note_x_mm",
    ]
    found = read_header(header, SOURCES, servos(2), {})
    assert found.time == (0, 1e-3)
    assert found.commands == ((1, pytest.approx(np.pi / 180)), (2, 1.0))
    assert found.slide == (3, 1e-3)
    assert [(place, size, c) for place, size, c in found.channels] == [
        (4, 1e-2, Channel("effector", 0)),
        (5, 1.0, Channel("tip", 2)),
        (6, pytest.approx(np.pi / 180), Channel("effector", 0, angle=True)),
    ]
    assert found.ignored == ("note_x_mm",)


def test_renaming_makes_a_column_known() -> None:
    found = read_header(
        ["q0_rad", "measured_x_mm"], SOURCES, servos(1), {"q0": "servo_0", "measured": "effector"}
    )
    assert found.commands == ((0, 1.0),)
    assert found.channels[0][2] == Channel("effector", 0)


def test_commands_of_other_joints_are_columns_of_their_names() -> None:
    joints = (*servos(1), PULL, AIR, PUMP)
    header = ["pump_ml", "tip_x_mm", "air_kPa", "tip.x_mm", "servo_0_deg"]
    found = read_header(header, SOURCES, joints, {})
    assert found.commands == ((4, pytest.approx(np.pi / 180)), (1, 1e-3), (2, 1e3), (0, 1e-6))
    assert [c for *_, c in found.channels] == [Channel("tip", 0)]  # a set; the joint tip_x is commanded
    renamed = read_header(["p_bar", "tip.x_mm"], SOURCES, (AIR,), {"p": "air"})
    assert renamed.commands == ((0, 1e5),)


@pytest.mark.parametrize(
    ("header", "named"),
    [
        (["air_kPa", "tip.x_mm"], ("for air", "not for tip_x", "tip_x_mm")),
        (["tip_x_kPa", "air_kPa", "tip.x_mm"], ("'tip_x_kPa'", "pressure", "length: m, cm, mm")),
        (["tip_x_mm", "air_mm", "tip.x_mm"], ("'air_mm'", "length", "pressure: Pa, kPa, mbar, bar")),
        (["tip_x_mm", "tip_x_m", "air_kPa", "tip.x_mm"], ("'tip_x_m'", "another column")),
        (["tip_x_mm", "air_kPa", "servo_0_rad", "tip.x_mm"], ("servo_0", "0 servos")),
    ],
)
def test_a_wrong_header_of_other_joints_is_one_line(header: list[str], named: tuple[str, ...]) -> None:
    with raises_naming(DataError, *named) as error:
        read_header(header, SOURCES, (PULL, AIR), {})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("header", "count", "named"),
    [
        (["servo_0_rad", "effector.x"], 1, ("'effector.x'", "no unit", "effector.x_mm")),
        (["effector.x_rad"], 0, ("'effector.x_rad'", "angle", "length: m, cm, mm")),
        (["servo_0_mm", "effector.x_mm"], 1, ("'servo_0_mm'", "length", "angle")),
        (["effector.x_mm", "effector_x_m"], 0, ("'effector_x_m'", "another column")),
        (["servo_0_rad", "servo_1_rad", "effector.x_mm"], 3, ("servo_0, servo_1", "3 servos")),
        (["servo_1_rad", "effector.x_mm"], 1, ("servo_1", "1 servos")),
        (["t_s", "sofa_x_mm"], 0, ("effector, imu, tip", "sofa_x_mm", "--rename OLD=NEW")),
    ],
)
def test_a_wrong_header_is_one_line(header: list[str], count: int, named: tuple[str, ...]) -> None:
    with raises_naming(DataError, *named) as error:
        read_header(header, SOURCES, servos(count), {})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("t_s,tip.z_mm\n0,1\n0.1,2\n0.1,3\n", ("line 4", "0.1 s after 0.1 s", "--poses")),
        ("t_s,tip.z_mm\n0,1\n0.1\n", ("line 3", "1 cells", "header", 2)),
        ("t_s,tip.z_mm\n0,1\n0.1,wet\n", ("line 3", "'tip.z_mm'", "'wet'", "number")),
        ("t_s,tip.z_mm\n0,1\nnan,2\n", ("line 3", "time", "nan")),
        ("t_s,tip.z_mm\n0,inf\n", ("line 2", "tip.z", "inf m", "-1000 to 1000", "empty")),
        ("t_s,tip.z_mm\n0,1\n0.1,-1e300\n", ("line 3", "tip.z", "-1e+297 m", "-1000 to 1000")),
        ("tip.z_mm\nnan\n\n", ("all measured values", "missing")),
        ("tip.z_mm\n", ("d.csv", "1 lines", "header", "one row")),
        ("slide_mm,tip.z_mm\n1,2\n", ("servos", "scene 'beam'", "another robot")),
    ],
)
def test_wrong_rows_are_one_line(text: str, named: tuple[object, ...], tmp_path: Path) -> None:
    path = tmp_path / "d.csv"
    path.write_text(text)
    with raises_naming(DataError, *named) as error:
        read_csv(path, beam(), ("tip",), {})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("row", "named"),
    [
        ("-90,0,0,0,0", ("line 2", "servo_0", "-90 rad", "-2.1 to 0.6 rad", "degrees")),
        ("0,0,0,50,0", ("line 2", "slide", "0.05 m", "0 to 0.04 m")),
    ],
)
def test_commands_that_the_scene_cannot_follow_are_refused(
    row: str, named: tuple[str, ...], tmp_path: Path
) -> None:
    path = tmp_path / "d.csv"
    path.write_text(f"servo_0_rad,servo_1_rad,servo_2_rad,slide_mm,effector.x_mm\n{row}\n")
    with raises_naming(DataError, *named):
        read_csv(path, tripod(), ("effector",), {})


def test_missing_values_are_left_out_and_told(tmp_path: Path) -> None:
    path = tmp_path / "d.csv"
    path.write_text("# from the lab\ntip.z_mm,tip.y_mm\n1,\n,\n3,\n")
    found = read_csv(path, beam(), ("tip",), {})
    assert found.channels == (Channel("tip", 2),)
    assert np.array_equal(found.values, [[0.001], [np.nan], [0.003]], equal_nan=True)
    (note,) = found.notes
    assert_names(note, "4 of 6 values", "missing")
    assert found.times is None


def test_rows_with_times_can_be_poses(tmp_path: Path) -> None:
    path = tmp_path / "d.csv"
    path.write_text("t_s,tip.z_mm\n1,1\n0,2\n")
    assert read_csv(path, beam(), ("tip",), {}, poses=True).times is None


@pytest.mark.parametrize("text", ["tip:0,0,0", "a=tip", "a=tip:0,0", "a=tip:0,0,inf", "a=:0,0,0"])
def test_a_wrong_point_is_one_line(text: str) -> None:
    with raises_naming(DataError, "--point", repr(text), "NAME=SET:X,Y,Z", "metres"):
        parse_point(text)


def test_of_a_file_that_is_not_there_an_example_is_named(tmp_path: Path) -> None:
    missing, example = tmp_path / "poses.csv", "examples/poses.csv"
    with raises_naming(
        DataError, missing, "no such file", example, "servo_0_deg", "slide_mm", "effector.x_mm"
    ):
        read_csv(missing, tripod(), ("effector",), {})
    assert (Path(__file__).parents[2] / example).is_file()
