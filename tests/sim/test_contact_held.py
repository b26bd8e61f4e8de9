"""Contact of what is held along some axes, or moves along a timeline: it pushes, carries and bears what touches it."""

from pathlib import Path

import numpy as np
import pytest

import tripod_sim
from tests.messages import raises_naming
from tests.sim.implicit_schemes import IMPLICIT
from tripod_sim import Simulation, StepError, load_scene

G, MU = 9.81, 0.4

SHAPES = Path(tripod_sim.__file__).parent / "scenes"

EDGE, HEIGHT = 0.02, 0.01
"""Of the block [m]; it stands on the plane z = 0."""

BLOCK = f"""
name = "block"
dt = 0.005
[mesh]
source = "block"
corners = [[0,0,0], [{EDGE},0,0], [{EDGE},{EDGE},0], [0,{EDGE},0],
           [0,0,{HEIGHT}], [{EDGE},0,{HEIGHT}], [{EDGE},{EDGE},{HEIGHT}], [0,{EDGE},{HEIGHT}]]
cells = [4, 4, 2]
[material]
law = "st_venant_kirchhoff"
young = 1e5
poisson = 0.3
mass = 4e-3
[solver]
tolerance = 1e-9
[[set]]
name = "bottom"
along = [0, 0, 1]
at = 0.0
[[set]]
name = "top"
along = [0, 0, 1]
at = {HEIGHT}
[[marker]]
set = "top"
[[marker]]
set = "bottom"
"""
CONTACT = "contact={{contact_distance=1e-4, alarm_distance=5e-4, tolerance=1e-4, friction={}, response='{}'}}"
PLANE = f"obstacles=[{{source='{SHAPES / 'plate.obj'}', position=[0,0,-1e-4]}}]"
"""At the contact distance below the block."""
ROLLERS = 'fixed=[{low=[0,-1,-1], high=[0,1,1], axes="x"}, {low=[-1,0,-1], high=[1,0,1], axes="y"}]'
MODES, SCHEMES = ("lagrange", "penalty"), IMPLICIT
AREA, WEIGHT = EDGE**2, 4e-3 * G


@pytest.fixture
def block(tmp_path: Path) -> str:
    (tmp_path / "block.toml").write_text(BLOCK)
    return str(tmp_path / "block.toml")


def on_top(shape: str, gap: float = 1e-4) -> str:
    """Return the words for a rigid ball or box that lies on the block."""
    form, half = (
        ("shape='ball', radius=0.004", 0.004) if shape == "ball" else ("size=[8e-3, 8e-3, 1e-3]", 5e-4)
    )
    place = [EDGE / 2 + 1e-4, EDGE / 2 - 2e-4, HEIGHT + half + gap]  # on no node
    return f"rigid=[{{{form}, mass=2e-3, position={place}}}]"


def moved_block(block: str, way: str, *words: str, response: str = "lagrange") -> Simulation:
    """Return a block whose bottom moves along `way`."""
    base = [
        "inertia={}", "gravity={}", "damping={mass=2, stiffness=2e-3}", CONTACT.format(MU, response),
        f"prescribed=[{{set='bottom', move='{way}'}}]",
    ]  # fmt: skip
    return Simulation(load_scene(block, [*base, *words]))


@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_slab_that_is_lifted_lifts_the_ball_that_lies_on_it(scheme: str, response: str, block: str) -> None:
    rise, steps = 0.03, 80
    simulation = moved_block(
        block,
        f"0: 0,0,0; 0.05: 0,0,0; 0.25: 0,0,{rise}",
        on_top("ball"),
        f"inertia.scheme={scheme}",
        response=response,
    )
    start = simulation.rigid[0].position
    for k in range(steps):
        simulation.step()
        bottom = simulation.positions[simulation._parts.watched[1], 2]
        goal = rise * np.clip(((k + 1) * 0.005 - 0.05) / 0.2, 0, 1)
        np.testing.assert_allclose(bottom, goal, atol=1e-15)
    risen = simulation.rigid[0].position - start
    assert risen[2] == pytest.approx(rise, abs=2e-4)  # the slab gives way a little
    assert np.abs(risen[:2]).max() < 5e-4  # rolling where it sinks in
    forces = simulation.reactions(1)[0]
    assert forces[2] == pytest.approx(WEIGHT + 2e-3 * G, rel=0.02)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("share", [0.5, 1.3])
def test_friction_takes_along_what_lies_on_a_plate_that_gets_faster(
    share: float, scheme: str, block: str
) -> None:
    """By `share` of mu g: a box follows what is less, and gains mu g where it is more.

    In most steps: in some an edge of the mesh pushes an edge of the box that slides over it.
    """
    way = "; ".join(f"{t}: {0.5 * share * MU * G * t**2},0,0" for t in 0.005 * np.arange(31))
    simulation = moved_block(block, way, on_top("box"), f"inertia.scheme={scheme}", "material.young=3e6")
    speeds = []
    for _ in range(14):
        simulation.step()
        speeds.append(float(simulation.state.rigid.velocities[0, 0]))
    assert np.median(np.diff(speeds[5:])) / 0.005 == pytest.approx(min(share, 1.0) * MU * G, rel=0.02)
    assert abs(simulation.state.rigid.velocities[0, 2]) < 1e-3


@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize("inertia", [None, *SCHEMES])
def test_a_block_on_rollers_pressed_on_a_plane_gets_wider_by_poissons_ratio(
    inertia: str | None, response: str, block: str
) -> None:
    """A quarter of a block, two of its sides planes of symmetry, without friction: its stress is even."""
    press = 0.2
    strain = press / AREA / 1e5
    words = [CONTACT.format(0.0, response), PLANE, ROLLERS]
    if inertia:
        words += [f"inertia={{scheme='{inertia}'}}", "damping={mass=400, stiffness=5e-3}"]
        words.append(f"load=[{{set='top', force=[0,0,{-press}]}}]")
    else:  # what only lies on the plane would not be held
        words.append(f"prescribed=[{{set='top', axes='z', move='0: 0,0,0; 0.005: 0,0,{-strain * HEIGHT}'}}]")
    simulation = Simulation(load_scene(block, words))
    for _ in range(80 if inertia else 1):
        simulation.step()
    assert simulation.report.contact
    if inertia:
        assert simulation.report.contact.force == pytest.approx(press, rel=1e-3)
    strain = simulation.report.contact.force / AREA / 1e5
    u, X = simulation.positions - simulation.mesh.nodes, simulation.mesh.nodes
    assert u[X[:, 0] == 0, 0].tolist() == [0.0] * int((X[:, 0] == 0).sum())
    assert u[X[:, 1] == 0, 1].tolist() == [0.0] * int((X[:, 1] == 0).sum())
    for axis in (0, 1):
        wider = u[X[:, axis] == EDGE, axis]
        assert wider.mean() == pytest.approx(0.3 * strain * EDGE, rel=0.03)
        assert np.ptp(wider) < 0.1 * wider.mean()
    shorter = u[X[:, 2] == HEIGHT, 2].mean() - u[X[:, 2] == 0, 2].mean()
    assert shorter == pytest.approx(-strain * HEIGHT, rel=0.03)


@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize("inertia", [None, *SCHEMES])
def test_what_presses_a_column_on_a_plane_bears_what_the_plane_does_but_its_weight(
    inertia: str | None, response: str, block: str
) -> None:
    """The top goes down, sideways held; the plane's force is that of the top and the weight."""
    words = [
        CONTACT.format(MU, response), PLANE, "gravity={}",
        "prescribed=[{set='top', move='0: 0,0,0; 0.1: 0,0,-5e-4'}]",
    ]  # fmt: skip
    if inertia:
        words += [f"inertia={{scheme='{inertia}'}}", "damping={mass=400.0}"]
    simulation = Simulation(load_scene(block, words))
    for _ in range(60):
        simulation.step()
    np.testing.assert_allclose(
        simulation.positions[simulation._parts.watched[0], 2], HEIGHT - 5e-4, atol=1e-15
    )
    assert simulation.report.contact
    plane = simulation.report.contact.force
    assert plane > 1e5 * AREA * 5e-4 / HEIGHT  # friction and the top keep it from getting wider
    top, bottom = (simulation.reactions(k)[0] for k in (0, 1))
    assert top[2] == pytest.approx(WEIGHT - plane, rel=1e-3)
    np.testing.assert_allclose(top[:2], 0.0, atol=1e-3 * plane)
    np.testing.assert_allclose(bottom, 0.0, atol=1e-3 * plane)  # but for the plane nothing holds these nodes


def test_what_moves_as_told_bounces_a_ball_like_a_wall(block: str) -> None:
    """A ball at rest that is met at v leaves at v (1 + e)."""
    speed, e = 0.5, 0.6
    words = [
        on_top("ball", 2e-3),
        "gravity=off",
        f"contact.restitution={e}",
        "damping=off",
        "contact.friction=0",
    ]
    words += [f"prescribed=[{{set='all', axes='z', move='0: 0,0,0; 1: 0,0,{speed}'}}]"]
    words.append(
        'fixed=[{low=[0,0,0], high=[0,0,0], axes="xy"}, {low=[0.02,0,0], high=[0.02,0,0], axes="y"}]'
    )
    simulation = moved_block(block, "0: 0,0,0; 1: 0,0,0", *words)
    for _ in range(8):
        simulation.step()
    assert simulation.state.rigid.velocities[0, 2] == pytest.approx(speed * (1 + e), rel=1e-6)


def test_what_is_moved_into_a_wall_is_told(block: str) -> None:
    """Its side must go on, and nothing else can give way."""
    wall = f"obstacles=[{{source='{SHAPES / 'cube.obj'}', scale=0.5, position=[-0.051,0.01,0.005]}}]"
    side = "prescribed=[{set='side', axes='x', move='0: 0,0,0; 0.03: -1.5e-3,0,0'}]"
    sets = "set=[{name='side', along=[1,0,0], at=0.0}, {name='top', along=[0,0,1], at=0.01}]"
    words = [CONTACT.format(MU, "lagrange"), wall, "inertia={}", sets, side, "marker=[{set='side'}]"]
    simulation = Simulation(load_scene(block, words))
    with raises_naming(StepError, "step", "held or driven", "through"):
        for _ in range(8):
            simulation.step()
    assert simulation.state.step > 2
    assert simulation.positions[:, 0].min() > -1.0e-3
