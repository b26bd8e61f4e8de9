"""Platforms: bodies that do not fit together undeformed are bent until they do, or it is said which misses."""

import math
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.messages import raises_naming
from tripod_host.rotations import rotation_vector
from tripod_sim import Simulation, load_scene
from tripod_sim.errors import SceneError
from tripod_sim.scene.file import scene_from_toml, scene_to_toml
from tripod_sim.simulation import UNSTABLE_START
from tripod_study.run import run

EMIO = Path(__file__).parents[2] / "examples" / "emio.toml"

LENGTH, WIDTH, THICK, YOUNG = 0.1, 0.01, 0.002, 1e6
BEND = 1.0
"""Angle by which each strip is bent [rad]: an arc of a circle of radius LENGTH / BEND, needing a couple alone."""
REACH, RISE = LENGTH / BEND * math.sin(BEND), LENGTH / BEND * (1 - math.cos(BEND))

SCENE = f"""
name = "arch"
[[body]]
name = "left"
[body.mesh]
source = "block"
element = "h20"
corners = [[0, 0, 0], [{LENGTH}, 0, 0], [{LENGTH}, {WIDTH}, 0], [0, {WIDTH}, 0],
           [0, 0, {THICK}], [{LENGTH}, 0, {THICK}], [{LENGTH}, {WIDTH}, {THICK}], [0, {WIDTH}, {THICK}]]
cells = [12, 1, 1]
[body.material]
young = {YOUNG}
poisson = 0.0
density = 1000.0
[[body]]
name = "right"
like = "left"
position = [0.24, {WIDTH}, 0]
orientation = [0, 0, 1, 0]
[[set]]
name = "left_root"
body = "left"
high = [0, 1, 1]
[[set]]
name = "left_end"
body = "left"
low = [{LENGTH}, 0, 0]
[[set]]
name = "right_root"
body = "right"
low = [0.24, 0, 0]
tolerance = 1e-6
[[set]]
name = "right_end"
body = "right"
high = [{0.24 - LENGTH}, 1, 1]
tolerance = 1e-6
[[fixed]]
set = "left_root"
[[fixed]]
set = "right_root"
[[platform]]
position = [0.12, {WIDTH / 2}, {RISE + THICK / 2 + 0.004}]
mass = 0.01
size = [0.03, 0.02, 0.01]
[[platform.hold]]
set = "left_end"
point = [{LENGTH}, {WIDTH / 2}, {THICK / 2}]
to = [{REACH - 0.12}, 0, 0]
turn = [0, {-BEND}, 0]
[[platform.hold]]
set = "right_end"
point = [{0.24 - LENGTH}, {WIDTH / 2}, {THICK / 2}]
to = [{0.12 - REACH}, 0, 0]
turn = [0, {BEND}, 0]
[solver]
tolerance = 1e-8
"""
"""Two strips that meet in a platform which begins 4 mm too high."""

INERTIA = '[inertia]\nscheme = "tr_bdf2"\n'


def test_strips_are_bent_to_arcs_and_the_platform_goes_where_these_meet() -> None:
    shares: list[float] = []
    simulation = Simulation(scene_from_toml(SCENE), shares.append)
    assert shares == sorted(shares)
    assert len(shares) > 5
    np.testing.assert_allclose(
        simulation.effector.position, [0.12, WIDTH / 2, RISE + THICK / 2], rtol=0, atol=2e-4
    )
    assert rotation_vector(simulation.state.rotations[0]) == pytest.approx(np.zeros(3), abs=1e-6)
    second = WIDTH * THICK**3 / 12  # couple E I / R over the angle: E I BEND² / 2 LENGTH for each
    assert simulation.energies().strain == pytest.approx(YOUNG * second * BEND**2 / LENGTH, rel=0.02)
    nodes = simulation.state.positions[: len(simulation.mesh.nodes)]
    middle = simulation.mesh.nodes[:, 0] == LENGTH / 2
    half = LENGTH / BEND * np.array([math.sin(BEND / 2), 1 - math.cos(BEND / 2)])
    assert nodes[middle][:, [0, 2]].mean(axis=0) == pytest.approx(half + np.array([0, THICK / 2]), abs=4e-4)


def test_a_platform_carries_its_mass_and_turns_by_its_inertia() -> None:
    from tripod_sim.build import build

    scene = scene_from_toml(SCENE + INERTIA)
    parts = build(scene)
    nodes = parts.system.groups.rigid[0]
    places = parts.system.groups.placed(parts.system.rest)[nodes]
    centre = np.array(scene.platform[0].position)
    assert places.mean(axis=0) == pytest.approx(centre, abs=1e-12)
    own = nodes >= len(parts.mesh.nodes)
    mass, arms = parts.mass[nodes][own], places[own] - centre
    assert mass.sum() == pytest.approx(0.01, rel=1e-12)
    turning = [mass @ (arms[:, [j, k]] ** 2).sum(axis=1) for j, k in ((1, 2), (0, 2), (0, 1))]
    a, b, c = 0.03, 0.02, 0.01
    assert turning == pytest.approx(
        [0.01 * (b * b + c * c) / 12, 0.01 * (a * a + c * c) / 12, 0.01 * (a * a + b * b) / 12], rel=1e-12
    )
    assert parts.mass.sum() == pytest.approx(0.01 + 2 * 1000 * LENGTH * WIDTH * THICK, rel=1e-12)


def test_it_begins_to_move_from_rest_and_falls_as_its_weight_asks() -> None:
    simulation = Simulation(scene_from_toml(SCENE + INERTIA))
    start = simulation.effector.position
    for _ in range(5):
        simulation.step()
    assert np.abs(simulation.effector.position - start).max() < 1e-7, "nothing drives it"
    heavy = Simulation(scene_from_toml(SCENE + "[gravity]\n"))
    light = Simulation(scene_from_toml((SCENE + "[gravity]\n").replace("mass = 0.01", "mass = 1e-6")))
    assert light.effector.position[2] - heavy.effector.position[2] > 5e-4


def test_joined_where_they_are_bodies_move_as_one_that_is_fixed_at_one_end_only() -> None:
    """A cantilever that carries a platform at its end, which carries another strip: F L³ / 3 E I at the platform."""
    text = SCENE.replace('[[fixed]]\nset = "right_root"\n', "") + "[gravity]\n"
    text = text.replace(f"turn = [0, {-BEND}, 0]", "").replace(f"turn = [0, {BEND}, 0]", "turn = [0, 0, 0]")
    text = text.replace(f"to = [{REACH - 0.12}, 0, 0]", f"to = [{LENGTH - 0.12}, 0, {-RISE - 0.004}]")
    text = text.replace(f"to = [{0.12 - REACH}, 0, 0]", f"to = [{0.12 - LENGTH}, 0, {-RISE - 0.004}]")
    text = text.replace(f"young = {YOUNG}", "young = 1e11").replace("density = 1000.0", "density = 1e-3")
    simulation = Simulation(scene_from_toml(text.replace("tolerance = 1e-8", "tolerance = 1e-5")))
    second = WIDTH * THICK**3 / 12
    force, arm = 0.01 * 9.81, 0.02  # the centre is 20 mm beyond the end of the strip
    turn = force * LENGTH**2 / (2e11 * second) + force * arm * LENGTH / (1e11 * second)
    sunk = force * LENGTH**3 / (3e11 * second) + force * arm * LENGTH**2 / (2e11 * second) + arm * turn
    start = scene_from_toml(text).platform[0].position[2]
    assert start - simulation.effector.position[2] == pytest.approx(sunk, rel=0.02)


def test_what_cannot_be_assembled_is_refused_with_the_set_and_by_how_far_it_misses() -> None:
    short = SCENE.replace("[0.24,", "[0.36,").replace(f"[{0.24 - LENGTH},", f"[{0.36 - LENGTH},")
    with raises_naming(SceneError, "mm", "platform.0.hold.", "platform.0.stretch", "20 %"):
        Simulation(scene_from_toml(short))
    Simulation(scene_from_toml(short.replace("mass = 0.01", "mass = 0.01\nstretch = 1.0")))
    hasty = SCENE.replace("tolerance = 1e-8", "tolerance = 1e-8\nmax_iterations = 1\nmax_halvings = 0")
    with raises_naming(SceneError, "platform.0.hold.1", "'right_end'", "0 %") as told:
        Simulation(scene_from_toml(hasty))
    missed = re.search(r"([\d.]+) mm", str(told.value))
    assert missed
    assert 50 <= float(missed[1]) < 60


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('set = "left_end"', 'set = "nowhere"', ("platform.0.hold.0.set", "'nowhere'")),
        ('[[fixed]]\nset = "left_root"', '[[fixed]]\nset = "left_end"', ("fixed.0", "platform.0", "nodes")),
        ('set = "right_end"', 'set = "left_end"', ("platform.0.hold.1", "platform.0.hold.0", "node")),
        ('like = "left"', 'like = "other"', ("body.1.like", "'other'", "'left'")),
        ("mass = 0.01", "mass = -1.0", ("platform.0.mass", "-1.0")),
        ("[[platform.hold]]", "[contact]\n[[platform.hold]]", ("platform", "contact")),
        ('like = "left"\n', 'like = "left"\nmesh = {}\n', ("body.1.like", "body.1.mesh", "body.1.material")),
    ],
)  # fmt: skip
def test_bad_input_is_refused_in_one_line(old: str, new: str, named: tuple[str, ...]) -> None:
    text = SCENE.replace(old, new) if "contact" not in new else SCENE + "[contact]\nself_contact = true\n"
    with raises_naming(SceneError, *named) as told:
        Simulation(scene_from_toml(text))
    assert "\n" not in str(told.value)


def test_nothing_to_hold_and_explicit_schemes_are_refused() -> None:
    start = SCENE.index("[[platform.hold]]")
    empty = SCENE[:start].replace("mass = 0.01", "mass = 0.01\nhold = []") + SCENE[SCENE.index("[solver]") :]
    with raises_naming(SceneError, "platform.0.hold", "empty"):
        scene_from_toml(empty)
    with raises_naming(SceneError, "platform", "inertia.scheme", "cannot be combined"):
        scene_from_toml(SCENE + '[inertia]\nscheme = "rk4"\n')
    loose = SCENE.replace("[[fixed]]", "[[initial_velocity]]") + "[inertia]\n"
    with raises_naming(SceneError, "'left'", "'right'", "nodes", "platform"):
        Simulation(scene_from_toml(loose))


def test_a_scene_with_a_platform_is_written_and_read_back() -> None:
    scene = scene_from_toml(SCENE)
    assert scene_from_toml(scene_to_toml(scene)) == scene


def test_a_scene_without_one_does_not_import_it() -> None:
    code = (
        "import sys; from tripod_sim import Simulation, load_scene; Simulation(load_scene('two_cloths'));"
        "assert 'tripod_sim.bodies.soft_build' in sys.modules; assert 'tripod_sim.bodies.platform' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    assert not load_scene("two_cloths").platform


@pytest.mark.parametrize(("push", "firm", "said"), [(1e-3, False, True), (1e-4, True, False)])
def test_an_unstable_start_is_told(push: float, firm: bool, said: bool) -> None:
    """Straight strips that a platform presses together beyond the strain at which they buckle, 0.033 %, or less."""
    held = ", ".join(
        f'{{ set = "{name}", point = [{x}, {WIDTH / 2}, {THICK / 2}], to = [{to}, 0, 0] }}'
        for name, x, to in (
            ("left_end", LENGTH, -0.02 - push * LENGTH), ("right_end", 0.24 - LENGTH, 0.02 + push * LENGTH),
        )
    )  # fmt: skip
    place = f"position = [0.12, {WIDTH / 2}, {THICK / 2}]\nmass = 1e-6"
    simulation = Simulation(
        scene_from_toml(f"{SCENE.partition('[[platform]]')[0]}[[platform]]\n{place}\nhold = [{held}]\n")
    )
    assert (UNSTABLE_START in simulation.notes) == said
    if firm:
        stability_margin = simulation.compliance().stability_margin
        assert stability_margin
        assert stability_margin.value > 0


def test_a_run_of_bodies_tells_how_near_a_snap_is() -> None:
    result = run(str(EMIO), duration=0.01)
    assert result["figures"]["stability"]["stability_margin"][0] == pytest.approx(0.2, abs=0.05)


def test_what_is_held_beside_a_platform_leaves_elements_between_them() -> None:
    scene = scene_from_toml("""
name = "post"
[[body]]
name = "post"
[body.mesh]
source = "block"
corners = [[0, 0, 0], [0.01, 0, 0], [0.01, 0.01, 0], [0, 0.01, 0],
           [0, 0, 0.04], [0.01, 0, 0.04], [0.01, 0.01, 0.04], [0, 0.01, 0.04]]
cells = [1, 1, 5]
[body.material]
[[set]]
name = "top"
low = [0, 0, 0.04]
[[fixed]]
low = [0, 0, 0.0159]
high = [1, 1, 0.0321]
[[platform]]
position = [0.005, 0.005, 0.04]
[[platform.hold]]
set = "top"
point = [0.005, 0.005, 0.04]
to = [0, 0, 0]
[gravity]
""")
    simulation = Simulation(scene)
    simulation.step()
    sunk = 0.04 - simulation.effector.position[2]
    assert 0 < sunk < 1e-4
