"""Cables, chambers and forces in a scene: commands, scripts, energy, compliance, refusals."""

from pathlib import Path

import numpy as np
import pytest

from tests.messages import assert_names, raises_naming
from tests.scenes import SHARP
from tests.sim.actuator_scenes import AIR, BY_LENGTH, BY_TENSION, JAW, PUSH, VIA, beam, finger
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.scene.script import script_of
from tripod_study.run import run

FINE = "solver.tolerance=1e-8"
MOVING = ("inertia={}", "damping.stiffness=2e-3")
LIQUID = 'chamber=[{name="oil", command="volume", range=[-1e-6, 2e-6]}]'
ENDS = {
    "cable": (BY_LENGTH, 0.01),
    "tension": (BY_TENSION, 3.0),
    "force": (PUSH, 0.2),
    "displacement": (JAW, 0.008),
    "chamber": (AIR, 5e3),
    "liquid": (LIQUID, 2e-7),
}


def made(folder: Path, kind: str, *words: str) -> Simulation:
    source = beam(folder) if kind in ("chamber", "liquid") else finger(folder)
    return Simulation(load_scene(source, [ENDS[kind][0], *words]))


def led(simulation: Simulation, value: float, parts: int = 10) -> Simulation:
    """Lead the first actuator evenly from 0 to `value`."""
    for k in range(1, parts + 1):
        simulation.step(np.array([value * k / parts, *simulation.command[1:]]))
    return simulation


def tip(simulation: Simulation) -> np.ndarray:
    x = simulation.mesh.nodes[:, 0]
    return simulation.positions[x > x.max() - 1e-9].mean(axis=0)


@pytest.mark.parametrize("kind", ENDS)
def test_the_work_of_an_actuator_is_the_strain_energy_at_rest(tmp_path: Path, kind: str) -> None:
    simulation = made(tmp_path, kind)
    work, (before, force) = 0.0, simulation.joint_work()
    parts = 40
    for k in range(1, parts + 1):
        led_to = np.array([ENDS[kind][1] * k / parts, 0.0])
        simulation.step(led_to)
        joints, efforts = simulation.joint_work()
        work += float(0.5 * (efforts + force) @ (joints[:1] - before[:1]))
        before, force = joints, efforts
    energies = simulation.energies()
    assert energies.strain > 1e-5
    assert work == pytest.approx(energies.strain + energies.gravity, rel=2e-3)


@pytest.mark.parametrize("kind", ENDS)
def test_at_rest_the_time_step_does_not_show(tmp_path: Path, kind: str) -> None:
    still = tip(led(made(tmp_path, kind, FINE), ENDS[kind][1]))
    for dt in (0.002, 0.005, 0.02):
        words = (
            FINE,
            "inertia.scheme=implicit_euler",
            "damping.stiffness=0.02",
            "damping.mass=20.0",
            f"dt={dt}",
        )
        simulation = led(made(tmp_path, kind, *words), ENDS[kind][1], round(0.2 / dt))
        simulation.advance(round(3.0 / dt))
        assert tip(simulation) == pytest.approx(still, abs=2e-6)


def test_a_cable_by_length_and_one_by_its_tension_hold_the_same_pose(tmp_path: Path) -> None:
    by_length = led(made(tmp_path, "cable", "solver.tolerance=1e-10"), 0.01)
    tension = float(by_length.efforts[0])
    assert 1.0 < tension < 10.0
    by_tension = led(made(tmp_path, "tension", "solver.tolerance=1e-10"), tension)
    assert by_tension.positions == pytest.approx(by_length.positions, abs=1e-9)
    (pulled,), (told,) = (part[:1] for part in by_tension.joint_work())
    assert told == pytest.approx(tension)
    assert pulled == pytest.approx(0.01 - tension / 1e6, abs=1e-9)  # less the stretch of the cable


@pytest.mark.parametrize("kind", ENDS)
def test_the_coupling_of_an_actuator_is_the_change_of_the_gradient(tmp_path: Path, kind: str) -> None:
    simulation = led(made(tmp_path, kind), ENDS[kind][1])
    system, state = simulation._system, simulation.state
    joints, h = state.joints.copy(), 1e-4 * ENDS[kind][1]
    system.drive(state, joints)
    system.assemble(state, project=False)
    system.evaluate(state)
    system.write_hessian()
    found, slope = system.reduction.drive[:, 0].copy(), system.reduction.drive_drive[0, 0]
    ends = []
    for sign in (1, -1):
        system.drive(state, joints + np.array([sign * h, 0.0]))
        system.evaluate(state)
        ends.append((system.residual.copy(), system.efforts[0]))
    assert found == pytest.approx(
        (ends[0][0] - ends[1][0]) / (2 * h), rel=1e-5, abs=1e-6 * np.abs(found).max()
    )
    assert slope == pytest.approx((ends[0][1] - ends[1][1]) / (2 * h), rel=1e-6, abs=1e-12)


def test_a_chamber_by_volume_and_one_by_its_pressure_hold_the_same_pose(tmp_path: Path) -> None:
    by_volume = led(made(tmp_path, "liquid", "solver.tolerance=1e-10"), 2e-7)
    pressure = float(by_volume.efforts[0])
    by_pressure = led(made(tmp_path, "chamber", "solver.tolerance=1e-10"), pressure)
    assert by_pressure.positions == pytest.approx(by_volume.positions, abs=1e-11)
    empty = made(tmp_path, "chamber").joint_work()[0][0]
    (volume, _), _ = by_pressure.joint_work()
    assert volume - empty == pytest.approx(2e-7 - empty * pressure / 1e8, rel=1e-8)  # less the compression


def test_a_displacement_moves_its_set_and_no_more(tmp_path: Path) -> None:
    words = ("force.0.direction=[0, 3.0, 4.0]", "force.0.force_max=0.03", "solver.tolerance=1e-9")
    simulation = led(made(tmp_path, "displacement", *words), 0.008)
    x = simulation.mesh.nodes[:, 0]
    moved = (simulation.positions - simulation.mesh.nodes)[x > x.max() - 1e-9]
    force = float(simulation.efforts[0])
    assert force > 0.03
    assert moved @ [0.0, 0.6, 0.8] == pytest.approx(0.008, abs=2e-6)
    assert np.ptp(moved[:, 0]) > 1e-4  # across, nothing holds it
    (where,), (told,) = (part[:1] for part in simulation.joint_work())
    assert (where, told) == (0.008, force)
    assert_names(next(note for note in simulation.notes if "jaw" in note), "force.0", "force_max", "0.03 N")


def test_a_liquid_below_vacuum_is_told_once(tmp_path: Path) -> None:
    words = [LIQUID, "chamber.0.range=[-2e-6, 0]", "inertia=off", "damping=off", "material.young=1e8"]
    simulation = led(Simulation(load_scene(beam(tmp_path), words)), -1e-6)
    (note,) = [note for note in simulation.notes if "oil" in note]
    assert_names(note, "chamber.0", "below vacuum", "-101325 Pa")


def test_more_than_the_chamber_has_cannot_be_pumped_out(tmp_path: Path) -> None:
    with raises_naming(SceneError, "chamber.0.range", "-0.001 m³", "3e-06 m³"):
        made(tmp_path, "liquid", "chamber.0.range=[-1e-3, 0]")


PULLED = (
    'cable=[{name="tendon", range=[0, 0.01], '
    'via=[{points=[[0.0, -0.006, 0.0]]}, {body="world", points=[[0.01, 0.02, -0.03]]}]}]'
)
"""A cable from the disc of the Tripod to a point below it, beside its axis."""


@pytest.mark.parametrize(
    "word", [PULLED, 'force=[{name="push", set="all", direction=[1, 0, 1], range=[-1, 1]}]']
)
def test_compliance_tells_what_an_actuator_does_to_the_effector(word: str) -> None:
    words = [word, "mesh.level=1", "solver.tolerance=1e-9", "inertia=off", "damping=off"]
    simulation = Simulation(load_scene(SHARP, words))
    pose = np.array([-0.5, -0.4, -0.6, 0.004, 0.01])
    simulation.step(pose)
    found = simulation.compliance()
    assert found.w.shape == (10, 10)
    assert found.angles == pytest.approx(pose[:4])
    jacobian = found.w[:3, 6:] @ np.linalg.inv(found.w[6:, 6:])
    for k, h in enumerate((1e-4, 1e-4, 1e-4, 1e-5)):
        ends = []
        for sign in (1, -1):
            at = pose.copy()
            at[k] += sign * h
            simulation.step(at)
            ends.append(simulation.effector.position)
        assert jacobian[:, k] == pytest.approx(
            (ends[0] - ends[1]) / (2 * h), rel=2e-3, abs=2e-4 * np.abs(jacobian).max()
        )


def test_a_slack_cable_has_no_tension_and_a_pushed_one_stays_slack(tmp_path: Path) -> None:
    simulation = made(tmp_path, "cable", "cable.0.slack=2mm")
    led(simulation, 0.0019)
    assert simulation.efforts[0] == 0.0
    assert np.abs(simulation.positions - simulation.mesh.nodes).max() < 1e-9
    led(simulation, 0.004)
    assert simulation.efforts[0] > 0.1


def test_two_via_points_at_one_place_are_one(tmp_path: Path) -> None:
    doubled = VIA.replace("[0.03, 0.01, 0.003], ", "[0.03, 0.01, 0.003], [0.03, 0.01, 0.003], ")
    found = []
    for via in (VIA, doubled):
        cable = f'cable=[{{name="tendon", via={via}, range=[0.0, 0.03]}}]'
        simulation = Simulation(load_scene(finger(tmp_path), [FINE, cable]))
        led(simulation, 0.01)
        found.append((simulation.positions.copy(), simulation.efforts.copy()))
    assert doubled != VIA
    assert np.ptp(found[0][0][:, 2]) > 0.03
    np.testing.assert_allclose(found[1][0], found[0][0], rtol=0, atol=1e-7)
    np.testing.assert_allclose(found[1][1], found[0][1], rtol=1e-4)


def test_a_run_plays_the_script_of_the_scene_or_of_the_user(tmp_path: Path) -> None:
    words = [BY_LENGTH, *MOVING, 'motion={actuate=["tendon = 0: 0; 0.2: 10mm"]}']
    result = run(finger(tmp_path), overrides=words, duration=0.3)
    (told,) = result["actuators"]
    assert (told["name"], told["position_unit"], told["effort_unit"]) == ("tendon", "m", "N")
    assert told["position"] == pytest.approx(0.01)
    assert told["effort"] > 1.0
    assert result["angles"] == result["torques"] == []
    (told,) = run(finger(tmp_path), overrides=words, actuate=["tendon=0:0; 0.1:0.002"], duration=0.2)[
        "actuators"
    ]
    assert told["position"] == pytest.approx(0.002)
    stability = run(finger(tmp_path), overrides=words, duration=0.3)["figures"]["stability"]
    assert stability["energy"]["work"] > 1e-4
    assert not stability["energy"]["grew"]


def test_a_tension_above_what_is_allowed_is_told_once(tmp_path: Path) -> None:
    words = [BY_LENGTH, "cable.0.tension_max=0.5", "inertia=off", "damping=off"]
    simulation = led(Simulation(load_scene(finger(tmp_path), words)), 0.01)
    (note,) = [note for note in simulation.notes if "tendon" in note]
    assert_names(note, "cable.0", "tension_max", "0.5 N")


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ([BY_LENGTH, "cable.0.range=[0.03, 0.0]"], ("cable.0.range", "smallest m")),
        ([BY_LENGTH, "cable.0.start=0.1"], ("cable.0.start", "0.1 m", "0 to 0.03 m")),
        (
            [BY_LENGTH, "inertia.scheme=generalised_alpha"],
            ("cable.0.command", "generalised_alpha", "tr_bdf2", "tension"),
        ),
        ([BY_LENGTH, "cable.0.name=slide"], ("cable.0.name", "'slide'")),
        ([BY_LENGTH, "cable.0.name=My cable"], ("cable.0.name", "small letters")),
        ([BY_LENGTH, PUSH, "force.0.name=tendon"], ("force.0.name", "'tendon'", "differ")),
        ([BY_TENSION, "cable.0.range=[-1.0, 1.0]"], ("cable.0.range", "-1 N", "cannot push")),
        (
            [BY_LENGTH, 'cable.0.via=[{body="world", points=[[0, 0, 0]]}]'],
            ("cable.0.via", "points"),
        ),
        ([PUSH, "force.0.direction=[0, 0, 0]"], ("force.0.direction", "zero")),
        ([JAW, "force.0.command=way"], ("force.0.command", "force, displacement")),
        ([JAW, "force.0.start=0.1"], ("force.0.start", "0.1 m", "-0.02 to 0.02 m")),
        ([AIR, "chamber.0.cap=true"], ("chamber.0.cap", "chamber.0.set")),
        ([LIQUID, "chamber.0.command=mass"], ("chamber.0.command", "pressure, volume")),
        ([AIR, "chamber.0.range=[-2e5, 0.0]"], ("chamber.0.range", "-101325 Pa")),
    ],
)
def test_a_wrong_description_is_refused(tmp_path: Path, words: list[str], named: tuple[str, ...]) -> None:
    with raises_naming(SceneError, *named):
        load_scene(finger(tmp_path), words)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (
            [BY_LENGTH, "cable.0.via.1.points.1=[0.03, 0.01, 0.2]"],
            ("cable.0.via.1.points 1", "0.185 m outside"),
        ),
        ([BY_LENGTH, "cable.0.via.1.body=arm"], ("cable.0.via.1.body", "'arm'", "world")),
        ([AIR], ("chamber.0.cavity", "no cavity")),
        (
            [BY_LENGTH, "cable.0.via=[{points=[[0.03, 0.01, 0.003], [0.03, 0.01, 0.003]]}]"],
            ("cable.0", "no length", "same place"),
        ),
        ([AIR, "chamber.0.set=tip"], ("chamber.0.set", "'tip'", "do not enclose", "cap")),
        ([PUSH, "force.0.set=toe"], ("force.0.set", "'toe'")),
        ([JAW, "inertia.scheme=semi_implicit_euler", "damping=off"], ("inertia.scheme", "force")),
        ([BY_LENGTH, "inertia.scheme=semi_implicit_euler", "damping=off"], ("inertia.scheme", "cable")),
    ],
)
def test_what_does_not_fit_the_body_is_refused(
    tmp_path: Path, words: list[str], named: tuple[str, ...]
) -> None:
    with raises_naming(SceneError, *named):
        Simulation(load_scene(finger(tmp_path), words))


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("tendo=0:0", ("'tendo=0:0'", "NAME", "tendon")),
        ("tendon", ("'tendon'", "NAME")),
        ("tendon=0:0,1", ("tendon", "1 finite value")),
        ("tendon=0:0;1:5kPa", ("tendon", "'5kPa'", "no number in m")),
        ("tendon=0:0;1:0.1", ("tendon", "length", "0.1 m", "0 to 0.03 m")),
    ],
)
def test_a_wrong_script_is_refused(tmp_path: Path, text: str, named: tuple[str, ...]) -> None:
    scene = load_scene(finger(tmp_path), [BY_LENGTH])
    with raises_naming(SceneError, "--actuate", *named):
        script_of(scene, actuate=[text])
    with raises_naming(SceneError, "twice"):
        script_of(scene, actuate=["tendon=0:0", "tendon=0:0"])


def test_commands_are_checked_and_a_reset_restores_them(tmp_path: Path) -> None:
    simulation = made(tmp_path, "cable", *MOVING, "cable.0.start=0.005")
    assert simulation.command[0] == 0.005
    begin = simulation.positions.tobytes()
    with raises_naming(SceneError, "tendon", "length 0.05 m", "0 to 0.03 m"):
        simulation.step(np.array([0.05, 0.0]))
    led(simulation, 0.01)
    first = simulation.positions.tobytes()
    simulation.reset()
    assert simulation.positions.tobytes() == begin
    led(simulation, 0.01)
    assert simulation.positions.tobytes() == first


ROUTE = 'cable=[{{name="tendon", range=[0.0, 0.03], via=[{{source="{}"}}]}}]'


def test_a_cable_runs_through_the_points_of_a_file(tmp_path: Path) -> None:
    (tmp_path / "route.csv").write_text("# x, y, z\n0, 0.01, 0.003\n0.03 0.01 0.003\n\n0.099,0.01,0.003\n")
    points = "[[0, 0.01, 0.003], [0.03, 0.01, 0.003], [0.099, 0.01, 0.003]]"
    words = [ROUTE.format(tmp_path / "route.csv")], [ROUTE.replace('source="{}"', "points={}").format(points)]
    scene = Path(finger(tmp_path))
    cable = ROUTE.format("route.csv")
    scene.write_text(f"{cable}\n{scene.read_text()}")
    assert load_scene(str(scene)).cable[0].via[0].source == str(tmp_path / "route.csv")
    by_file, given = (led(Simulation(load_scene(finger(tmp_path), one)), 0.005) for one in words)
    assert by_file.positions.tobytes() == given.positions.tobytes()


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (b"0 0 0\n1 2\n", ("line 2", "2 values")),
        (b"0 0 nan\n", ("line 1", "nan")),
        (b"", ("no points",)),
        (b"\xff\x00 1 2\n", ("line 1",)),
    ],
)
def test_a_bad_file_of_points_is_refused(tmp_path: Path, content: bytes, named: tuple[str, ...]) -> None:
    (tmp_path / "route.csv").write_bytes(content)
    with raises_naming(SceneError, "cable.0.via.0.source", "route.csv", *named):
        Simulation(load_scene(finger(tmp_path), [ROUTE.format(tmp_path / "route.csv")]))
    with raises_naming(SceneError, "cable.0.via.0.source", "gone.csv"):
        Simulation(load_scene(finger(tmp_path), [ROUTE.format(tmp_path / "gone.csv")]))
