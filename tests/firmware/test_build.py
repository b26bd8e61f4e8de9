"""The firmware's Makefile: its gate on the size, its parameters; and what a test says whose packages are absent."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.firmware import build
from tests.messages import assert_names


def make(directory: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    build.need("make", *build.AVR)
    command = ["make", "-C", str(build.SOURCES), f"BUILD={directory}", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_firmware_fits_with_all_options(tmp_path: Path) -> None:
    run = make(tmp_path, "IMU_BAUD=9600", "SERVO_COUNT=6")
    assert run.returncode == 0, run.stderr
    flash, ram = map(int, re.search(r"flash (\d+) B .*, RAM (\d+) B", run.stdout).groups())
    assert 2000 < flash < 8192
    assert 150 < ram < 512
    assert (tmp_path / "tripod.hex").stat().st_size > 2 * flash


def test_the_document_tells_the_size_of_the_default_build(tmp_path: Path) -> None:
    flash = int(re.search(r"flash (\d+) B", make(tmp_path).stdout)[1])
    told = re.search(r"([\d.]+) kB of flash", (build.SOURCES.parent / "docs" / "firmware.md").read_text())
    assert float(told[1]) == pytest.approx(flash / 1000, rel=0.1)  # compilers differ


@pytest.mark.parametrize("limit", ["FLASH_LIMIT=3500", "RAM_LIMIT=200"])
def test_a_firmware_that_is_too_large_fails_the_build(tmp_path: Path, limit: str) -> None:
    run = make(tmp_path, limit)
    assert run.returncode != 0
    assert_names(run.stderr, "too large")
    assert not list(tmp_path.glob("tripod.*"))
    assert make(tmp_path).returncode == 0


def test_a_changed_parameter_builds_anew_and_an_unchanged_one_does_not(tmp_path: Path) -> None:
    def built() -> bytes:
        assert make(tmp_path, *arguments).returncode == 0
        return (tmp_path / "tripod.hex").read_bytes()

    arguments = ["WATCHDOG_MS=500"]
    first = built()
    when = (tmp_path / "tripod.elf").stat().st_mtime_ns
    assert built() == first
    assert (tmp_path / "tripod.elf").stat().st_mtime_ns == when
    arguments = ["WATCHDOG_MS=300"]
    assert built() != first


@pytest.mark.parametrize(
    ("parameter", "allowed"),
    [
        ("SERVO_COUNT=0", "1 <= SERVO_COUNT <= 6"),
        ("SERVO_COUNT=7", "1 <= SERVO_COUNT <= 6"),
        ("PULSE_MAX=26005", "4000 <= PULSE_MIN < PULSE_MAX <= 26000"),
        ("PULSE_MIN=3995", "4000 <= PULSE_MIN < PULSE_MAX <= 26000"),
        ("PULSE_MIN=24000", "4000 <= PULSE_MIN < PULSE_MAX <= 26000"),
        ("PULSE_MIN=5441", "multiples of 5"),
        ("SLEW=20005", "SLEW: 5 to 20000"),
        ("SLEW=0", "SLEW: 5 to 20000"),
        ("SLEW=472", "multiples of 5"),
        ("WATCHDOG_MS=99", "100 <= WATCHDOG_MS <= 10000"),
        ("IMU_BAUD=19200", "2400 <= IMU_BAUD <= 9600"),
    ],
)
def test_a_parameter_out_of_range_is_refused_by_the_compiler(
    tmp_path: Path, parameter: str, allowed: str
) -> None:
    run = make(tmp_path, parameter)
    assert run.returncode != 0
    assert_names(run.stderr, parameter.partition("=")[0], allowed)


def run_without_packages(tmp_path: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run one test of each tier where the PATH has no compiler."""
    environment = {k: v for k, v in os.environ.items() if k != build.REQUIRED}
    environment |= {"PATH": str(tmp_path), **variables}
    tests = ["test_native_protocol.py", "test_pulses.py", "test_pseudo_terminal.py"]
    command = [sys.executable, "-m", "pytest", *[str(build.HERE / t) for t in tests]]
    root = build.HERE.parents[1]
    return subprocess.run(command, env=environment, cwd=root, capture_output=True, text=True, check=False)


def test_where_packages_are_absent_the_tests_are_skipped_and_name_them(tmp_path: Path) -> None:
    run = run_without_packages(tmp_path)
    assert run.returncode == 0, run.stdout
    assert "passed" not in run.stdout
    lines = [line for line in run.stdout.splitlines() if "apt-get install" in line]
    assert len(lines) == 1
    for package in ("gcc", "gcc-avr", "avr-libc", "libsimavr-dev", "libelf-dev"):
        assert f" {package} " in f"{lines[0]} "


def test_where_a_skip_is_a_failure_it_fails(tmp_path: Path) -> None:
    run = run_without_packages(tmp_path, **{build.REQUIRED: "1"})
    assert run.returncode == 1
    assert "skipped" not in run.stdout
    assert_names(run.stdout, f"{build.REQUIRED} is set")
