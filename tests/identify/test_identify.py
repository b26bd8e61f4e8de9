"""Values are found with honest bars, robustly; what the data cannot tell, or the model not explain, is said."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tests.identify.robots import BEAM, MOVING, POSE, beam, commands, measured, tripod, write_csv
from tests.messages import assert_names, line_naming, lines_naming, names, raises_naming
from tripod_identify.csv_columns import Channel
from tripod_identify.errors import DataError, FitError
from tripod_identify.fit import Prior, _in_step, _sigma, _Weights, fit, profile
from tripod_identify.identify import Wanted, _too_far, beginning, held_rows, identify
from tripod_identify.measured import Measured
from tripod_identify.model import Told, plainly, predict
from tripod_identify.observe import Sensor
from tripod_identify.parameters import parameters, told
from tripod_identify.problem import Problem
from tripod_sim import load_scene
from tripod_sim.scene.file import scene_from_toml
from tripod_sim.tables.sets import Load, NodeSet

TIP = tuple(Channel("tip", axis) for axis in range(3))
NOISE = (3e-4, np.radians(0.5))
QUICK = {"mesh": False, "propose": False}


def robot(scene, values: dict[str, float]) -> Told:
    wanted = parameters(scene, list(values))
    return told(plainly(scene), wanted, np.array([p.to_u(values[p.name]) for p in wanted]))


TRUTH = {"servos.zero.0": 0.03, "servos.zero.1": -0.02, "servos.zero.2": 0.05, "servos.slide": 0.025}


@pytest.fixture(scope="module")
def poses() -> Measured:
    """Twenty poses of a Tripod with other zeros and slide, with noise."""
    return measured(robot(tripod("servos.slide=0.02"), TRUTH), commands(20)[0], None, noise=NOISE)


def test_values_are_found_within_their_bars(poses: Measured) -> None:
    scene = tripod("servos.slide=0.02")
    result = identify(scene, poses, (), Wanted(("servos.zero", "servos.slide"), **QUICK))
    assert [f.parameter.name for f in result.found] == list(TRUTH)
    for f in result.found:
        width = f.high - f.low
        assert abs(f.value - TRUTH[f.parameter.name]) < width, "twice the 90 % interval"
        assert width < 0.03, "told closely"
    assert result.untold == ()
    assert result.left.explained
    assert result.fit.sigma == pytest.approx(NOISE, rel=0.25)
    assert result.after.distance.mean < 0.2 * result.before.distance.mean


def test_a_frame_that_lies_upside_down_is_found() -> None:
    scene = tripod("servos.slide=0.02")
    truth = robot(scene, {"servos.zero.0": 0.03, "mount.x": 0.004})
    camera = Sensor(np.array([0.01, -0.02, 0.3]), np.array([3.0, 0.2, -0.4]), truth.sensor.mount)
    data = measured(replace(truth, sensor=camera), commands(10)[0], None, channels=POSE[:3])
    result = identify(scene, data, (), Wanted(("servos.zero.0", "mount.x"), "rigid", **QUICK))
    assert [f.value for f in result.found] == pytest.approx([0.03, 0.004], abs=1e-5)
    assert result.after.distance.largest < 1e-7


def test_of_few_rows_those_that_are_fitted_anyway_do_not_tell_the_size_of_errors() -> None:
    places, rotations = [0.0] * 5 + [1e-3, -1e-3, 2e-3, 1e-3, -2e-3], [0.02, -0.02] * 5
    weights = _Weights(np.ones((10, 2), dtype=bool), np.array([False, True]))
    found = _sigma(np.column_stack([places, rotations]), weights, 10)
    np.testing.assert_allclose(found, [1e-3 / 0.6745, 0.02 / 0.6745])


@pytest.mark.parametrize(
    ("move", "variance", "times"),
    [(0.9, 1.0, ""), (1.1, 1.0, "1.1 times"), (0.0, -1e-9, "0 times"), (np.nan, 1.0, "nan times")],
)
def test_what_other_meshes_make_is_not_believed_far_from_where_it_was_found(
    move: float, variance: float, times: str
) -> None:
    wanted = parameters(tripod(), ["servos.zero.0"])
    share = SimpleNamespace(move=np.array([move]))
    both = SimpleNamespace(mesh=share, step=None, covariance=np.array([[variance]]))
    why = _too_far(both, SimpleNamespace(wanted=wanted))
    assert bool(why) == bool(times)
    if times:
        assert_names(why, "servos.zero.0", times, "plausible range")


def test_exact_data_give_back_the_values_exactly() -> None:
    scene = tripod("servos.slide=0.02")
    data = measured(robot(scene, {**TRUTH, "material.young": 180e3}), commands(8)[0], None)
    result = identify(scene, data, (), Wanted(("material.young", "servos.zero", "servos.slide"), **QUICK))
    found = {f.parameter.name: f.value for f in result.found}
    assert found.pop("material.young") == pytest.approx(180e3, rel=1e-3)
    assert found == pytest.approx(TRUTH, abs=1e-5)


def test_wrong_rows_do_not_move_the_modulus() -> None:
    scene = tripod("servos.slide=0.02", "material.mass=0.1")  # heavy, so that weight tells the modulus
    data = measured(robot(scene, {"material.young": 300e3}), commands(40)[0], None, noise=NOISE)
    wrong = data.values.copy()
    wrong[[7, 23], :3] += [[0.0, 0.0, 0.02], [0.02, 0.0, 0.0]]
    values = []
    for rows in (data, replace(data, values=wrong)):
        result = identify(scene, rows, (), Wanted(("material.young",), **QUICK))
        values.append(result.found[0].value)
        assert result.found[0].low < 300e3 < result.found[0].high
    assert values[1] == pytest.approx(values[0], rel=0.02)
    assert values[1] != values[0]
    assert {8, 24} <= set(result.fit.outliers)
    assert len(result.fit.outliers) < 4
    line_naming("\n".join(result.notes), f"{len(result.fit.outliers)} of 40 rows", "6 standard deviations")


@pytest.mark.slow
def test_five_in_a_hundred_wrong_poses_do_not_move_the_modulus_of_a_robot() -> None:
    """Of which zeros and slide are not known either; all that is wrong lies to one side, which is worst."""
    disc = NodeSet("disc", axis=(0.0, 0.0, 1.0), radius=0.0075)
    scene = tripod("servos.slide=0.02", "mesh.level=1")  # this weight snaps it on the scene's own, so coarse
    scene = replace(
        scene, set=(disc,), load=(Load("disc", mass=0.1, share="even"),)
    )  # its weight tells the modulus
    truth = robot(scene, {**TRUTH, "material.young": 300e3})
    data = measured(truth, commands(40, seed=5)[0], None, noise=NOISE)
    wanted = Wanted(("material.young", "servos.zero", "servos.slide"), **QUICK)
    right = identify(scene, data, (), wanted).found[0].value
    for bad, off in (((3, 30), (0.0, 0.0, -0.02)), ((11, 12), (0.012, -0.016, 0.0))):
        values = data.values.copy()
        values[list(bad), :3] += off
        result = identify(scene, replace(data, values=values), (), wanted)
        assert result.found[0].value == pytest.approx(right, rel=0.02)
        assert result.fit.outliers == tuple(k + 1 for k in bad)
        line_naming("\n".join(result.notes), "2 of 40 rows", "6 standard deviations")


def test_a_column_in_another_unit_is_named(poses: Measured) -> None:
    wrong = replace(poses, values=poses.values * np.where(np.arange(6) == 2, 1000.0, 1.0))
    result = identify(tripod("servos.slide=0.02"), wrong, (), Wanted(("servos.zero",), **QUICK))
    notes = "\n".join(result.notes)
    line_naming(notes, "effector.z", "6 standard deviations", "20 of 20 rows", "unit", "--align")
    assert not lines_naming(notes, "effector.x")


def sagging(loads: list[float], truth: dict[str, float], noise: float = 0.0) -> Measured:
    """A beam in motion: it falls from its undeformed shape."""
    scene = beam(MOVING)
    data = Measured(np.arange(0, 0.4, 0.01), None, None, TIP, np.zeros((40, 3)))
    values = predict(robot(scene, truth), data, ())
    return replace(data, values=values + noise * np.random.default_rng(4).standard_normal(values.shape))


def test_a_motion_tells_modulus_and_damping_and_its_end_is_foretold() -> None:
    data = sagging([], {"material.young": 240e3, "damping.stiffness": 8e-3}, 1e-4)
    wanted = Wanted(("material.young", "damping.stiffness"), hold_out=0.2, mesh=False)
    result = identify(beam(MOVING), data, (), wanted)
    young, damping = result.found
    assert young.value == pytest.approx(240e3, rel=0.01)
    assert damping.value == pytest.approx(8e-3, rel=0.05)
    assert result.held_out.tolist() == [False] * 32 + [True] * 8
    assert result.held_after.distance.mean < 3e-4 < result.held_before.distance.mean


def test_where_a_motion_begins_is_seen() -> None:
    values = np.array([[0.0, 0.0], [1e-4, 5e-5], [2e-4, 0.0], [5e-3, 0.0], [1e-2, 0.0], [2e-3, 0.0]])
    assert beginning(Measured(0.1 * np.arange(6), None, None, TIP[:2], values)) == pytest.approx(0.2)
    assert beginning(Measured(None, None, None, TIP[:2], values)) == 0.0
    values[0], values[1, 1] = np.nan, np.nan  # nothing was seen at first
    assert beginning(Measured(0.1 * np.arange(6), None, None, TIP[:2], values)) == pytest.approx(0.2)


def test_what_only_counts_together_is_not_told_apart() -> None:
    """At rest a beam under its own weight depends on E / density alone."""
    scene = scene_from_toml(BEAM.replace('[[load]]\nset = "tip"\nmass = 0.02\n', ""))
    data = Measured(None, None, None, TIP, np.zeros((4, 3)))
    values = predict(robot(scene, {"material.young": 240e3}), data, ())
    data = replace(data, values=values + 1e-5 * np.random.default_rng(4).standard_normal(values.shape))
    result = identify(scene, data, (), Wanted(("material.young", "material.density"), mesh=False))
    assert [f.parameter.name for f in result.found] == ["material.young"]
    assert result.found[0].value == pytest.approx(240e3, rel=0.01)
    assert result.untold[0].parameter.name == "material.density"
    assert_names(result.untold[0].why, "material.young", "the same effect")
    known = {"material.density": Prior(1070.0, 20.0)}
    both = identify(scene, data, (), Wanted(("material.young", "material.density"), priors=known, mesh=False))
    assert not both.untold
    young = both.found[0]
    assert (young.high - young.low) / young.value == pytest.approx(2 * 1.8 * 20 / 1070, rel=0.2), (
        "the prior's share"
    )


def test_a_value_without_any_say_is_not_told() -> None:
    scene, data = beam(), Measured(None, None, None, TIP, np.zeros((4, 3)))
    data = replace(data, values=predict(plainly(scene), data, ()) + 1e-5 * np.eye(4, 3))
    with raises_naming(FitError, "none", "solver.linear_tolerance"):
        identify(scene, data, (), Wanted(("solver.linear_tolerance",), mesh=False))


def test_a_value_at_its_bound_is_not_told(poses: Measured) -> None:
    data = measured(robot(tripod(), {"servos.slide": 0.0}), commands(8)[0] * 0.3, None)
    biased = replace(data, values=data.values - 1e-4 * (np.arange(6) == 2))
    result_of = lambda names: identify(tripod("servos.slide=0.001"), biased, (), Wanted(names, **QUICK))  # noqa: E731
    with raises_naming(FitError, "servos.slide", "limit", "0 m"):
        result_of(("servos.slide",))


def test_fewer_numbers_than_values_are_refused() -> None:
    scene, (angles, _) = tripod(), commands(1)
    data = Measured(None, angles, None, (Channel("effector", 2),), np.zeros((1, 1)))
    names = [f"servos.zero.{i}" for i in range(3)]
    with raises_naming(DataError, "1 measured numbers", "3 values", *names, "more rows", "fit fewer"):
        identify(scene, data, (), Wanted(("servos.zero",), **QUICK))


def test_nothing_and_wrong_priors_are_refused(poses: Measured) -> None:
    fit = ("material.young",)
    for wanted, named in (
        (Wanted(()), ("--fit", "material.young")),
        (Wanted(fit, priors={"material.mass": Prior(1, 1)}), ("--prior material.mass", "not among")),
        (Wanted(fit, priors={"material.young": Prior(-1, 1)}), ("material.young", -1, "above 0 Pa")),
        (Wanted(fit, hold_out=0.7), ("--hold-out", 0.7, "0 to 0.5")),
    ):
        with raises_naming(DataError, *named):
            identify(tripod(), poses, (), wanted)


def test_exchanged_motors_are_not_explained(poses: Measured) -> None:
    wrong = replace(poses, commands=poses.commands[:, [1, 0, 2]])
    result = identify(tripod("servos.slide=0.02"), wrong, (), Wanted(("servos.slide",), **QUICK))
    assert not result.left.explained
    assert_names(result.left.note, "model", "not explain", "%")
    assert result.left.note in result.notes


def test_what_was_known_before_and_is_contradicted_is_said(poses: Measured) -> None:
    names = ("servos.zero", "servos.slide")
    for prior, noted in ((Prior(0.025, 5e-4), False), (Prior(0.018, 5e-5), True)):
        wanted = Wanted(names, priors={"servos.slide": prior}, **QUICK)
        notes = identify(tripod("servos.slide=0.02"), poses, (), wanted).notes
        contradicted = lines_naming("\n".join(notes), "--prior", "servos.slide", "standard deviations")
        assert len(contradicted) == noted
        assert all("servos.slide = 0.02" in line for line in contradicted)


def test_score_and_a_report_without_values_say_that_data_are_not_explained(
    poses: Measured, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from tripod_bringup.identify_command import identify_command
    from tripod_bringup.score_command import score_command

    page = tmp_path / "report.html"
    more = {
        "align": "none", "points": [], "renames": [], "poses": False, "report": page, "as_json": True, "quiet": True,
        "overrides": ["mesh.element=h8_modes", "servos.slide=0.025"],
    }  # fmt: skip
    alone = {
        "fit": ["solver.linear_tolerance"], "priors": [], "hold_out": "0", "mesh": False, "profile": False,
        "propose": False, "candidates": None, "out": None,
    }  # fmt: skip
    own = measured(plainly(tripod("servos.slide=0.025")), commands(20)[0], None, noise=NOISE)
    for data, explained in ((own, True), (replace(own, commands=own.commands[:, [1, 0, 2]]), False)):
        path = write_csv(tmp_path / "poses.csv", data)
        assert score_command("tripod", path, plot=None, **more) == 0
        shown = capsys.readouterr()
        rest = json.loads(shown.out)["rest"]
        assert rest["explained"] == explained
        share = f"{100 * (rest['systematic'] / rest['rms']) ** 2:.0f} %"
        named = ("model", "not explain", share)
        notes = lines_naming(shown.err, "note", *named)
        assert len(notes) == names(page.read_text(), *named) == (not explained)
        assert identify_command("tripod", path, **more, **alone) == 1
        *shown, untold = capsys.readouterr().err.splitlines()
        untold_names = ("none", "solver.linear_tolerance")
        assert_names(untold, "tripod identify: ", *untold_names)
        notes = lines_naming("\n".join(shown), *named)
        assert len(notes) == names(page.read_text(), *named) == (not explained)
        assert_names(page.read_text(), *untold_names)


def test_a_coarse_mesh_is_told_and_taken_off() -> None:
    """Data of a beam of finer elements of another kind."""
    scene = scene_from_toml(BEAM.replace("[6, 2, 2]", '[12, 4, 4]\nelement = "h20"'))
    data = Measured(None, None, None, TIP[2:], np.zeros((12, 1)))
    values = predict(robot(scene, {"material.young": 240e3}), data, ())
    values = values + 1e-5 * np.random.default_rng(4).standard_normal((12, 1))
    result = identify(beam(), replace(data, values=values), (), Wanted(("material.young",)))
    found = result.found[0]
    wrong, rid = abs(found.value / 240e3 - 1), abs(found.true / 240e3 - 1)
    assert wrong > 0.01
    assert rid < 0.5 * wrong
    assert found.true_low < 240e3 < found.true_high
    assert not found.low < 240e3 < found.high, "noise alone does not cover it"


def test_the_profile_agrees_where_all_is_linear(poses: Measured) -> None:
    scene = tripod("servos.slide=0.02")
    wanted = parameters(scene, ["servos.zero.0", "frame.z"])
    problem = Problem(
        robot(scene, {k: v for k, v in TRUTH.items() if k != "servos.zero.0"}), wanted, poses, ()
    )
    last = fit(problem, np.ones(20, dtype=bool))
    low, high = profile(last, problem, 0)
    assert low == pytest.approx(last.u[0] - last.half[0], abs=0.15 * last.half[0])
    assert high == pytest.approx(last.u[0] + last.half[0], abs=0.15 * last.half[0])


def test_rows_held_out_are_spread() -> None:
    data = Measured(None, None, None, TIP, np.zeros((10, 3)))
    assert np.flatnonzero(held_rows(data, 0.2)).tolist() == [2, 7]
    assert not held_rows(data, 0).any()


def test_the_command_writes_scene_and_report_and_proposes(
    poses: Measured, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from tripod_bringup.identify_command import identify_command

    path = write_csv(tmp_path / "poses.csv", poses.rows(np.arange(20) < 8))
    (tmp_path / "c.csv").write_text(
        "servo_0_deg,servo_1_deg,servo_2_deg\n" + "-30,-30,-30\n-80,-20,-20\n" * 2
    )
    more = {
        "fit": ["servos.zero.0", "servos.slide"], "align": "translation", "priors": [], "hold_out": "25%",
        "overrides": ["mesh.element=h8_modes", "servos.slide=0.02"], "points": [], "renames": [], "poses": False,
        "mesh": False, "profile": False, "propose": True, "candidates": tmp_path / "c.csv",
        "out": tmp_path / "robot.toml", "report": tmp_path / "r.html",
    }  # fmt: skip
    assert identify_command("tripod", path, as_json=True, quiet=True, **more) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found["found"]) == {"servos.zero.0", "servos.slide"}
    assert set(found["alignment"]) == {"frame.x", "frame.y", "frame.z"}
    assert len(found["proposals"]) == 3
    scene = load_scene(tmp_path / "robot.toml")
    assert scene.servos.slide == found["found"]["servos.slide"]["value"] != 0.02
    page = (tmp_path / "r.html").read_text()
    assert_names(page, "held out, after", "Poses", "Condition", "scaled Jacobian", "data:image/png")
    wrong = {"out": tmp_path / "robot.txt"}, {"priors": ["a=1"]}, {"hold_out": "much"}, {"fit": []}
    for changed in wrong:
        assert identify_command("tripod", path, as_json=True, quiet=True, **more | changed) == 2
    said = capsys.readouterr().err.splitlines()
    assert [line.split(":")[0] for line in said] == ["tripod identify"] * 4
    assert_names(said[0], "--out", "robot.txt", ".toml")
    assert_names(said[1], "--prior", "'a=1'", "NAME=VALUE~SD")
    assert_names(said[2], "--hold-out", "'much'", "20%", "0.2")
    assert_names(said[3], "--fit", "material.young")


def test_a_motion_that_begins_out_of_step_is_found() -> None:
    """A modulus five times too low: its swing takes twice as long, and it is found in several rounds."""
    scene = scene_from_toml(MOVING.replace("200e3", "50e3"))
    data = Measured(np.arange(0, 0.3, 0.01), None, None, TIP, np.zeros((30, 3)))
    values = predict(robot(scene, {"material.young": 240e3}), data, ())
    data = replace(data, values=values + 1e-4 * np.random.default_rng(4).standard_normal(values.shape))
    result = identify(scene, data, (), Wanted(("material.young", "damping.stiffness"), mesh=False))
    assert result.found[0].value == pytest.approx(240e3, rel=0.01)
    assert result.fit.sigma[0] == pytest.approx(1e-4, rel=0.3)


@pytest.mark.slow
def test_beginnings_of_a_motion_spare_most_predictions_of_all_of_it() -> None:
    scene = scene_from_toml(MOVING.replace("200e3", "25e3"))
    data = Measured(np.arange(0, 1.2, 0.02), None, None, TIP, np.zeros((60, 3)))
    values = predict(robot(scene, {"material.young": 240e3}), data, ())
    data = replace(data, values=values + 1e-4 * np.random.default_rng(4).standard_normal(values.shape))
    wanted, predictions = parameters(scene, ["material.young", "damping.stiffness"]), []
    for at_once in (False, True):
        problem = Problem(plainly(scene), wanted, data, ())
        found = fit(problem, np.ones(60, dtype=bool), start=problem.start() if at_once else None)
        assert np.exp(found.u[0]) == pytest.approx(240e3, rel=1e-3)
        predictions.append(problem.evaluations)
    assert predictions[0] < 0.5 * predictions[1]


def test_a_motion_is_fitted_from_its_beginning_on() -> None:
    """Half of it brings the values close, whatever comes after."""
    scene = scene_from_toml(MOVING.replace("200e3", "90e3"))
    data = Measured(np.arange(0, 0.6, 0.02), None, None, TIP, np.zeros((30, 3)))
    values = predict(robot(scene, {"material.young": 240e3}), data, ())
    values[16:] = 7.0
    wanted = parameters(scene, ["material.young", "damping.stiffness"])
    problem = Problem(plainly(scene), wanted, replace(data, values=values), ())
    assert np.exp(_in_step(problem, np.ones(30, dtype=bool), {})[0]) == pytest.approx(240e3, rel=0.02)


@pytest.mark.slow
def test_errors_of_a_motion_that_hang_together_are_told() -> None:
    data = sagging([], {"material.young": 240e3}, 1e-4)
    wave = 1e-3 * np.sin(2 * np.pi * 8 * data.times)[:, None] * [1.0, 0.0, 1.0]
    wanted = Wanted(("material.young", "damping.stiffness"), mesh=False)
    notes = [
        identify(beam(MOVING), d, (), wanted).notes for d in (data, replace(data, values=data.values + wave))
    ]
    told = [lines_naming("\n".join(own), "rows", "close in time", "times as long") for own in notes]
    assert not told[0]
    assert len(told[1]) == 1
