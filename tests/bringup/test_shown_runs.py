"""`tripod run --view`, `--html` and so on, and `tripod show`, from the command line."""

import json
import os
import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from tests.messages import assert_names, line_naming, raises_naming
from tests.scenes import SHARP
from tripod_bringup.cli import app
from tripod_sim import SceneError, Simulation, load_scene, scene_names
from tripod_sim.fields import FIELDS
from tripod_sim.tables.short_forms import effector_of, joints_of
from tripod_study.recording import Recording
from tripod_view.player.html import write_html
from tripod_view.player.of_run import MOVING, SILICONE, film_of, pictures

SHORT = ["run", "pendulum", "--duration", "0.1"]
PATIENCE = 300
"""Longest time that a page or the end of a command takes on a loaded machine [s]."""
QUIET = {**os.environ, "OMP_NUM_THREADS": "1"}


def tripod(*words: str) -> Result:
    return CliRunner().invoke(app, list(words))


EXAMPLES = [str(path) for path in sorted((Path(__file__).parents[2] / "examples").glob("*.toml"))]


@pytest.mark.parametrize("name", [*scene_names(), *EXAMPLES])
def test_each_scene_that_comes_along_is_shown_with_all_that_is_in_it(name: str) -> None:
    scene = load_scene(name)
    coarse = (
        ["springs.nodes=5"]
        if scene.springs
        else ["mesh.level=1"]
        if scene.mesh and name != "tripod_sofa"
        else []
    )
    simulation = Simulation(load_scene(name, coarse))
    recording = Recording(simulation, 2)
    for _ in range(2):
        simulation.step()
        recording.add(simulation)
    film = film_of(recording.arrays())
    assert film.title == scene.name
    bodies = [body for body in film.bodies if not body.name.startswith("cable ")]
    assert len(film.bodies) - len(bodies) == len(scene.cable)
    assert len(bodies) == bool(scene.mesh or scene.springs) + len(scene.body) + len(scene.rigid)
    assert all(len(body.triangles) for body in film.bodies)
    names = [piece.name for piece in film.pieces]
    assert ("arm 2" in names) == bool((joints := joints_of(scene)) and joints.arms)
    assert ("maze" in names) == ("goal" in names) == bool(scene.maze)
    assert names.count("ball") == 2 * bool(scene.ball)
    assert ("obstacles" in names) == bool(scene.obstacles)
    assert ("effector" in names) == bool(effector_of(scene) and not scene.maze)
    solids = bool(scene.mesh) + sum(body.springs is None for body in scene.body)
    soft = [body.colour for body in bodies[: len(bodies) - len(scene.rigid)]]
    assert soft.count(SILICONE) == min(solids, 1)
    assert len(set(soft)) == len(soft)  # each body can be told from the others
    assert ("servo torques" in [c.title for c in film.curves]) == bool(
        (joints := joints_of(scene)) and joints.arms
    )


def test_a_run_writes_what_is_asked_and_says_so(tmp_path: Path) -> None:
    page, plot, out = (tmp_path / f"run.{kind}" for kind in ("html", "png", "npz"))
    colour = ["--colour", "stretch"]
    result = tripod(*SHORT, "--html", str(page), "--plot", str(plot), "--out", str(out), *colour)
    assert result.exit_code == 0, result.output
    assert re.search(r"^files +.*run\.html \(0\.\d+ MB\)", result.output, re.MULTILINE)
    assert "Simulated by tripod" in page.read_text()
    assert plot.read_bytes().startswith(b"\x89PNG")
    with np.load(out) as arrays:
        assert len(arrays["time"]) == 20
    again = tmp_path / "again.html"
    shown = tripod("show", str(out), "--html", str(again), *colour)
    assert shown.exit_code == 0, shown.output
    assert shown.stdout.startswith(f"{again}  0.")
    assert again.read_bytes() == page.read_bytes()  # fields are found again


def stage_of(page: Path) -> dict[str, Any]:
    found = re.search(
        r'<script id="film" type="application/json">(.*?)</script>', page.read_text(), re.DOTALL
    )
    assert found
    return dict(json.loads(found[1]))


@pytest.mark.parametrize(
    ("colour", "colouring"),
    [
        ([], None),
        (["--colour", "stretch:1:1.5"], {"name": "largest stretch", "limits": [1.0, 1.5]}),
        (["--colour", "tension"], {"name": "largest spring tension"}),
    ],
)
def test_a_page_begins_with_the_colours_of_a_field(
    colour: list[str], colouring: dict[str, Any] | None, tmp_path: Path
) -> None:
    """With `--colour` all fields of the bodies can be chosen; limits are those of the whole film."""
    page = tmp_path / "run.html"
    assert tripod(*SHORT, "--html", str(page), *colour).exit_code == 0
    stage = stage_of(page)
    fields = [(field["name"], field["unit"], field["signed"]) for field in stage["bodies"][0]["fields"]]
    stretch = [("largest stretch", "", False)] if colour else []
    assert fields == [("displacement", "m", False), *stretch, ("largest spring tension", "N", True)]
    if colouring and "limits" not in colouring:
        low, high = stage["colouring"].pop("limits")
        assert -low == high > 0
    assert stage["colouring"] == colouring


def test_a_saved_run_has_colours_only_where_they_are_asked_for(tmp_path: Path) -> None:
    page, out = tmp_path / "run.html", tmp_path / "run.npz"
    assert tripod(*SHORT, "--out", str(out)).exit_code == 0
    assert tripod("show", str(out), "--html", str(page)).exit_code == 0
    assert stage_of(page)["bodies"][0]["fields"] == []
    whole = dict(np.load(out))
    whole["scene"] = str(whole["scene"]).replace("nodes = 10", "nodes = 9")
    np.savez(out, **whole)
    result = tripod("show", str(out), "--html", str(page), "--colour", "stretch")
    assert result.exit_code == 2
    assert_names(result.output, "tripod show: ", "--colour", "9 nodes")
    assert result.output.count("\n") == 1


def test_the_files_are_in_the_json(tmp_path: Path) -> None:
    page = tmp_path / "run.html"
    result = json.loads(tripod(*SHORT, "--html", str(page), "--json").stdout)
    assert result["written"] == [{"file": str(page), "bytes": page.stat().st_size}]


def test_forces_are_in_page_and_file_and_need_one_of_them(tmp_path: Path) -> None:
    page, again, out = (tmp_path / name for name in ("run.html", "again.html", "run.npz"))
    colour = ("--colour", "displacement")  # `show` has no fields but by this option
    result = tripod(*SHORT, *colour, "--forces", "--html", str(page), "--out", str(out))
    assert result.exit_code == 0, result.output
    assert_names(page.read_text(), "reaction moment", "weight")
    assert tripod("show", str(out), *colour, "--html", str(again)).exit_code == 0
    assert again.read_bytes() == page.read_bytes()
    refused = tripod(*SHORT, "--forces", "--plot", str(tmp_path / "run.png"))
    assert refused.exit_code == 2
    assert_names(line_naming(refused.stderr, "--forces"), "--view", "--html", "--gif", "--mp4", "--out")


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--html", "a.htm"], ("--html 'a.htm'", ".html")),
        (["--plot", "a.jpg"], ("--plot 'a.jpg'", ".png")),
        (["--gif", "a.mp4"], ("--gif 'a.mp4'", ".gif")),
        (["--out", "a.csv"], ("--out 'a.csv'", ".npz")),
        (["--html", "a.html", "--colour", "heat"], ("--colour 'heat'", "von_mises", "stretch")),
        (["--html", "a.html", "--colour", "stretch:2:1"], ("--colour 'stretch:2:1'", "stretch:0:2e4")),
        (["--html", "a.html", "--colour", "stretch:1"], ("--colour 'stretch:1'", "stretch:0:2e4")),
        (["--html", "a.html", "--colour", "stretch:1:nan"], ("--colour 'stretch:1:nan'", "stretch:0:2e4")),
        (["--html", "a.html", "--colour", "von_mises"], ("--colour", "displacement, stretch, tension")),
        (["--colour", "stretch"], ("--colour 'stretch'", "--html")),
        (["--html", "gone/a.html"], ("--html 'gone/a.html'", "no directory gone")),
        (["--gif", "a.gif"], ("--gif", "ffmpeg", "sudo apt-get install ffmpeg")),
        (["--mp4", "a.mp4"], ("--mp4", "ffmpeg", "sudo apt-get install ffmpeg")),
    ],
)
def test_what_cannot_be_written_is_told_before_the_run(
    words: list[str], named: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path))
    result = tripod(*SHORT, *words)
    assert result.exit_code == 2
    assert_names(result.output, "tripod run: ", *named)
    assert result.output.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_run_that_breaks_off_still_shows_how(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tripod_sim.errors import StepError
    from tripod_study import run as module

    class Breaking(module.Simulation):
        def step(self, joints: object = None) -> object:
            if self.state.step == 7:
                raise StepError("node 3")
            return super().step(joints)

    monkeypatch.setattr(module, "Simulation", Breaking)
    page = tmp_path / "run.html"
    result = tripod(*SHORT, "--html", str(page))
    assert result.exit_code == 1
    assert result.output == "tripod run: node 3\n"
    assert page.exists()


@pytest.mark.parametrize(
    ("content", "named"), [(None, ("No such file",)), (b"words", ("not a recording", "run"))]
)
def test_what_cannot_be_shown_is_told(content: bytes | None, named: tuple[str, ...], tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    if content:
        path.write_bytes(content)
    result = tripod("show", str(path))
    assert result.exit_code == 2
    assert_names(result.output, "tripod show: ", path, *named)
    assert result.output.count("\n") == 1


@pytest.mark.parametrize("page", [True, False])
def test_a_recording_without_times_or_steps_is_told(page: bool, tmp_path: Path) -> None:
    out, options = tmp_path / "run.npz", ["--html", str(tmp_path / "run.html")] if page else []
    assert tripod(*SHORT, "--out", str(out)).exit_code == 0
    whole = dict(np.load(out))
    for count, named in ((None, ("time", "tripod run --out")), (0, ("time", "at least one step"))):
        found = {k: a[:count] if k in (*MOVING, "time") else a for k, a in whole.items()}
        if count is None:
            del found["time"]
        np.savez(out, **found)
        result = tripod("show", str(out), *options)
        assert result.exit_code == 2
        assert_names(result.output, "tripod show: ", *named)
        assert result.output.count("\n") == 1
    assert not (tmp_path / "run.html").exists()


def viewed(words: list[str]) -> tuple[subprocess.Popen[str], str]:
    """Start a command that serves a page; return it and the address."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tripod_bringup.cli", *words],
        env=QUIET, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    assert process.stderr
    for line in process.stderr:
        if found := re.search(r"(http://127\.0\.0\.1:\d+/\S+)$", line):
            return process, found[1]
    raise AssertionError(f"no address; it ended with code {process.wait()}")


def fetched(address: str) -> str:
    with urllib.request.build_opener(urllib.request.ProxyHandler({})).open(
        address, timeout=PATIENCE
    ) as answer:
        return str(answer.read().decode())


def ended(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    """Send Ctrl-C as soon as it waits for that; return code and what it wrote."""
    assert process.stderr
    for line in process.stderr:
        if "Ctrl-C" in line:
            break
    process.send_signal(signal.SIGINT)
    out, errors = process.communicate(timeout=PATIENCE)
    return process.returncode, out, errors


def test_a_run_can_be_watched_and_the_page_stays_until_ctrl_c() -> None:
    process, address = viewed([*SHORT[:-1], "0.5", "--view"])
    try:
        assert "<title>pendulum</title>" in fetched(address)
        done, shown = False, 0
        while not done:
            answer = json.loads(fetched(f"{address}/reel?from={shown}"))
            shown += answer["reel"]["times"][2] if answer["reel"] else 0
            done = answer["done"]
        assert shown == 26
        code, out, errors = ended(process)
    finally:
        process.kill()
    assert code == 0
    line_naming(out, "result", "largest displacement")
    assert errors == ""


def test_a_recording_is_served_until_ctrl_c(tmp_path: Path) -> None:
    out = tmp_path / "run.npz"
    assert tripod(*SHORT, "--out", str(out)).exit_code == 0
    process, address = viewed(["show", str(out)])
    try:
        page = fetched(address)
        assert "<title>pendulum</title>" in page
        assert '<script id="reel" type="application/json">{"times"' in page
        code, _, errors = ended(process)
    finally:
        process.kill()
    assert code == 0
    assert errors == ""


def test_a_recording_takes_the_steps_that_it_was_made_for(tmp_path: Path) -> None:
    simulation = Simulation(load_scene("pendulum"))
    recording = Recording(simulation, 1)
    simulation.step()
    recording.add(simulation)
    with raises_naming(SceneError, "recording", "full", "1 steps"):
        recording.add(simulation)
    recording.save(str(tmp_path / "run.npz"))
    write_html(film_of(recording.arrays()), str(tmp_path / "run.html"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.html", "run.npz"]


@pytest.mark.parametrize("steps", [0, -1, 2.5, "3"])
def test_a_recording_of_no_steps_is_refused(steps: Any) -> None:
    with raises_naming(SceneError, "steps", steps, "whole number", "at least 1"):
        Recording(Simulation(load_scene("pendulum")), steps)


def test_a_film_has_the_mesh_error_if_the_run_recorded_it(tmp_path: Path) -> None:
    out, plain, page = tmp_path / "run.npz", tmp_path / "plain.npz", tmp_path / "run.html"
    words = ["run", SHARP, "--duration", "0.05", "-q", "--set", "clamp.stiffness=1.4e10", "--set"]
    estimated = [*words, "mesh_error={}", "--set", "mesh_error.share=1e6"]
    assert tripod(*estimated, "--colour", "mesh_error", "--out", str(out)).exit_code == 0
    assert tripod(*estimated, "--out", str(plain)).exit_code == 0
    with np.load(out) as arrays:
        errors, k = arrays["mesh_error"], len(arrays["time"])
        assert errors.shape == (k, arrays["positions"].shape[1])
        assert 1e-5 < errors[-1].max() < 5e-3
        shown = pictures(arrays["time"], errors.shape[1])
        high = errors[shown][:, np.unique(arrays["triangles"])].max()
    assert tripod("show", str(out), "--colour", "mesh_error", "--html", str(page)).exit_code == 0
    colouring = stage_of(page)["colouring"]
    assert colouring["name"] == FIELDS["mesh_error"].label
    assert colouring["limits"][1] == pytest.approx(high)
    for command in (
        ["show", str(plain), "--colour", "mesh_error", "--html", str(page)],
        [*words, "damping.mass=1", "--colour", "mesh_error", "--out", str(plain)],
    ):
        result = tripod(*command)
        assert result.exit_code == 2
        assert_names(result.output, "mesh_error", "[mesh_error]")
