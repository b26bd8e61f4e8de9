"""A run without ROS: its summary, its recording, and that the same inputs give the same bits."""

import errno
import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.messages import assert_names, raises_naming
from tests.tiers import sampled
from tripod_sim import SceneError, Simulation, StepError, load_scene, scene_names
from tripod_sim.scene.file import scene_text
from tripod_sim.tables.short_forms import effector_of, joints_of, rigids_of, soft_bodies
from tripod_study import recording
from tripod_study import run as run_module
from tripod_study.run import run

KEYS = [line for line in str(recording.__doc__).splitlines() if line.startswith("| `")]
"""Rows of the table of what a run's file holds."""

COARSE = ["mesh.level=1"]
TRIPOD = [*COARSE, "mesh.element=h8_modes", "inertia.scheme=implicit_euler", "dt=0.005"]
EMIO = str(Path(__file__).parents[2] / "examples" / "emio.toml")
BEND = "0:0,0,0; 0.2:-0.4,-0.3,0.1"


def never(_: float) -> None:
    pytest.fail("a step was simulated")


def refusal(scene: str = "tripod", **options: Any) -> str:
    """Return why a run is refused; it must be said before the first step."""
    with pytest.raises(SceneError) as caught:
        run(scene, progress=never, **{"overrides": TRIPOD, **options})
    message = str(caught.value)
    assert message.isprintable()
    assert len(message) < 500
    return message


REST = ["inertia=off", "damping=off", "mesh.level=2", "gravity.acceleration=[0.3414, 1.3348, -6.136]"]
SOFT = {"servo": "0:-0.29153,-0.42044,-0.05244", "slide": "0:0.0071565"}
"""Of the case 10124 of benchmarks/promise_branches.py."""

FIRM = {"servo": "0:-1.4965,-1.4965,-1.4965", "slide": "0:0.035"}
"""The working pose."""


def least(**options: Any) -> list[float]:
    """Return the least stability margin of a run at rest, and when it was."""
    figures = run("tripod", overrides=REST, **options)["figures"]["stability"]
    assert figures["at_rest"]
    return figures["stability_margin"]


def test_the_least_stability_margin_of_a_run_is_told() -> None:
    """Of a pose that is soft, of one that is firm, of a way between, and of springs, which have none."""
    soft, firm = least(**SOFT, duration=0.02), least(**FIRM, duration=0.02)
    assert 0.0 < soft[0] < 0.25
    assert firm[0] > 0.8
    value, time = least(
        servo=f"{FIRM['servo']}; 0.4{SOFT['servo'][1:]}", slide="0:0.035; 0.4:0.0071565", duration=0.4
    )
    assert value < 0.3
    assert time > 0.1
    assert run("pendulum", duration=0.02)["figures"]["stability"]["stability_margin"] is None


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], dict[str, np.ndarray], Path]:
    """The summary and the arrays of one run."""
    out = tmp_path_factory.mktemp("run") / "bend.npz"
    summary = run("tripod", duration=0.3, servo=BEND, slide="0.02", overrides=TRIPOD, out=out)
    with np.load(out, allow_pickle=False) as file:
        return summary, dict(file), out


def test_the_summary_is_json_with_every_number_finite(recorded) -> None:
    summary = json.loads(json.dumps(recorded[0], allow_nan=False))
    assert summary["scene"] == "tripod"
    assert summary["dt"] == 0.005
    assert summary["steps"] == 60
    assert summary["time"] == pytest.approx(0.3)
    assert summary["angles"] == pytest.approx([-0.4, -0.3, 0.1], abs=1e-12)
    assert summary["slide"] == pytest.approx(0.02, abs=1e-12)
    assert len(summary["torques"]) == 3
    assert min(abs(t) for t in summary["torques"]) > 1e-3
    assert len(summary["effector"]["position"]) == 3
    assert np.linalg.norm(summary["effector"]["quaternion"]) == pytest.approx(1, abs=1e-12)
    assert summary["effector"]["quaternion"][3] > 0.9
    assert set(summary["energies"]) == {"kinetic", "strain", "gravity"}
    assert summary["energies"]["strain"] > 1e-3
    assert summary["newton_iterations"] >= summary["parts"] >= 60
    assert summary["halvings"] == 0
    assert 0 < summary["residual"] < 1e-3 * 0.032 * 9.81  # small against the weight
    assert 0 < summary["step_ms"]["median"] <= summary["step_ms"]["p99"]


def test_the_recording_holds_every_step(recorded) -> None:
    summary, arrays, _ = recorded
    nodes = 144
    shapes = {name: a.shape for name, a in arrays.items()}
    faces = shapes.pop("triangles")
    assert shapes == {
        "version": (),
        "scene": (),
        "units": (),
        "time": (60,),
        "positions": (60, nodes, 3),
        "bodies": (1,),
        "energies": (60, 3),
        "effector": (60, 7),
        "angles": (60, 3),
        "arms": (3, 13),
        "slide": (60,),
        "torques": (60, 3),
        "event_times": (0,),
        "event_texts": (0,),
    }
    assert faces[1:] == (3,)
    assert arrays["bodies"].tolist() == [nodes]
    assert 0 <= arrays["triangles"].min() < arrays["triangles"].max() < nodes
    assert all(np.isfinite(a).all() for a in arrays.values() if a.dtype.kind == "f")
    assert json.loads(str(arrays["units"]))["torques"] == "N m"
    assert list(arrays["energies"][-1]) == list(summary["energies"].values())
    np.testing.assert_allclose(arrays["time"], 0.005 * np.arange(1, 61), atol=1e-12)
    share = np.minimum(arrays["time"] / 0.2, 1)
    np.testing.assert_allclose(arrays["angles"], share[:, None] * [-0.4, -0.3, 0.1], atol=1e-12)
    np.testing.assert_allclose(arrays["slide"], share * 0.02, atol=1e-12)  # in proportion with the servos
    assert arrays["effector"][-1].tolist() == [
        *summary["effector"]["position"],
        *summary["effector"]["quaternion"],
    ]
    assert arrays["torques"][-1].tolist() == summary["torques"]
    moves = np.abs(np.diff(arrays["positions"], axis=0)).max(axis=(1, 2))
    assert moves[:39].min() > 1e-4  # while the servos turn, no row twice


def test_two_runs_give_the_same_bits_in_two_processes_and_in_one(recorded, tmp_path: Path) -> None:
    summary, _, first = recorded
    second, third = tmp_path / "second.npz", tmp_path / "third.npz"
    again = run("tripod", duration=0.3, servo=BEND, slide="0.02", overrides=TRIPOD, out=second)
    assert second.read_bytes() == first.read_bytes()
    words = ["run", "tripod", "--json", "--duration", "0.3", "--servo", BEND, "--slide", "0.02"]
    sets = [word for value in TRIPOD for word in ("--set", value)]
    child = subprocess.run(
        [sys.executable, "-m", "tripod_bringup.cli", *words, *sets, "--out", str(third)],
        capture_output=True,
        text=True,
        check=True,
    )
    assert third.read_bytes() == first.read_bytes()
    differing = {"seconds": None, "step_ms": None, "written": None}
    reports = [{**report, **differing} for report in (summary, again, json.loads(child.stdout))]
    assert reports[0] == reports[1] == reports[2]


def test_another_input_gives_other_bits(recorded, tmp_path: Path) -> None:
    other = tmp_path / "other.npz"
    run(
        "tripod",
        duration=0.3,
        servo=BEND.replace("0.1", "0.100001"),
        slide="0.02",
        overrides=TRIPOD,
        out=other,
    )
    assert other.read_bytes() != recorded[2].read_bytes()


def test_the_recording_names_the_scene_with_all_its_values(recorded, tmp_path: Path) -> None:
    path = tmp_path / "again.toml"
    path.write_text(str(recorded[1]["scene"]))
    assert load_scene(path) == load_scene("tripod", [*TRIPOD, "motion=off"])


def test_a_recording_changes_nothing(recorded) -> None:
    alone = run("tripod", duration=0.3, servo=BEND, slide="0.02", overrides=TRIPOD)
    measured = {"seconds": None, "step_ms": None}
    assert {**alone, **measured} == {**recorded[0], **measured}


def test_forces_are_recorded_on_request_and_change_nothing(recorded, tmp_path: Path) -> None:
    out = tmp_path / "run.npz"
    run("tripod", duration=0.3, servo=BEND, slide="0.02", overrides=TRIPOD, out=out, forces=True)
    with np.load(out) as arrays:
        added = set(arrays) - set(recorded[1])
        assert added == {f"force_{name}" for name in ("names", "units", "counts", "points", "vectors")}
        for name in set(recorded[1]) - {"units"}:
            np.testing.assert_array_equal(arrays[name], recorded[1][name], err_msg=name)
        torque = arrays["force_names"].tolist().index("servo torque")
        ends = arrays["force_counts"].ravel().cumsum().reshape(arrays["force_counts"].shape)
        own = np.array([arrays["force_vectors"][end - 3 : end] for end in ends[:, torque]])
        np.testing.assert_allclose(np.linalg.norm(own, axis=2), np.abs(arrays["torques"]), rtol=1e-12)


def test_the_page_has_the_keys_of_a_runs_file() -> None:
    page = (Path(__file__).parents[2] / "docs" / "seeing.md").read_text(encoding="utf-8")
    assert "\n".join(KEYS) in page


@pytest.mark.parametrize("name", scene_names())
def test_every_shipped_scene_runs(name: str, tmp_path: Path) -> None:
    out = tmp_path / "run.npz"
    scene = load_scene(name)
    coarse = ["springs.nodes=5"] if scene.springs else COARSE if scene.mesh else []
    summary = run(name, duration=0.02, overrides=coarse, out=out, forces=True)
    assert summary["steps"] == round(0.02 / scene.dt)
    assert (summary["effector"] is None) == (effector_of(scene) is None)
    assert (
        len(summary["angles"])
        == len(summary["torques"])
        == (len(joints.arms) if (joints := joints_of(scene)) else 0)
    )
    with np.load(out) as arrays:
        assert set(arrays) <= {name for row in KEYS for name in re.findall(r"`(\w+)`", row.split("|")[1])}
        assert ("effector" in arrays) == (effector_of(scene) is not None)
        assert all(np.isfinite(arrays[n]).all() for n in arrays if arrays[n].dtype.kind == "f")
        corners = arrays["vertices" if "vertices" in arrays else "positions"].shape[1]
        assert sum(arrays["bodies"]) == corners > arrays["triangles"].max()
        assert len(arrays["bodies"]) == max(1, len(soft_bodies(scene))) + len(rigids_of(scene))
        assert (arrays["bodies"][0] > 0) == bool(soft_bodies(scene))
        assert ("ball" in arrays) == (scene.ball is not None)
        assert ("weight" in arrays["force_names"]) == (scene.gravity is not None)
        assert ("servo torque" in arrays["force_names"]) == (arrays["torques"].size > 0)
        assert ("cable tension" in arrays["force_names"]) == bool(scene.cable)
        assert any(name.startswith("normal force") for name in arrays["force_names"]) == bool(
            scene.contact or scene.obstacles or scene.ball
        )
        assert ("maze_vertices" in arrays) == (scene.maze is not None)
        assert ("still_vertices" in arrays) == bool(scene.obstacles)
        assert ("rigid" in arrays) == bool(rigids_of(scene))


def steps(**options: Any) -> int:
    """Return how many steps a run makes, at a step so long that they are few."""
    return run("tripod", **{"overrides": [*TRIPOD, "motion=off", "dt=0.1", "duration=0.3"], **options})[
        "steps"
    ]


def test_the_duration_is_what_is_asked_or_a_second_after_the_last_command_or_the_scenes() -> None:
    assert steps() == 3
    assert steps(duration=0.2) == 2
    assert steps(duration=0.01) == 1
    assert steps(servo="0:0,0,0; 0.5:0,0,-0.1") == 15
    assert steps(servo="0:0,0,-0.1") == 3
    assert steps(slide="0:0; 0.4:0.001") == 14


def test_a_run_starts_at_rest_where_its_timelines_begin(tmp_path: Path) -> None:
    out = tmp_path / "run.npz"
    servo, slide = "0.5:-0.5,-0.4,-0.3", "0.1:0.015"
    summary = run("tripod", duration=0.05, servo=servo, slide=slide, overrides=TRIPOD, out=out)
    assert summary["energies"]["kinetic"] < 1e-9
    with np.load(out) as a:
        assert a["angles"][0].tolist() == [-0.5, -0.4, -0.3]
        assert a["slide"].tolist() == [0.015] * 10
        assert np.abs(a["positions"] - a["positions"][0]).max() < 1e-6


def test_progress_rises_to_one() -> None:
    seen: list[float] = []
    run("tripod", duration=0.025, overrides=TRIPOD, progress=seen.append)
    assert seen == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"servo": "0:0,0,0; 1:0,0,0.7"}, ("--servo", "servo_2", "0 to 0.7 rad", "-2.1 to 0.6 rad")),
        ({"servo": "0:0,0,-2.2"}, ("--servo", "servo_2", "-2.2 to -2.2 rad", "-2.1 to 0.6 rad")),
        ({"servo": "0:0,0"}, ("--servo", "'0:0,0'", "'time: value, ...'", "3 finite values")),
        ({"slide": "0.05"}, ("--slide", "0.05 to 0.05 m", "0 to 0.04 m")),
        ({"slide": "0:0; 1:-0.001"}, ("--slide", "-0.001 to 0 m", "0 to 0.04 m")),
        ({"slide": "far"}, ("--slide", "'far'", "number")),
        ({"duration": 0.0}, ("duration", "0 s", "positive", "at most 5e+06 s")),
        ({"duration": -1.0}, ("duration", "-1 s", "positive")),
        ({"duration": float("nan")}, ("duration", "nan s", "positive")),
        ({"duration": float("inf")}, ("duration", "inf s", "positive")),
        ({"duration": 1e8}, ("duration", "1e+08 s", "positive", "at most 5e+06 s", "1000000000 steps", "dt")),
        ({"servo": "0:0,0,0; 1e300:0,0,0"}, ("duration", "1e+300 s")),
        ({"overrides": ["dt=1e-300"]}, ("dt", "1e-300", "at least 1e-09 s", "at most 1 s")),
        ({"overrides": ["mesh.level=15"]}, ("mesh.level", 15)),
        ({"scene": "silicone", "servo": "0:0,0,0"}, ("--servo", "'silicone'", "no servos")),
        ({"scene": "silicone", "slide": "0.01"}, ("--slide", "'silicone'", "no servos")),
        ({"scene": EMIO, "slide": "0.01", "overrides": []}, ("--slide", "'emio'", "no servo")),
        ({"scene": "tripot"}, ("scene 'tripot'", "unknown")),
    ],
)  # fmt: skip
def test_bad_options_are_refused_before_the_first_step(
    options: dict[str, Any], named: tuple[object, ...]
) -> None:
    assert_names(refusal(**options), *named)


def test_a_recording_too_large_for_memory_is_refused(tmp_path: Path) -> None:
    out = tmp_path / "run.npz"
    assert_names(refusal(duration=25e3, out=out), "18.0 GB", "allowed: 4 GB", "--duration", "dt")
    assert not list(tmp_path.iterdir())


def test_a_place_that_cannot_be_written_is_refused_before_the_first_step(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("kept")
    (tmp_path / "folder.npz").mkdir()
    for out, reason in (
        (tmp_path / "gone" / "run.npz", "no directory"),
        (tmp_path / "file" / "run.npz", "Not a directory"),
        (tmp_path / "folder.npz", "is a directory"),
        (tmp_path / ("n" * 256 + ".npz"), "File name too long"),
        (tmp_path / "a\0b.npz", "embedded null byte"),
        (Path("/proc/run.npz"), "written"),
    ):
        assert_names(refusal(out=out), "--out", "cannot be written", reason)
    assert (tmp_path / "file").read_text() == "kept"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder.npz"]


@pytest.mark.parametrize("name", ["run.csv", "run", "run.npz.gz", "."])
def test_another_suffix_is_refused(name: str, tmp_path: Path) -> None:
    assert_names(refusal(out=tmp_path / name), "--out", "end in .npz")
    assert not list(tmp_path.iterdir())


def test_a_full_disk_is_said_and_leaves_the_older_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "run.npz"
    out.write_text("older")

    def fail(file: Any, **_: Any) -> None:
        file.write(b"half")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("numpy.savez", fail)
    with raises_naming(SceneError, "--out", f"'{out}'", "cannot be written", "no space left"):
        run("tripod", duration=0.01, overrides=TRIPOD, out=out)
    assert [p.name for p in tmp_path.iterdir()] == ["run.npz"]
    assert out.read_text() == "older"


def test_a_finished_run_replaces_the_older_file_whole(tmp_path: Path) -> None:
    out = tmp_path / "run.npz"
    out.write_text("older")
    run("tripod", duration=0.01, overrides=TRIPOD, out=out)
    assert [p.name for p in tmp_path.iterdir()] == ["run.npz"]
    with np.load(out) as arrays:
        assert len(arrays["time"]) == 2


@pytest.mark.parametrize("error", [StepError("element 3 is crushed"), KeyboardInterrupt()])
def test_a_run_that_breaks_off_keeps_the_steps_it_made(
    error: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Breaking(run_module.Simulation):
        def step(self, joints: Any = None) -> Any:
            if self.state.step == 4:
                raise error
            return super().step(joints)

    monkeypatch.setattr(run_module, "Simulation", Breaking)
    whole, broken = tmp_path / "whole.npz", tmp_path / "broken.npz"
    with pytest.raises(type(error)):
        run("tripod", duration=0.05, servo=BEND, overrides=TRIPOD, out=broken)
    monkeypatch.undo()
    run("tripod", duration=0.05, servo=BEND, overrides=TRIPOD, out=whole)
    with np.load(broken) as a, np.load(whole) as b:
        assert len(a["time"]) == 4
        for name in b:
            moving = b[name].shape[:1] == b["time"].shape
            np.testing.assert_array_equal(a[name], b[name][:4] if moving else b[name])


def test_a_run_that_breaks_off_at_once_writes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def crush(*_: Any) -> None:
        raise StepError("element 3 is crushed")

    monkeypatch.setattr(run_module.Simulation, "step", crush)
    with pytest.raises(StepError, match="element 3 is crushed"):
        run("tripod", duration=0.05, overrides=TRIPOD, out=tmp_path / "run.npz")
    assert not list(tmp_path.iterdir())


def test_a_static_run_counts_the_increments_of_its_load() -> None:
    result = run("silicone", duration=0.01, overrides=["inertia=off", "damping=off", *COARSE])
    assert result["increments"] > 5
    assert result["newton_iterations"] == result["increments"]
    assert run("tripod", duration=0.01, overrides=TRIPOD)["increments"] == 0


STILL = {"stack": "it stands", "cook": "it rises by a thousandth of a millimetre"}
"""Scenes whose point is that nothing moves."""


@pytest.mark.parametrize("name", sampled(scene_names(), *(n for n in scene_names() if n != "tripod_cloth")))
def test_every_shipped_scene_shows_its_point_by_itself(name: str) -> None:
    """Something moves by a tenth of the body's size in the first second; of a robot on wide feet by a twentieth."""
    coarse = ["mesh.level=5"] if name == "tripod_sofa" else COARSE if load_scene(name).mesh else []
    coarse += ["springs.nodes=8"] if name == "cloth" else []
    kept: list[Any] = []
    duration = 0.4 if name in ("drape", "drape_cubes") else 1.0
    run(name, duration=duration, overrides=coarse, recorded=kept.append)
    arrays = kept[0].arrays()
    first = arrays["positions"][0]
    size = float(np.linalg.norm(np.ptp(first, axis=0)))
    moves = np.abs(arrays["positions"] - first).max()
    if "ball" in arrays:
        moves = max(moves, np.ptp(arrays["ball"][:, :3], axis=0).max())
    if name in STILL:
        assert moves < 0.02 * size
    else:
        assert moves > (0.05 if name == "diamond" else 0.1) * size


def test_a_servo_timeline_takes_the_place_of_the_scenes_motion(tmp_path: Path) -> None:
    def angles(**options: Any) -> np.ndarray:
        run(
            "tripod",
            duration=0.1,
            overrides=options.pop("overrides", TRIPOD),
            out=tmp_path / "run.npz",
            **options,
        )
        with np.load(tmp_path / "run.npz") as arrays:
            assert ("[motion]" in str(arrays["scene"])) == (not options and bool(arrays["angles"].any()))
            return np.asarray(arrays["angles"][-1])

    assert angles() == pytest.approx(3 * [-1.4965 / 8])
    assert angles(servo="0:0,0,0; 0.1:0,0,-0.3") == pytest.approx([0, 0, -0.3])
    assert not angles(slide="0:0; 0.1:0.001").any()
    assert not angles(overrides=[*TRIPOD, "motion=off"]).any()
    assert angles(
        overrides=[*TRIPOD, 'motion.servo="0:0,0,0; 0.1:0,0,-0.2"', 'motion.slide="0"']
    ) == pytest.approx([0, 0, -0.2])


def test_only_a_run_takes_notice_of_the_motion() -> None:
    moved = load_scene("tripod", TRIPOD)
    assert moved.motion
    states = []
    for scene in (moved, replace(moved, motion=None)):
        simulation = run_module.Simulation(scene)
        simulation.advance(5)
        states.append(simulation.state)
    assert not states[0].joints.any()
    np.testing.assert_array_equal(states[0].positions, states[1].positions)
    assert repr(moved) == repr(replace(moved, motion=None)), "names of stored things do not change with it"


@pytest.mark.parametrize(
    ("override", "named"),
    [
        (
            'motion.servo="0:0,0"',
            ("motion.servo", "'0:0,0'", "'time: value, ...'", "3 finite values", "give --servo"),
        ),
        (
            'motion.servo="0:0,0,9"',
            (
                "motion.servo",
                "servo_2",
                "9 to 9 rad",
                "-2.1 to 0.6 rad",
                "9deg",
                "9deg",
                "give --servo",
            ),
        ),
        (
            'motion.slide="far"',
            ("motion.slide", "'far'", "m", "mm", "cm", "'time: value; ...'", "give --servo"),
        ),
        ("servos.angle_min=-1.5", ("-1.5 to 0.6 rad", "give --servo", "--set motion=off")),
    ],
)
def test_a_motion_that_cannot_be_is_refused_by_a_run_and_by_nothing_else(
    override: str, named: tuple[str, ...]
) -> None:
    assert_names(refusal(overrides=[override]), *named)
    assert load_scene("tripod", [override]).motion


def test_a_scene_without_its_servos_runs_without_its_motion() -> None:
    words = ["servos=off", "clamp=off", "fixed=[{low=[0.045,-1,-1],high=[1,1,1]}]", *TRIPOD]
    assert run("tripod", duration=0.01, overrides=words)["steps"] == 2


def test_what_is_built_is_told_with_its_size_until_the_first_step() -> None:
    said: list[str] = []
    result = run(
        "tripod", duration=0.005, overrides=TRIPOD, say=said.append, progress=lambda _: said.append("step")
    )
    simulation = Simulation(load_scene("tripod", TRIPOD))
    elements, nodes = len(simulation.mesh.elements), len(simulation.mesh.nodes)
    unknowns = simulation._system.unknowns
    told = [
        ("mesh", "'y_piece'"),
        (f"{elements} elements", f"{nodes} nodes"),
        ("order", f"{elements} elements"),
        ("first step", f"{elements} elements", f"{unknowns} unknowns"),
        ("rest", "start"),
        ("first step",),
    ]
    for line, named in zip(said[:-2], told, strict=True):
        assert_names(line, *named)
    assert said[-2:] == ["", "step"]
    assert "notes" not in result


def test_an_estimate_larger_than_the_body_is_told_to_be_none() -> None:
    words = ["inertia.scheme=tr_bdf2", "time_error={}"]
    assert "notes" not in run("pendulum", duration=1.0, overrides=words)
    (note,) = run("pendulum", duration=3.0, overrides=words)["notes"]
    assert_names(note, "error", "time steps", "size of the body", "1e+03 mm")


def test_what_is_wrong_in_building_names_the_file_of_the_scene(tmp_path: Path) -> None:
    path = tmp_path / "loose.toml"
    scene = scene_text("silicone").partition("[inertia]")[0]
    path.write_text(f"{scene}\n[[fixed]]\nlow = [1.0, 1.0, 1.0]\nhigh = [2.0, 2.0, 2.0]\n", encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        run(str(path), duration=0.1)
    assert str(caught.value).startswith(f"{path}, line {scene.count(chr(10)) + 2}: fixed")
    assert str(caught.value).count(str(path)) == 1
    with pytest.raises(SceneError) as caught:  # a shipped scene is no file of the user
        run("silicone", duration=0.1, overrides=["inertia=off", "damping=off", "fixed=[]"])
    assert ".toml" not in str(caught.value)


def test_a_static_run_tells_the_error_of_the_pose_that_it_tells() -> None:
    """Estimates on the way are as many as the machine is fast."""
    words = [*COARSE, *REST[:2], "clamp.stiffness=1.4e10", "mesh_error.share=1e6"]
    error = run(
        "tripod", duration=0.2, servo="0:0,0,0; 0.1:-0.8,-0.8,-0.8; 0.2:-0.1,-0.1,-0.1", overrides=words
    )
    found = error["mesh_error"]
    assert 0.0 < found["distance"] == found["largest"] == found["largest_with_steps"]
