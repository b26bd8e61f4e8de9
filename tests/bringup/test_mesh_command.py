"""`tripod mesh`: what it writes and says, its refusals, and that Ctrl-C leaves nothing behind."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.messages import assert_names, line_naming
from tests.sim.broken_surfaces import ball, box, write_stl
from tests.sim.test_part_mesh import NOTCHED, gmsh, notched, tetwild
from tripod_bringup.long_work import in_process
from tripod_bringup.mesh_command import Options, mesh_command
from tripod_sim.errors import StepError
from tripod_sim.mesh.part import part as part_module
from tripod_sim.mesh.read import read_solid


def run(part: Path, **options) -> int:
    given = {"size": None, "accuracy": None, "element": "t10", "unit": None, "picture": None, "scene": ""}
    given |= {
        "out": part.with_suffix(".vtu"),
        "volume_change": 0.02,
        "most_unknowns": 8000,
        "time_limit": 300.0,
    }
    given |= {"as_json": False, "quiet": False}
    return mesh_command(Options(part, **{**given, **options}))


@gmsh
def test_it_writes_the_mesh_and_a_picture_and_says_what_is_known(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    part = notched(tmp_path)
    out, picture = tmp_path / "a.msh", tmp_path / "a.png"
    assert run(part, size=0.008, out=out, picture=picture) == 0
    said = capsys.readouterr()
    mesh = read_solid(out, 1.0, "auto")
    assert_names(line_naming(said.out, "mesh", "t10"), mesh.count, "gmsh")
    assert_names(line_naming(said.out, "volume"), f"{NOTCHED:.4g} mm³", "+0.00 %")
    assert_names(line_naming(said.out, "step"), "ms", "5 ms")
    faces = line_naming(said.out, "faces")
    assert_names(faces, "right", "more")
    assert re.search(r"left at \(40, 8, 6\.\d+\)", faces), faces
    assert re.search(r"below_2 at \(13\.3, 0, 6\)", faces), faces
    assert {"base", "tip"} <= set(mesh.groups)
    with Image.open(picture) as image:
        pixels = (
            image.convert("RGB").get_flattened_data()
            if hasattr(image, "get_flattened_data")
            else image.getdata()
        )
        orange = sum(1 for r, g, b in pixels if r > 1.3 * b and r > 80)
        assert 0.02 < orange / (image.width * image.height) < 0.8
    assert_names(said.err, "meshing", "timing")


@gmsh
def test_it_refines_until_the_accuracy_is_met(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    part = notched(tmp_path)
    assert run(part, accuracy=0.5, as_json=True) == 0
    coarse = json.loads(capsys.readouterr().out)
    assert coarse["reached"]
    assert len(coarse["trials"]) == 1
    assert coarse["trials"][-1]["error"] < 0.5
    assert run(part, accuracy=1e-6, most_unknowns=1000, as_json=True) == 1
    said = capsys.readouterr()
    assert not json.loads(said.out)["reached"]
    assert_names(said.err, "0.0001 %", "1000", "--most-unknowns")
    assert_names(line_naming(said.err, "estimating"), "GB", "unknowns", "16 mm")
    assert part.with_suffix(".vtu").is_file()


@gmsh
def test_an_error_whose_estimate_needs_too_much_memory_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    part = notched(tmp_path)
    monkeypatch.setattr(part_module, "free_memory", lambda: 0.45e9)  # enough for the mesher
    assert run(part, accuracy=0.5) == 2
    assert_names(capsys.readouterr().err, "0.45 GB", "16 mm", "--size")


def rests(seconds: float) -> float:
    time.sleep(seconds)
    return seconds


def fails() -> None:
    raise StepError("it failed", "a remedy")


def test_work_in_another_process_is_reported_each_second_and_ends_as_it_would_here() -> None:
    said = list[tuple[float, float]]()
    start = time.monotonic()
    assert in_process(lambda taken: said.append((taken, time.monotonic() - start)), rests, 2.0) == 2.0
    at = [when for _, when in said]
    assert at[0] < 0.2
    assert np.diff(at).max() < 1.0
    assert said[-1][0] == pytest.approx(said[-1][1], abs=0.2)
    with pytest.raises(StepError) as caught:
        in_process(lambda taken: None, fails)
    assert_names(caught.value, "it failed", "a remedy")
    with pytest.raises(MemoryError) as killed:
        in_process(lambda taken: None, kills_itself)
    assert_names(killed.value, "-9")


def kills_itself() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


@gmsh
def test_a_scene_may_say_where_the_error_counts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    part, scene = notched(tmp_path), tmp_path / "robot.toml"
    scene.write_text(
        'name = "robot"\n[mesh]\nsource = "notched.step"\n[material]\nyoung = 1e6\n[gravity]\n'
        "[[fixed]]\nlow = [0.079, -1, -1]\nhigh = [0.081, 1, 1]\n"
    )
    assert run(part, accuracy=0.5, scene=str(scene), as_json=True) == 0
    assert json.loads(capsys.readouterr().out)["trials"][-1]["error"] < 0.5
    scene.write_text('name = "robot"\n[springs]\nsource = "chain"\nfixed_corners = [0]\n')
    assert run(part, accuracy=0.5, scene=str(scene)) == 2
    assert_names(capsys.readouterr().err, "robot", "[mesh]")


@pytest.mark.parametrize(
    ("options", "names"),
    [
        ({}, ("--size", "--accuracy")),
        ({"size": 0.003, "accuracy": 0.05}, ("--size", "--accuracy")),
        ({"size": 0.003, "scene": "tripod"}, ("--scene", "--accuracy")),
        ({"size": 0.003, "element": "h8"}, ("--element", "h8", "t10", "t4")),
        ({"size": 0.003, "unit": "ell"}, ("--unit", "ell", "mm")),
        ({"size": 0.003, "unit": "m"}, ("part.stl", "30 m", "--unit")),
        ({"size": 0.003, "out": Path("a.obj")}, ("--out", "a.obj", ".vtu", ".msh")),
        ({"size": 0.003, "picture": Path("a.jpg")}, ("--picture", "a.jpg", ".png")),
        ({"size": 0.003, "out": Path("absent/a.vtu")}, ("absent/a.vtu",)),
        ({"size": 0.5}, ("part.stl", "500 mm", "30 mm")),
    ],
)  # fmt: skip
def test_what_is_refused_is_named_in_one_line(
    options: dict, names: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    part = write_stl(Path("part.stl"), (1e3 if options.get("unit") == "m" else 1) * box())
    options = {**options}
    if options.get("unit") == "m":
        names = ("part.stl", "3e+04 m", "--unit")
    assert run(part, **options) == 2
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert_names(said, *names)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["part.stl"], "nothing is written"


@tetwild
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_mesher_and_leaves_no_file(number: signal.Signals, tmp_path: Path) -> None:
    part, scratch = write_stl(tmp_path / "part.stl", ball(level=6)), tmp_path / "scratch"
    scratch.mkdir()
    words = [sys.executable, "-m", "tripod_bringup", "mesh", str(part), "--size", "0.6mm"]
    process = subprocess.Popen(
        words,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "TMPDIR": str(scratch)},
    )
    assert process.stderr
    for line in process.stderr:
        if "meshing" in line:
            break
    time.sleep(1.0)
    (child,) = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    assert b"tetwild" in Path(f"/proc/{child}/cmdline").read_bytes()
    process.send_signal(number)
    start = time.monotonic()
    assert process.wait(20) == 128 + number
    assert time.monotonic() - start < 5
    assert not Path(f"/proc/{child}").exists()
    assert_names(process.stderr.read(), "nothing was written")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["part.stl", "scratch"]
    assert list(scratch.iterdir()) == []
