"""Calibrations: the conversion is one-to-one and safe at its ends; a file is believed only when all of it is right."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.messages import assert_names, raises_naming
from tripod_driver.calibration import ARDUINO_PULSES, Calibration, CalibrationError, ServoCalibration
from tripod_driver.calibration_file import LARGEST_FILE, calibration_text, parse_calibration, read_calibration


def test_the_default_is_the_servo_library_with_the_flat_piece_at_180_degrees() -> None:
    servo = ServoCalibration()
    assert servo.pulse(0.0) == 2400.0
    assert servo.pulse(-math.pi / 2) == pytest.approx(1472.0)
    assert servo.pulse(-math.radians(120)) == pytest.approx(544 + 1856 * 60 / 180)
    assert (servo.pulse(1.0), servo.pulse(-4.0)) == (2400.0, 544.0)  # never beyond its ends


def test_a_servo_mounted_the_other_way_round_turns_the_other_way() -> None:
    servo = ServoCalibration(offset=0.2, direction=-1, pulse_range=(600, 2300), safe_range=(-2.0, 0.1))
    assert servo.pulse(0.0) == pytest.approx(600 + 1700 * 0.2 / math.pi)
    assert servo.pulse(-1.0) == pytest.approx(600 + 1700 * 1.2 / math.pi)


ranges = st.tuples(st.floats(500, 1400), st.floats(1600, 2500))
servos = st.builds(
    lambda offset, direction, pulses: ServoCalibration(
        offset, direction, pulses, tuple(sorted((-offset * direction, (math.pi - offset) * direction)))
    ),
    st.floats(0, math.pi),
    st.sampled_from([1, -1]),
    ranges,
)


@given(servos, st.floats(0, 1))
def test_angles_survive_the_way_to_pulses_and_back(servo: ServoCalibration, share: float) -> None:
    low, high = servo.safe_range
    angle = low + share * (high - low)
    assert servo.angle(servo.pulse(angle)) == pytest.approx(angle, abs=1e-9)
    assert servo.pulse_range[0] <= servo.pulse(angle) <= servo.pulse_range[1]
    assert servo.joint_angle(servo.workshop_angle(angle)) == pytest.approx(angle, abs=1e-9)
    low, high = ARDUINO_PULSES  # the workshop's firmware makes the same pulse of the other angle
    assert low + (high - low) * (math.pi + servo.workshop_angle(angle)) / math.pi == pytest.approx(
        servo.pulse(angle)
    )


@given(st.floats(-2.1, 0.0))
def test_the_default_leaves_the_workshops_angles_as_they_are_to_the_last_bit(angle: float) -> None:
    assert ServoCalibration().workshop_angle(angle) == angle


# files --------------------------------------------------------------------------------------------------------

GOOD = calibration_text(
    Calibration(
        (
            ServoCalibration(),
            ServoCalibration(offset=3.0, pulse_range=(600.0, 2300.0), safe_range=(-2.0, 0.1)),
            ServoCalibration(offset=0.1, direction=-1, safe_range=(-1.9, 0.05)),
        )
    )
)


def test_a_calibration_survives_its_file() -> None:
    again = parse_calibration(GOOD)
    assert calibration_text(again) == GOOD
    assert again.servos[1] == ServoCalibration(3.0, 1, (600.0, 2300.0), (-2.0, 0.1))
    assert again.servos[2].direction == -1
    assert again.lower == (-2.1, -2.0, -1.9)
    assert again.upper == (0.0, 0.1, 0.05)


def test_fields_left_out_have_their_defaults() -> None:
    text = "servos: {servo_0: {}, servo_1: {offset: 3}, servo_2: {safe_range: [-1, 0]}}"
    assert parse_calibration(text).servos[1] == ServoCalibration(offset=3.0, safe_range=(-2.1, 0.0))


PASSWORDS = "root-x-0-0-root-/root-/bin/bash-daemon-x-1-1-daemon"


def with_servo(text: str) -> str:
    return f"servos:\n  servo_0: {{}}\n  servo_1: {text}\n  servo_2: {{}}\n"


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (with_servo("{offset: .nan}"), ("servos.servo_1.offset", "nan", "finite")),
        (with_servo("{offset: high}"), ("servos.servo_1.offset", "'high'", "finite")),
        (with_servo("{offset: true}"), ("servos.servo_1.offset", "True", "finite")),
        (with_servo("{offset: 3.5}"), ("servos.servo_1.offset", "3.5 rad", "0 to 3.1416 rad")),
        (with_servo("{direction: 0}"), ("servos.servo_1.direction", 0, "1 or -1")),
        (with_servo("{direction: 0.5}"), ("servos.servo_1.direction", 0.5, "1 or -1")),
        (
            with_servo("{pulse_range: [300, 2400]}"),
            ("servos.servo_1.pulse_range[0]", "300 us", "500 to 2500 us"),
        ),
        (with_servo("{pulse_range: [544, .inf]}"), ("servos.servo_1.pulse_range[1]", "inf", "finite")),
        (
            with_servo("{pulse_range: [2400, 544]}"),
            ("servos.servo_1.pulse_range[1]", "544 us", "pulse_range[0] + 200", "2600 us"),
        ),
        (with_servo("{pulse_range: 544}"), ("servos.servo_1.pulse_range", 544, "[low, high]")),
        (
            with_servo("{safe_range: [-3.5, 0]}"),
            ("servos.servo_1.safe_range[0]", "-3.5 rad", "-3.1416 to 0.0000 rad", "shaft"),
        ),
        (
            with_servo("{offset: 0, direction: -1, safe_range: [-2, 0.5]}"),
            ("servos.servo_1.safe_range[1]", "0.5 rad", "-3.1416 to 0.0000 rad", "shaft"),
        ),
        (
            with_servo("{safe_range: [-1, -2]}"),
            ("servos.servo_1.safe_range[1]", "-2 rad", "safe_range[0]", "-1 rad"),
        ),
        (
            with_servo("{ofset: 3}"),
            ("servos.servo_1", "'ofset'", "offset, direction, pulse_range, safe_range"),
        ),
        (with_servo("{offset: 3, offset: 2}"), ("offset", "twice", "line 3")),
        (with_servo("{}\n  servo_1: {}"), ("servo_1", "twice", "line 4")),
        (with_servo("7"), ("servos.servo_1", 7, "offset, direction, pulse_range, safe_range")),
        ("servos: {}", ("servos.servo_0", "missing", "servo_0")),
        ("servos: {elbow: {}}", ("servos", "'elbow'", "servo_0")),
        ("", ("None", "table", "servos")),
        (PASSWORDS, ("long text", "table", "servos")),
        (f"- {PASSWORDS}", ("list", "table", "servos")),
        (f"{PASSWORDS}: 1", ("unknown field", "long text", "servos")),
        (with_servo(f"{{offset: '{PASSWORDS}'}}"), ("servos.servo_1.offset", "long text", "finite")),
        (f"a: !!int '{PASSWORDS}'", ("value", "int()", "base 10", "...")),
        (f"!{PASSWORDS}", ("line 1", "not valid YAML", "constructor", "tag ...")),
        ("servos: {servo_0: &a {}, servo_1: *a, servo_2: *a}", ("line 1", "another part", "values")),
        ("servos: [", ("line 1", "not valid YAML")),
        ("a: !!python/object/apply:os.system [ls]", ("line 1", "not valid YAML", "constructor")),
        ("[" * 5000, ("value", "read")),
        (with_servo("{offset: " + "9" * 5000 + "}"), ("value", "read")),
    ],
)
def test_what_is_wrong_with_a_file_is_told_in_one_line_with_its_field(
    text: str, named: tuple[object, ...], tmp_path: Path
) -> None:
    file = tmp_path / "calibration.yaml"
    file.write_text(text)
    with pytest.raises(CalibrationError) as caught:
        read_calibration(file)
    assert_names(caught.value, file, *named)
    assert "root-x" not in str(caught.value)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 400


def test_files_that_are_none_are_refused_by_name(tmp_path: Path) -> None:
    missing = tmp_path / "none.yaml"
    with raises_naming(CalibrationError, missing, "No such file", "`tripod calibrate`"):
        read_calibration(missing)
    file = tmp_path / "long.yaml"
    file.write_bytes(b" " * (LARGEST_FILE + 1))
    with raises_naming(CalibrationError, file, "larger", "65536 bytes"):
        read_calibration(file)
    file.write_bytes(b"servos: \xff")
    with raises_naming(CalibrationError, file, "byte 8", "UTF-8"):
        read_calibration(file)


@given(st.text(max_size=200))
def test_any_text_is_a_calibration_or_refused(text: str) -> None:
    try:
        parse_calibration(text)
    except CalibrationError as error:
        assert "\n" not in str(error)


def test_a_number_of_any_length_is_named(tmp_path: Path) -> None:
    file = tmp_path / "long.yaml"
    file.write_text(f"servos: {{servo_0: {{offset: {'9' * 400}}}, servo_1: {{}}, servo_2: {{}}}}")
    with raises_naming(CalibrationError, file, "servos.servo_0.offset", "finite") as caught:
        read_calibration(file)
    assert "9" * 10 in str(caught.value)
