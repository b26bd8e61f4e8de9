"""`tripod bag play` as users type it, and what it refuses: one line, and nothing moves."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.messages import assert_names, line_naming
from tests.messages import names as names_all
from tests.replay.sessions import run_session, write_session
from tripod_bringup.bag_cli import To
from tripod_bringup.bag_play import play_command
from tripod_graph import names
from tripod_record.bag import Bag
from tripod_record.info import info_command

pytestmark = pytest.mark.ros


def play(
    file: Path,
    to: To = To.SIM,
    *,
    rate: float = 1.0,
    start: float = 0.0,
    topics: str = "",
    segment: int | None = None,
) -> int:
    return play_command(
        file, to=to, rate=rate, start=start, topics=topics, segment=segment, subnet=False, ros=()
    )


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = run_session("tripod", ("mesh.level=1",), steps=60, seed=4, reset_at=30)
    return write_session(found, tmp_path_factory.mktemp("bags") / "bag")


@pytest.mark.parametrize("share", [0.0, 0.6])
def test_a_session_is_simulated_again_and_its_bodies_are_counted(
    bag: Path, share: float, domain: int, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    start = share * Bag(bag).info.duration
    assert play(bag, rate=float("inf"), start=start) == 0
    out, _ = capfd.readouterr()
    line_naming(out, "60 steps", "8 bodies", "bit for bit")


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"rate": 0.0}, ("--rate", 0, "0.01 to 100", "inf")),
        ({"rate": float("nan")}, ("--rate", "nan")),
        ({"rate": float("inf"), "to": To.ROBOT}, ("--rate", "inf", "0.01 to 100")),
        ({"start": -1.0}, ("--start", "-1 s", "not be negative")),
        ({"start": 99.0}, ("--start", "99 s", "recording ends")),
        ({"segment": 2}, ("/bag", "no segment 2", 1, "tripod bag info")),
        ({"segment": 1, "to": To.TOPICS}, ("--segment", "--to sim", "--start")),
        ({"topics": "other/*"}, ("/bag", names.SCENE, names.COMMANDS)),
        ({"topics": "other/*", "to": To.ROBOT}, ("/bag", "no motion", names.ROBOT_JOINT_STATES)),
    ],
)
def test_what_cannot_be_played_is_refused_in_one_line(
    bag: Path, options: dict, named: tuple[object, ...], capfd: pytest.CaptureFixture[str]
) -> None:
    assert play(bag, **options) == 2
    out, err = capfd.readouterr()
    assert not out
    assert err.startswith("tripod bag play: ")
    assert err.count("\n") == 1
    assert_names(err, *named)
    if options.get("to") is To.ROBOT and "rate" in options:
        assert err.count("inf") == 1  # to a robot it is not allowed


def test_a_recording_with_a_simulator_that_was_started_again_has_a_verdict_for_each_segment(
    tmp_path: Path, domain: int, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    first = run_session("tripod", ("mesh.level=1",), steps=30, seed=4)
    second = run_session("tripod", ("mesh.level=1",), steps=50, seed=5)
    second.bodies[1].positions[3, 0] += 1e-6
    bag = write_session(first, tmp_path / "bag", then=(second,))
    assert play(bag, rate=float("inf")) == 1
    out, err = capfd.readouterr()
    line_naming(out, "segment 1", "30 steps", "bit for bit")
    line_naming(err, "segment 2", "50 steps", "differ", "node 3")
    assert play(bag, rate=float("inf"), segment=1) == 0
    out, err = capfd.readouterr()
    line_naming(out, "segment 1", "bit for bit")
    assert "segment 2" not in out + err
    assert info_command(bag) == 0
    out, _ = capfd.readouterr()
    line_naming(out, "segment 2", "50 steps", "tripod")


def test_beside_a_simulator_that_runs_it_is_refused_in_one_line(
    bag: Path, domain: int, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    import rclpy
    from tripod_msgs.msg import BodyState

    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    context = rclpy.Context()
    context.init(domain_id=domain)
    node = rclpy.create_node("sim", context=context, enable_rosout=False)
    try:
        node.create_publisher(BodyState, "sim/body_state", 1)
        assert play(bag) == 2
    finally:
        node.destroy_node()
        context.try_shutdown()
    out, err = capfd.readouterr()
    assert not out
    assert err.count("\n") == 1
    assert_names(err, "tripod bag play: ", "/sim", "ROS_DOMAIN_ID", "tripod view")


def test_what_no_driver_plays_is_refused_with_2(
    bag: Path, domain: int, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    monkeypatch.setattr("tripod_play.replay_node.PATIENCE", 0.5)
    assert play(bag, To.ROBOT) == 2
    line_naming(capfd.readouterr().err, "tripod bag play: ", "no driver", "tripod up", "tripod driver")


def test_to_the_robot_it_says_that_it_waits_for_a_driver_and_ends_with_130_before_anything_played(
    bag: Path, domain: int
) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "tripod_bringup", "bag", "play", str(bag), "--to", "robot"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
    )
    try:
        assert process.stderr
        said = [process.stderr.readline()]
        while said[-1] and not names_all(said[-1], "driver", "tripod up", "tripod driver"):
            said.append(process.stderr.readline())
        process.send_signal(signal.SIGINT)
        out, rest = process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait()
    assert len(said) <= 2
    assert all(line.startswith("tripod bag play: ") and names_all(line, "driver") for line in said)
    assert (out, rest, process.returncode) == ("", "", 130)


@pytest.mark.parametrize("to", list(To))
def test_files_that_are_no_recordings_are_refused_in_one_line(
    to: To, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "text.mcap").write_text("no")
    for file, reason in ((tmp_path / "gone.mcap", "exist"), (tmp_path / "text.mcap", "not an mcap file")):
        assert play(file, to) == 2
        err = capfd.readouterr().err
        assert_names(err, file, reason)
        assert err.count("\n") == 1


def test_a_recording_cut_in_half_is_played_as_far_as_it_goes(
    bag: Path, tmp_path: Path, domain: int, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = run_session("tripod", ("mesh.level=1",), steps=30, seed=5)
    whole = write_session(found, tmp_path / "whole", sync_every=1)
    (file,) = whole.glob("*.mcap")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(file.read_bytes()[: 2 * file.stat().st_size // 3])
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    assert play(cut, rate=float("inf")) == 0
    out, err = capfd.readouterr()
    assert re.search(r"\b[1-9]\d* steps\b", out)
    line_naming(err, "left out", cut, "ends", "byte")
