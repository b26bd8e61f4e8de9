"""The shipped scenes do what their descriptions say, and the commands of the course run."""

import json
import re
import shlex
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.scenes import SHARP
from tripod_bringup import cli
from tripod_sim import Simulation, load_scene
from tripod_sim.effects.damping import Damping
from tripod_sim.effects.inertia import Inertia
from tripod_sim.elements.catalogue import ELEMENTS


def test_the_free_piece_falls_undeformed() -> None:
    """Step 1 of the workshop: v_n = -g n dt, x_n = x_0 - g dt² n (n + 1) / 2 for every node, no strain."""
    scene = load_scene("silicone_free")
    assert (scene.fixed, scene.servos, scene.effector) == ((), None, None)
    simulation = Simulation(scene)
    n, rest = round(scene.duration / scene.dt), simulation.mesh.nodes
    for _ in range(n):
        simulation.step()
    moved = simulation.state.positions - rest
    fall = -9.81 * scene.dt**2 * n * (n + 1) / 2
    # each node's error: the residual of a step, 1e-4 N at most on 0.2 g, acts over 0.2 s
    np.testing.assert_allclose(moved, np.tile([0, 0, fall], (len(rest), 1)), rtol=0, atol=1e-6)
    assert fall < -0.19
    energies = simulation.energies()
    assert energies.strain < 1e-9
    assert energies.kinetic == pytest.approx(0.5 * 0.032 * (9.81 * n * scene.dt) ** 2, rel=1e-6)


def test_the_piece_in_the_fixing_box_hangs_from_it_and_quiets_down() -> None:
    """Steps 2 and 3: the held end does not move, the rest swings down, energy only falls, and the swing dies away."""
    scene = load_scene("silicone", ["mesh.level=1"])
    simulation = Simulation(scene)
    rest = simulation.mesh.nodes
    held = rest[:, 0] >= 0.045 - 1e-9
    assert held.sum() >= 3
    total, kinetic = 0.0, []
    for _ in range(round(1.25 * scene.duration / scene.dt)):
        simulation.step()
        e = simulation.energies()
        # the residual, 1e-4 N at most, works over moves of at most 1 cm
        assert e.kinetic + e.strain + e.gravity <= total + 1e-6
        total = e.kinetic + e.strain + e.gravity
        kinetic.append(e.kinetic)
    moved = simulation.state.positions - rest
    assert not moved[held].any()
    assert moved[~held][:, 2].max() < 0
    assert simulation.state.positions[:, 2].min() < -0.07  # soft enough to hang, not to stand out
    assert max(kinetic[-50:]) < 0.05 * max(kinetic)


def test_the_assembly_holds_three_ends_and_a_rigid_disc() -> None:
    """Step 4: each servo holds the end of its strip; the nodes of the disc keep their distances while all bends."""
    simulation = Simulation(load_scene(SHARP))
    assert len(simulation.driven_frames) == 3
    rest = simulation.mesh.nodes
    disc = np.hypot(rest[:, 0], rest[:, 1]) <= 0.0075 + 1e-9
    for k in range(40):
        simulation.step(np.array([-0.4, -0.2, 0.1, 0.01]) * (k + 1) / 40)
    for nodes in (disc, *(frame.nodes for frame in simulation.driven_frames)):
        before, after = rest[nodes], simulation.state.positions[nodes]
        d0, d1 = (np.linalg.norm(p[:, None] - p[None], axis=2) for p in (before, after))
        np.testing.assert_allclose(d1, d0, atol=1e-12)
        assert np.abs(after - before).max() > 1e-3


SIZES = {5: 567, 6: 1674, 7: 3096}


@pytest.mark.parametrize("level", SIZES)
def test_the_preset_sofa_is_the_workshop_s_choice_at_its_sizes(level: int) -> None:
    scene = load_scene("tripod_sofa", [f"mesh.level={level}"])
    assert (scene.dt, scene.material.law) == (0.01, "corotational")
    assert scene.inertia == Inertia("implicit_euler")
    assert scene.damping == Damping(mass=0.0, stiffness=0.05)
    simulation = Simulation(scene)
    assert simulation.mesh.kind is ELEMENTS["t4"]
    assert 3 * len(simulation.mesh.nodes) == SIZES[level]


def test_the_preset_sofa_locks_less_when_finer() -> None:
    """Linear tetrahedra in bending: a quarter to a half of the sag of the converged solution (L1, -2.097 mm)."""
    sags = [Simulation(load_scene("tripod_sofa", [f"mesh.level={n}"])).effector.position[2] for n in SIZES]
    np.testing.assert_allclose(
        np.array(sags) / -2.097e-3, [0.244, 0.354, 0.486], atol=0.005
    )  # measured, see above


def test_the_preset_sofa_creeps() -> None:
    """Without mass g + b dg/dt = 0: the elastic forces of a body let go fall as exp(-t / b), b = 0.05 s.

    A step of implicit Euler leaves 1 / (1 + h / b) of them, 1 / 1.2 here, and of the small sag that they belong to.
    """
    options = ["mesh.level=5", "solver.mode=newton", "solver.tolerance=1e-9"]
    sagged = Simulation(load_scene("tripod_sofa", ["gravity.acceleration=[0, 0, -0.05]", *options]))
    simulation = Simulation(load_scene("tripod_sofa", ["material.mass=1e-6", "gravity=off", *options]))
    sagged.state.copy_to(simulation.state)
    left = [abs(simulation.effector.position[2])]
    for _ in range(12):
        simulation.step()
        left.append(abs(simulation.effector.position[2]))
    assert left[-1] > 2e-7  # positions are good to 1e-10 m: the tolerance over about 10 N/m
    np.testing.assert_allclose(np.array(left[1:]) / left[:-1], 1 / 1.2, atol=0.002)


# the course -----------------------------------------------------------------------------------------------------

ROOT = Path(__file__).parents[2]
COURSE = (ROOT / "docs" / "course.md").read_text()
COMMANDS = [
    line for block in re.findall(r"```sh\n(.*?)```", COURSE, re.DOTALL) for line in block.strip().splitlines()
]


@cache
def tripod(command: str) -> str:
    """Run a line of the course and return what it prints."""
    name, *arguments = shlex.split(command)
    assert name == "tripod"
    done = CliRunner().invoke(cli.app, arguments)
    assert done.exit_code == 0, f"{command}\n{done.output}"
    return done.stdout


def test_the_course_has_commands_of_all_four_scenes() -> None:
    scenes = {shlex.split(c)[2] for c in COMMANDS}
    assert scenes == {"silicone_free", "silicone", "tripod", "tripod_sofa"}
    assert len(COMMANDS) >= 8


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_of_the_course_runs(command: str) -> None:
    assert tripod(command).strip()


def test_the_course_s_numbers_are_those_of_its_commands() -> None:
    stall = next(c for c in COMMANDS if "servo_dynamics" in c)
    summary = json.loads(tripod(stall))
    assert [s["servo"] for s in summary["stalled"]] == [0, 1, 2]
    np.testing.assert_allclose(np.degrees(summary["angles"]), -12.4, atol=0.4)
    working = json.loads(tripod(next(c for c in COMMANDS if "--slide" in c)))
    np.testing.assert_allclose(working["torques"], -0.10, atol=0.005)


def test_every_picture_of_the_course_is_there_and_drawn_by_the_script() -> None:
    named = re.findall(r"!\[.+?\]\((.+?)\)", COURSE)
    assert len(named) == 3
    script = (ROOT / "docs" / "pictures.py").read_text()
    for name in named:
        picture = ROOT / "docs" / name
        assert picture.read_bytes().startswith(b"\x89PNG")
        assert f'"{picture.stem}": ' in script
