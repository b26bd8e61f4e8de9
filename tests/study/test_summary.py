"""The figures of accuracy, effects and stability: what pages show and summaries tell."""

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tripod_study
from tests.messages import assert_names, names, raises_naming
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.effects import EFFECTS, words
from tripod_sim.integrators.report import MeshErrorReport, StepReport
from tripod_sim.integrators.time_error import TimeErrorReport
from tripod_sim.simulation import Energies
from tripod_study.accuracy.choice import percent
from tripod_study.summary.accuracy import WISHES, accuracy_summary
from tripod_study.summary.effects import effect_summary
from tripod_study.summary.energy import EnergyBooks, total
from tripod_study.summary.errors import LargestErrors, effector_error, errors_line, mesh_error
from tripod_study.summary.picture import picture
from tripod_study.summary.stability import stability, stability_lines

STILL = np.zeros(4)

STUDIES = Path(str(tripod_study.__file__)).parent / "studies"


def run(scene: str, steps: int, *overrides: str, joints: object = None) -> tuple[Simulation, EnergyBooks]:
    """Return a simulation after some steps, and its books; `joints`: a function of the time."""
    s = Simulation(load_scene(scene, overrides))
    books = EnergyBooks(s.energies(), s.state.joints, s.efforts)
    for k in range(steps):
        s.step(joints((k + 1) * s.scene.dt) if joints else None)
        books.add(s.energies(), s.state.joints, s.efforts, s.state.time)
    return s, books


def test_servos_put_in_what_the_body_has_gained_and_lost() -> None:
    """Quasi-static bending without damping loses nothing: the work of the torques is the change of the potential."""
    turn = lambda t: np.array([-0.3 * t / 0.5] * 3 + [0.0])  # noqa: E731
    words = ("mesh.level=1", "inertia=off", "damping=off", "solver.mode=newton")
    s, books = run("tripod", 100, *words, joints=turn)
    balance = books.balance
    assert balance.work > 1e-3
    assert abs(balance.lost) < 1e-3 * balance.work
    assert not balance.grew
    assert (balance.strain, balance.gravity) == (s.energies().strain, s.energies().gravity)


def test_damping_loses_energy_and_a_stable_scheme_never_gains_any() -> None:
    _, books = run("pendulum", 100, "inertia.scheme=implicit_euler")
    assert books.balance.lost > 0
    _, books = run("pendulum", 100)  # symplectic: it sways
    assert not books.balance.grew
    assert abs(books.balance.lost) < 0.01 * books.balance.moved


@pytest.mark.parametrize(
    ("stability_margin", "at_rest", "estimated", "told"),
    [
        ([0.2, 1.5], True, False, ("stiffness", "0.20", "1.5 s", "error")),
        ([0.2, 1.5], False, False, None),
        ([0.7, 1.5], False, True, ("stiffness", "0.70", "1.5 s", "swings", "mesh")),
        ([0.7, 1.5], True, True, None),
        ([0.8, 1.5], False, True, None),
        ([0.05, 1.5], False, True, ("near", "0.05", "1.5 s", "another equilibrium")),
        ([0.05, 1.5], True, False, ("near", "0.05", "1.5 s")),
        ([0.4, 0.0], True, False, None),
        (None, True, True, None),
    ],
)
def test_a_pose_that_is_soft_or_near_a_snap_is_told(
    stability_margin: list[float] | None, at_rest: bool, estimated: bool, told: tuple[str, ...] | None
) -> None:
    _, books = run("pendulum", 1)
    report = StepReport(mesh_error=MeshErrorReport((0.0, 0.0, 0.0), 0.0)) if estimated else StepReport()
    found = stability(report, 0, books.balance, 0.005, stability_margin, at_rest=at_rest)
    lines = dict(stability_lines(asdict(found)))
    assert ("snap" in lines) == (told is not None)
    if told:
        assert_names(lines["snap"], *told)
    assert ("energy balance" in lines) is not at_rest  # equilibria that loads are put on keep no books


def test_energy_from_nothing_is_told() -> None:
    books = EnergyBooks(Energies(0.0, 1.0, 0.0), STILL, STILL[:3])
    books.add(Energies(0.5, 0.52, 0.0), STILL, STILL[:3], 0.1)
    assert books.balance.grew
    lines = dict(stability_lines(asdict(stability(StepReport(), 0, books.balance, 0.005))))
    assert_names(lines["energy balance"], "20 mJ more")
    books.add(Energies(0.5, 0.499, 0.0), STILL, STILL[:3], 0.2)
    assert not books.balance.grew
    assert books.balance.lost == pytest.approx(0.001)


def test_the_books_are_opened_anew_where_the_slide_moves_whose_work_is_not_known() -> None:
    books = EnergyBooks(Energies(0.0, 0.0, 0.0), STILL, STILL[:3])
    moved = np.array([0.0, 0.0, 0.0, 0.01])
    books.add(Energies(0.0, 3.0, 0.0), moved, STILL[:3], 0.5)
    assert (books.balance.lost, books.balance.since) == (0.0, 0.5)
    line = dict(stability_lines(asdict(stability(StepReport(), 0, books.balance, 0.005))))["energy balance"]
    assert_names(line, "slide", "prescribed", "at 0.5 s")
    books.add(Energies(0.0, 2.0, 0.0), moved, STILL[:3], 1.0)
    assert (books.balance.lost, books.balance.since) == (1.0, 0.5)
    assert total(Energies(1.0, 2.0, -4.0)) == -1.0


def test_rounding_of_what_rests_without_any_energy_is_no_growth() -> None:
    books = EnergyBooks(Energies(0.0, 0.0, 0.0), STILL, STILL[:3])
    books.add(Energies(1e-20, 0.0, 1e-18), STILL, STILL[:3], 0.005)
    assert books.balance.lost < 0
    assert not books.balance.grew
    line = dict(stability_lines(asdict(stability(StepReport(), 0, books.balance, 0.005))))["energy balance"]
    assert_names(line, "0 mJ lost", "damping", "friction", "time steps")
    books = EnergyBooks(Energies(0.0, 1.0, 0.0), STILL, STILL[:3])
    books.add(Energies(0.0, 1.0 + 5e-7, 0.0), STILL, STILL[:3], 0.005)
    line = dict(stability_lines(asdict(stability(StepReport(), 0, books.balance, 0.005))))["energy balance"]
    assert not books.balance.grew
    assert line.startswith("sways")  # nothing that servos put in


def test_what_servos_that_jump_put_in_is_no_growth_but_what_comes_from_nothing_is() -> None:
    jerk = [
        "motion=off",
        "ball=off",
        "damping=off",
        "inertia.scheme=tr_bdf2",
        "servos.angles=[-1.2, -1.2, -1.2]",
    ]
    s = Simulation(load_scene("tripod_ball", jerk))
    books = EnergyBooks(s.energies(), s.state.joints, s.efforts)
    for k in range(8):
        s.step(np.append(np.full(3, -1.2 + 0.2 * min(k, 4)), s.command[3:]))
        books.add(s.energies(), s.state.joints, s.efforts, s.state.time)
    balance = books.balance
    assert -balance.unsure < balance.lost < -0.01 * balance.moved
    assert not balance.grew
    line = dict(stability_lines(asdict(stability(s.report, 0, balance, s.scene.dt))))["energy balance"]
    assert_names(line, "actuators", "efforts jump", "mJ")
    later = replace(s.energies(), kinetic=s.energies().kinetic + 2 * balance.unsure)
    books.add(later, s.state.joints, s.efforts, s.state.time)
    assert books.balance.grew


def test_the_balance_is_that_of_the_last_step_whose_energies_are_known() -> None:
    turned, push = np.array([0.1, 0.0, 0.0, 0.0]), np.array([2.0, 0.0, 0.0])
    first = Energies(0.0, 0.0, 0.0)
    books = EnergyBooks(first, STILL, push)
    books.add(first, turned, push, 0.1)
    assert (books.balance.work, books.balance.lost) == (0.0, 0.0)
    books.add(Energies(0.0, 0.3, 0.0), 2 * turned, push, 0.2)
    assert books.balance.work == pytest.approx(0.4)
    assert books.balance.lost == pytest.approx(0.1)
    slid = Energies(0.0, 0.7, 0.0)
    books.add(slid, moved := np.array([0.2, 0.0, 0.0, 0.01]), push, 0.3)
    books.add(
        slid, still := np.array([0.2, 0.0, 0.0, 0.02]), push, 0.4
    )  # of the step before, the slide moving
    books.add(Energies(0.0, 0.9, 0.0), still, push, 0.5)
    assert not np.array_equal(moved, still)
    assert (books.balance.lost, books.balance.since, books.balance.grew) == (0.0, 0.5, False)


def test_contacts_tell_how_deep_bodies_sink_in() -> None:
    s, books = run("stack", 20)
    figures = stability(s.report, 3, books.balance, s.scene.dt)
    assert figures.contacts == s.report.contact.contacts > 0
    assert figures.penetration == pytest.approx(max(0.0, -s.report.contact.smallest_gap))
    lines = dict(stability_lines(asdict(figures)))
    assert_names(lines["contacts"], "pressed")
    assert lines["limit of dt"] == "none: implicit steps"
    assert_names(lines["halvings"], "3 steps")
    deep = replace(s.report, contact=replace(s.report.contact, smallest_gap=-2e-3))
    assert stability(deep, 0, books.balance, s.scene.dt).penetration == 2e-3


def test_explicit_schemes_tell_their_limit() -> None:
    s, books = run("pendulum", 3)
    figures = stability(s.report, 0, books.balance, s.scene.dt)
    assert figures.residual is None
    assert figures.dt_limit == s.report.dt_limit
    assert_names(dict(stability_lines(asdict(figures)))["limit of dt"], "dt is 5 ms")
    unstable = StepReport(dt_limit=1e-3, growth=0.5, grew_at=7)
    lines = dict(stability_lines(asdict(stability(unstable, 0, books.balance, s.scene.dt))))
    assert_names(lines["unstable"], "unstable", "step 7")


def test_a_studied_scene_tells_where_it_is_on_the_front_and_what_others_cost() -> None:
    figures = accuracy_summary("tripod", load_scene("tripod"), 0.04)
    assert [offer.wish for offer in figures.offers] == list(WISHES)
    assert figures.measured is not None
    assert figures.bound is not None
    assert 0.001 < figures.measured < figures.bound < 1
    assert figures.here_seconds is not None
    costs = [offer.seconds for offer in figures.offers if offer.seconds]
    errors = [offer.measured for offer in figures.offers if offer.measured and offer.measured < offer.bound]
    assert len(costs) == len(errors) >= 3
    seconds, least = zip(*figures.front, strict=True)
    assert list(seconds) == sorted(seconds)
    assert list(least) == sorted(least, reverse=True)
    slower = accuracy_summary("tripod", load_scene("tripod"), 0.08)
    assert slower.here_seconds == pytest.approx(2 * figures.here_seconds)
    assert not accuracy_summary("tripod", load_scene("tripod")).scaled


@pytest.mark.parametrize("name", ["cloth", "maze", "silicone", "drape"])
def test_the_error_of_a_scene_is_the_one_that_its_study_measured(name: str) -> None:
    """The value is the stored study's own: of the point with the settings of the scene."""
    figures = accuracy_summary(name, load_scene(name))
    table = json.loads((STUDIES / f"{name}.json").read_text(encoding="utf-8"))
    point = next(p for p in table["points"] if p["settings"] == table["default"])
    assert figures.measured == pytest.approx(
        max(e["relative"] + e["own"] for e in promised_errors(table, point))
    )
    assert figures.bound > 2 * figures.measured
    assert_names(figures.line, f"study {name}", percent(figures.measured))
    assert table["quantities"][0]["what"] in figures.line
    assert not names(figures.line, percent(figures.bound)), "the bound is told on request"
    assert [error for _, error in figures.dots] == sorted_errors(table)


def promised_errors(table: dict[str, Any], point: dict[str, Any]) -> list[dict[str, float]]:
    first, *more = table["quantities"]
    return [point["errors"][q["name"]] for q in (first, *(q for q in more if q.get("promised")))]


def sorted_errors(table: dict[str, Any]) -> list[float]:
    """Return the measured errors of the points that worked, the cheapest first."""
    good = [p for p in table["points"] if p["status"] == "ok" and p["bound"] is not None]
    rows = [(p["cpu"], max(e["relative"] + e["own"] for e in promised_errors(table, p))) for p in good]
    return [pytest.approx(error) for _, error in sorted(rows)]


@pytest.mark.parametrize(
    ("scene", "overrides", "why"),
    [
        ("tripod", ("dt=0.0031",), ("study tripod_dynamic", "no point")),
        ("tripod", ("dt=auto",), ("study tripod_dynamic", "not made with", "time_error")),
        ("tripod", ("material.young=1e5", "maze={}"), ("not made with", "material.young", "maze")),
        ("cloth", ("springs.nodes=40",), ("study cloth", "not made with", "springs.nodes")),
        ("stack", (), ("no accuracy study", "scene 'stack'")),
    ],
)
def test_what_was_not_studied_is_not_known(
    scene: str, overrides: tuple[str, ...], why: tuple[str, ...]
) -> None:
    figures = accuracy_summary(scene, load_scene(scene, overrides), 0.04)
    assert figures.measured is None
    assert figures.bound is None
    assert_names(figures.line, *why)


def test_a_scene_that_a_study_has_not_seen_is_promised_nothing() -> None:
    offers = accuracy_summary("tripod", load_scene("tripod", ["material.young=1e5"]), 0.04).offers
    assert all(offer.settings and offer.measured is offer.bound is None for offer in offers)


def test_start_motion_and_what_only_tells_leave_the_accuracy_as_it_is() -> None:
    free = ["duration=9", "servos.angles=[0.1, 0, 0]", "motion=off", "time_error={}", "mesh_error={}"]
    assert accuracy_summary("tripod", load_scene("tripod", free)).measured is not None


def test_an_accuracy_that_nothing_reaches_says_so() -> None:
    offers = {o.wish: o for o in accuracy_summary("maze", load_scene("maze"), 0.04).offers}
    assert offers["1%"].measured is None
    best = offers["reference"].bound
    assert best is not None
    assert best > 0.01
    assert_names(offers["1%"].why_not, "study 'maze'", "most accurate", percent(best), "--accuracy reference")


def test_every_effect_is_listed_with_why_it_cannot_be_switched_on() -> None:
    for name in ("tripod", "stack", "cloth"):
        scene = load_scene(name)
        found = effect_summary(scene)
        assert {f.name for f in found} == set(EFFECTS)
        assert [f.on for f in found] == sorted((f.on for f in found), reverse=True)
        for figure in found:
            assert figure.on == bool(getattr(scene, figure.name))
            if not figure.on and not figure.why_not:
                assert getattr(load_scene(name, words(figure.name)), figure.name)
            if not figure.on and figure.why_not and figure.name != "obstacles":  # which would be a file
                with raises_naming(SceneError, figure.name):
                    load_scene(name, words(figure.name))
    reasons = {f.name: f.why_not for f in effect_summary(load_scene("stack"))}
    assert_names(reasons["damping"], "damping", "soft body")
    assert reasons["sleep"] == ""
    still = {f.name: f.why_not for f in effect_summary(load_scene("tripod", ["inertia=off", "damping=off"]))}
    assert_names(still["damping"], "damping", "inertia")


@pytest.mark.parametrize("name", ["tripod", "maze", "cloth", "drape_cubes", "stack"])
def test_a_picture_describes_what_is_in_the_scene(name: str) -> None:
    s = Simulation(load_scene(name))
    found = picture(s)
    parts = found["parts"]
    assert sum(part["count"] for part in parts) == len(s.skin.nodes)
    assert [part["first"] for part in parts] == np.cumsum([0, *(p["count"] for p in parts)])[:-1].tolist()
    assert sum(part["kind"] == "rigid" for part in parts) == len(s.scene.rigid)
    assert len(found["obstacles"]) == len(s.scene.obstacles)
    for key in ("servos", "effector", "maze", "ball"):
        assert (found[key] is None) == (getattr(s.scene, key) is None)
    assert bool(found["held"]) == (name == "cloth")
    if name == "drape_cubes":
        corners = np.array(found["obstacles"][1]["vertices"]).reshape(-1, 3)
        assert corners.mean(axis=0) == pytest.approx([0.2, -0.1, 0.0])
    if name == "maze":
        board = s.plate.board
        assert found["maze"]["goal"] == list(board.goal)
        assert found["maze"]["holes"] == board.obstacles.holes.tolist()


def test_errors_are_told_of_mesh_and_steps_where_the_scene_asks_for_them() -> None:
    assert errors_line(StepReport()) == ""
    steps = TimeErrorReport(3e-5, 4e-5, 7, np.nan)
    assert errors_line(StepReport(time_error=steps)) == ""
    mesh = MeshErrorReport((0.0, 5.4e-5, -7.2e-5), 0.1)
    assert errors_line(StepReport(mesh_error=mesh)) == "mesh 0.09 mm"
    assert errors_line(StepReport(mesh_error=mesh, time_error=steps)) == "0.12 mm: mesh 0.09, step 0.03"
    assert mesh_error(StepReport(mesh_error=mesh)) == effector_error(StepReport(mesh_error=mesh))
    assert effector_error(StepReport(mesh_error=mesh, time_error=steps)) == pytest.approx(1.2e-4)
    against = replace(steps, vector=(0.0, -3e-5, 0.0))
    both = StepReport(mesh_error=mesh, time_error=against)
    assert effector_error(both) == pytest.approx(np.hypot(2.4e-5, 7.2e-5))
    assert errors_line(both) == "0.076 mm: mesh 0.09, step 0.03"
    local = TimeErrorReport(np.nan, np.nan, -1, 1e-6)
    assert effector_error(StepReport(mesh_error=mesh, time_error=local)) == pytest.approx(9e-5)
    assert np.isnan([mesh_error(StepReport()), effector_error(StepReport(time_error=steps))]).all()
    lost = MeshErrorReport((np.nan,) * 3, 0.1)
    assert np.isnan(effector_error(StepReport(mesh_error=lost, time_error=steps)))
    assert_names(errors_line(StepReport(mesh_error=lost)), "richer mesh", "no equilibrium")


def test_the_largest_errors_of_a_run_are_kept_each_by_itself() -> None:
    largest = LargestErrors()
    assert np.isnan([largest.effector, largest.both]).all()
    report = StepReport(time_error=TimeErrorReport(3e-5, 4e-5, 7, np.nan, vector=(3e-5, 0.0, 0.0)))
    largest.add(report)
    mesh = MeshErrorReport((0.0, 4e-5, 0.0), 0.1)
    largest.add(replace(report, mesh_error=mesh))
    largest.add(StepReport(time_error=TimeErrorReport(2e-5, 9e-5, 3, 1e-6)))
    largest.add(StepReport(time_error=TimeErrorReport(1e-6, 1e-6, 2, np.nan)))
    largest.add(StepReport())
    assert (largest.effector, largest.largest, largest.node, largest.added) == (3e-5, 9e-5, 3, 1e-6)
    assert (largest.mesh, largest.both) == (pytest.approx(4e-5), pytest.approx(5e-5))
    assert np.isnan(largest.ball)
