"""Each check of the doctor, in environments made for it."""

import json
import socket
import subprocess
import time
from pathlib import Path

import pytest

from tests.messages import assert_names
from tripod_bringup import doctor, doctor_command
from tripod_bringup.doctor import Check, Probe, Verdict
from tripod_graph.loopback import LoopbackError


@pytest.mark.parametrize(
    ("version", "verdict"), [((3, 10, 9), "fail"), ((3, 11, 0), "ok"), ((4, 0, 0), "ok")]
)
def test_python(version: tuple[int, int, int], verdict: str) -> None:
    check = doctor.check_python(version)
    assert check.verdict.value == verdict
    assert bool(check.advice) == (verdict == "fail")


def test_rclpy_present() -> None:
    check = doctor.check_rclpy({}, lambda _program: Probe(0, "rmw_fastrtps_cpp"), lambda: "7.1.6")
    assert (check.name, check.verdict) == ("rclpy", Verdict.OK)
    assert_names(check.found, "7.1.6", "rmw_fastrtps_cpp")


def test_rclpy_missing_says_how_to_get_it() -> None:
    check = doctor.check_rclpy({}, lambda _program: Probe(1, "", "No module named 'rclpy'"))
    assert check.verdict is Verdict.FAIL and "rclpy" in check.found and "make setup" in check.advice
    assert "RMW_IMPLEMENTATION" not in check.advice


def test_a_middleware_that_is_not_there_is_told() -> None:
    failed = Probe(102, "", "Expected rmw_x")
    check = doctor.check_rclpy({"RMW_IMPLEMENTATION": "rmw_x"}, lambda _program: failed)
    assert check.verdict is Verdict.FAIL
    assert_names(check.advice, "unset RMW_IMPLEMENTATION", "rmw_x", "make setup")


def test_a_probe_survives_a_program_that_ends_its_process() -> None:
    assert doctor.probe("print('here')") == Probe(0, "here", "exit code 0")
    hard = "import os, sys; sys.stderr.write('why\\n'); sys.stderr.flush(); os._exit(102)"
    assert doctor.probe(hard) == Probe(102, "", "why")
    assert doctor.probe("import nothing_of_that_name").error.startswith("ModuleNotFoundError")


@pytest.mark.parametrize(
    ("environment", "verdict", "found"),
    [
        (
            {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": "5"},
            "ok",
            ("domain 5", "LOCALHOST"),
        ),
        ({}, "ok", ("domain 0", "range", "not set")),
        ({"ROS_LOCALHOST_ONLY": "1"}, "warn", ("domain 0", "ROS_LOCALHOST_ONLY=1")),
        ({"ROS_DOMAIN_ID": "999"}, "fail", ("ROS_DOMAIN_ID", "'999'", "0 to 232")),
    ],
)
def test_discovery(environment: dict[str, str], verdict: str, found: tuple[str, ...]) -> None:
    check = doctor.check_discovery(environment)
    assert check.verdict.value == verdict
    assert_names(check.found, *found)


def test_what_every_node_needs_to_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check = doctor.check_start({"HOME": str(tmp_path)})
    assert (check.name, check.verdict) == ("start of nodes", Verdict.OK)
    assert_names(check.found, "loopback", "logs", f"{tmp_path}/.ros/log")
    check = doctor.check_start({})
    assert check.verdict is Verdict.FAIL
    assert_names(check.found, "HOME", "not set", "logs")
    assert_names(check.advice, "ROS_LOG_DIR", "directory")

    def broken() -> None:
        raise LoopbackError(
            "the loopback interface does not work (down)", "bring it up: sudo ip link set lo up"
        )

    monkeypatch.setattr(doctor, "check_loopback", broken)
    check = doctor.check_start({"HOME": str(tmp_path)})
    assert check.verdict is Verdict.FAIL
    assert_names(check.found, "loopback", "down")
    assert_names(check.advice, "sudo ip link set lo up")
    assert "start of nodes" in [one.name for one in doctor.examine(tmp_path)]


def test_messages() -> None:
    programs: list[str] = []

    def run(program: str) -> Probe:
        programs.append(program)
        return Probe(0, "")

    found = doctor.check_messages(run)
    assert (found.name, found.verdict) == ("tripod_msgs", Verdict.OK)
    assert_names(found.found, "6 messages")
    assert "tripod_msgs.msg" in programs[0] and "Compliance" in programs[0]
    missing = doctor.check_messages(lambda _program: Probe(1, "", "cannot import name 'Compliance'"))
    assert missing.verdict is Verdict.FAIL and "make setup" in missing.advice
    assert "Compliance" in missing.found


def test_packages() -> None:
    assert doctor.check_packages("packages", doctor.SIMULATOR).verdict is Verdict.OK
    there = lambda name: None if name in ("mcap", "websockets") else name  # noqa: E731
    check = doctor.check_packages("packages of nodes", doctor.NODES, there)
    assert (check.name, check.verdict) == ("packages of nodes", Verdict.FAIL)
    assert_names(check.found, "mcap", "websockets")
    assert_names(check.advice, "make setup")


def test_without_the_nodes_packages_the_machine_simulates() -> None:
    bad = [Check(name, Verdict.FAIL, "", "") for name in doctor.OF_NODES]
    assert_names(doctor_command.verdict_line(bad), "tripod run", *doctor.OF_NODES)
    assert "tripod run" not in doctor_command.verdict_line([*bad, Check("packages", Verdict.FAIL, "", "")])


def test_page_port() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        number = taken.getsockname()[1]
        busy = doctor.check_page_port(number)
    assert busy.verdict is Verdict.WARN
    assert_names(busy.found, f"127.0.0.1:{number}", "in use")
    assert_names(busy.advice, "--view-port")
    assert doctor.check_page_port(number).verdict is Verdict.OK


def test_recordings_are_tried_where_they_would_go_without_making_the_directory(tmp_path: Path) -> None:
    wanted = tmp_path / "a" / "b"
    assert doctor.check_recordings(wanted).verdict is Verdict.OK
    assert not wanted.parent.exists() and not list(tmp_path.iterdir())
    full = doctor.check_recordings(wanted, enough=10**18)
    assert full.verdict is Verdict.FAIL and "MB" in full.found
    assert doctor.check_recordings(Path("/proc/none")).verdict is Verdict.FAIL


def test_kernel_cache_is_the_first_place_that_can_be_written(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()
    bad, good = file / "cache", tmp_path / "new" / "cache"
    assert doctor.check_kernel_cache([bad, good]) == Check("kernel cache", Verdict.OK, str(good))
    check = doctor.check_kernel_cache([bad])
    assert check.verdict is Verdict.FAIL and "NUMBA_CACHE_DIR" in check.advice
    assert list(tmp_path.iterdir()) == [file], "looking leaves nothing behind"


def test_programs_of_some_commands() -> None:
    assert_names(doctor.check_programs(lambda name: f"/usr/bin/{name}").found, "ffmpeg", "avrdude")
    found = doctor.check_programs(lambda name: None if name == "ffmpeg" else name)
    assert found.verdict is Verdict.OK
    assert_names(found.found, "ffmpeg")
    assert_names(found.advice, "--gif", "--mp4", "apt-get install ffmpeg")
    assert "avrdude" not in found.advice


def test_speed() -> None:
    check = doctor.check_speed(lambda: 0.030)
    assert (check.name, check.verdict) == ("speed", Verdict.OK)
    assert_names(check.found, "1000 x 1000", "30 ms", "one thread")
    assert doctor.check_speed(lambda: 0.5).verdict is Verdict.WARN

    def broken() -> float:
        raise subprocess.CalledProcessError(1, "python")

    assert doctor.check_speed(broken).verdict is Verdict.FAIL


def test_the_calibration_measures_something() -> None:
    begun = time.monotonic()
    found = doctor.measure_product()
    assert 1e-3 < found < (time.monotonic() - begun) / 3, "three of its five products take so long"


@pytest.mark.parametrize(("worst", "code"), [(Verdict.OK, 0), (Verdict.WARN, 0), (Verdict.FAIL, 1)])
def test_exit_code_and_output(
    worst: Verdict, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    checks = [Check("one", Verdict.OK, "found"), Check("two", worst, "[found]", "do [this]")]
    monkeypatch.setattr(doctor_command, "examine", lambda _directory, ask: checks)
    assert doctor_command.doctor_command(Path("x"), as_json=False) == code
    text = capsys.readouterr().out
    assert "[found]" in text and "do [this]" in text
    assert doctor_command.doctor_command(Path("x"), as_json=True) == code
    assert json.loads(capsys.readouterr().out)[1] == {
        "name": "two",
        "verdict": worst.value,
        "found": "[found]",
        "advice": "do [this]",
    }


def test_the_doctor_ends_with_a_verdict() -> None:
    fine, odd, broken = (Check(name, v, "found") for name, v in zip("abc", Verdict, strict=True))
    assert doctor_command.verdict_line([fine]) == "ready"
    assert_names(doctor_command.verdict_line([fine, odd]), "ready", "b")
    assert_names(doctor_command.verdict_line([odd, broken]), "not ready", "c")
