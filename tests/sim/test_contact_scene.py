"""Contact as an effect of scenes: bad input is named, absent it leaves no trace, cloth rests and never passes."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.messages import assert_names
from tests.sim.contact_scenes import assert_same_after_reset, refusal
from tripod_sim import Simulation, load_scene
from tripod_study.variations.drape import crossings_of

SMALL = ["springs.source=grid", "springs.nodes=9", "springs.size=0.6"]

MODES = ["lagrange", "penalty"]


def refused(*overrides: str) -> str:
    return refusal("drape", [*SMALL, *overrides])


@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize("scene", ["drape", "drape_cubes"])
def test_cloth_comes_to_rest_and_keeps_its_distance(scene: str, response: str) -> None:
    simulation = Simulation(load_scene(scene, [*SMALL, f"contact.response={response}", "damping.mass=10"]))
    lowest, fallen = 0.0, simulation.positions[:, 2].copy()
    for _ in range(350):
        report = simulation.step()
        assert report.contact
        lowest = min(lowest, report.contact.smallest_gap)
        assert report.contact.cut == 0.0
    assert report.contact.pressed > 3
    assert simulation.energies().kinetic < 1e-8
    assert lowest > -simulation.scene.contact.contact_distance
    assert (fallen - simulation.positions[:, 2]).max() > 0.1


@pytest.mark.parametrize("dt", [0.005, 0.008, 0.01])
def test_free_fall_takes_two_solves_a_step_whatever_is_rounded_off(dt: float) -> None:
    """Two end where only rounding is left of forces: slopes along a further step have any sign."""
    simulation = Simulation(load_scene("drape", [f"dt={dt}"]))
    assert [simulation.step().iterations for _ in range(8)] == [2] * 8


@pytest.mark.parametrize("restitution", [0.0, 0.5])
@pytest.mark.parametrize("response", MODES)
def test_the_shipped_drape_ends_its_bounces_and_stays_at_rest(response: str, restitution: float) -> None:
    """With the scene's own damping, size and mass, on a coarser grid: the rest speed ends what restitution begins."""
    words = ["springs.source=grid", "springs.nodes=9", "springs.size=0.8", f"springs.node_mass={0.2205 / 81}"]
    simulation = Simulation(
        load_scene(
            "drape",
            [*words, f"contact.response={response}", f"contact.restitution={restitution}", "sleep=off"],
        )
    )
    assert simulation.scene.damping
    assert simulation.scene.damping.mass == 2.0
    bounced, kinetic = 0.0, []
    for _ in range(1000):
        report = simulation.step()
        assert report.contact
        if report.contact.pressed:
            bounced = max(bounced, float(simulation.state.velocities[:, 2].max()))
        kinetic.append(simulation.energies().kinetic)
    assert max(kinetic) > 0.1
    assert max(kinetic[-100:]) < 1e-8
    assert restitution == 0.0 or bounced > 0.3


@pytest.mark.parametrize("response", MODES)
def test_a_cloth_that_trembles_without_end_is_put_to_sleep_where_it_lies(response: str) -> None:
    """Its contact distance is near the length of its edges, so that a contact comes and goes."""
    words = ["springs.source=grid", "springs.nodes=9", "springs.size=0.8", f"springs.node_mass={0.22 / 81}"]
    wide = ["contact.contact_distance=0.005", "contact.alarm_distance=0.015", f"contact.response={response}"]
    simulation = Simulation(load_scene("drape", [*words, *wide]))
    for _ in range(700):
        lain = simulation.positions.copy()
        if simulation.step().asleep:
            break
    assert simulation.report.asleep
    assert simulation.energies().kinetic == 0.0
    assert np.abs(simulation.positions - lain).max() < 2e-4
    assert lain[:, 2].min() < -0.1  # it hangs down around the sphere
    contact = simulation.report.contact
    assert contact
    assert contact.pressed > 3
    assert contact.smallest_gap > -0.005
    assert simulation.step().contact.pressed == contact.pressed  # it still tells what bears the cloth


@pytest.mark.parametrize("response", MODES)
def test_cloth_thrown_at_50_m_s_does_not_pass_the_sphere(response: str) -> None:
    simulation = Simulation(load_scene("drape", [*SMALL, f"contact.response={response}"]))
    simulation.state.velocities[:, 2] = -50.0
    lowest = 1.0
    for _ in range(15):
        simulation.step()
        assert np.isfinite(simulation.positions).all()
        # the sphere's flat faces lie within its radius, 0.2 m
        assert np.linalg.norm(simulation.positions, axis=1).min() > 0.19
        lowest = min(lowest, float(simulation.positions[:, 2].min()))
    assert lowest < 0.1  # its border flew on past the top


@pytest.mark.parametrize("response", MODES)
@pytest.mark.parametrize("speed", [0.5, 5.0, 50.0])
def test_a_cloth_of_a_tenth_of_a_millimetre_passes_nothing_at_any_speed(response: str, speed: float) -> None:
    """At 50 m/s a step of 10 ms covers five thousand contact distances; who looks knows nothing of contacts."""
    words = ["contact.contact_distance=1e-4", "contact.alarm_distance=3e-4", f"contact.response={response}"]
    scene = load_scene("drape", [*SMALL, *words, "springs.position=[0.01, 0.005, 0.22]"])
    assert scene.dt == 0.01
    assert scene.springs
    assert scene.contact
    simulation = Simulation(scene)
    watch = crossings_of(scene)
    simulation.state.velocities[:, 2] = -speed
    pressed = 0
    for _ in range(12):
        report = simulation.step()
        assert report.contact
        assert np.isfinite(simulation.positions).all()
        assert not watch.found(simulation.positions, straight=report.contact.parts == 1)
        assert report.contact.smallest_gap > -1e-4
        pressed = max(pressed, report.contact.pressed)
    assert pressed > 0


@pytest.mark.parametrize(
    ("scene", "words"),
    [("drape", [*SMALL, "contact.restitution=0.5"]), ("silicone_drop", ["mesh.level=1"])],
)
def test_the_first_hit_compiles_nothing(scene: str, words: list[str]) -> None:
    """Each kernel that a step with hits and bounces needs has its machine code when the simulation is built."""
    code = (
        "import gc; from numba.core.registry import CPUDispatcher; from tripod_sim import Simulation, load_scene;"
        f"s = Simulation(load_scene({scene!r}, {words!r}));"
        "count = lambda: sum(len(d.signatures) for d in gc.get_objects() if isinstance(d, CPUDispatcher));"
        "built = count(); s.state.velocities[:, 2] = -20; met = [s.step().contact.met for _ in range(4)];"
        "assert max(met) > 0 or s.report.contact.pressed; assert built > 0; assert count() == built"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_removing_contact_gives_the_bits_of_a_scene_that_never_had_it(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "tripod_sim" / "scenes" / "drape.toml").read_text()
    bare = text[: text.index("[contact]")]
    (tmp_path / "never.toml").write_text(bare.replace("cloth.obj", "grid"))

    def motion(scene: str, overrides: list[str]) -> bytes:
        simulation = Simulation(load_scene(scene, [*SMALL, *overrides]))
        for _ in range(20):
            simulation.step()
        return simulation.state.positions.tobytes() + simulation.state.velocities.tobytes()

    never = motion(str(tmp_path / "never.toml"), [])
    assert motion("drape", ["contact=off", "obstacles=off"]) == never
    assert motion("drape", []) != never


def test_reset_and_repetition_give_the_same_bits() -> None:
    simulation = Simulation(load_scene("drape", SMALL))
    assert_same_after_reset(simulation, 40)


def test_absent_contact_is_not_imported() -> None:
    def loaded(overrides: list[str]) -> set[str]:
        code = (
            "import sys; from tripod_sim import Simulation, load_scene;"
            f"Simulation(load_scene('drape', {[*SMALL, *overrides]!r})).step();"
            "print(*[m for m in sys.modules if m.startswith('tripod_sim')])"
        )
        done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
        return set(done.stdout.split())

    assert not [m for m in loaded(["contact=off", "obstacles=off"]) if m.startswith("tripod_sim.contact")]
    assert "tripod_sim.contact.contact_solver" in loaded([])


def test_bad_contact_is_named() -> None:
    near = refused("contact.alarm_distance=0.001")
    assert_names(near, "contact.alarm_distance is 0.001 m", "above contact.contact_distance, 0.002 m")
    assert_names(refused("contact.contact_distance=0"), "contact.contact_distance is 0.0")
    assert_names(refused("contact.alarm_distance=-1"), "contact.alarm_distance is -1.0")
    assert_names(refused("contact.friction=nan"), "contact.friction is nan")
    assert_names(refused("contact.response=glue"), "contact.response is 'glue'", "lagrange", "penalty")
    assert_names(refused("contact=off"), "obstacles", "contact")
    assert_names(refused("obstacles=off"), "contact", "nothing to act on", "[[obstacles]]")
    scheme = refused("inertia.scheme=semi_implicit_euler")
    assert_names(scheme, "inertia.scheme is 'semi_implicit_euler'", "implicit_euler", "bdf2", "tr_bdf2")


def test_bad_obstacles_are_named(tmp_path: Path) -> None:
    def message(text: str) -> str:
        path = tmp_path / "o.obj"
        path.write_text(text)
        return refused(f"obstacles.0.source={path}")

    vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
    assert_names(message(vertices), "o.obj", "no triangles")
    assert_names(message(vertices + "f 1 2 9\n"), "o.obj", "line 5", "vertex 9", "face", "4 vertices")
    assert_names(message(vertices + "f 0 1 2\n"), "line 5", "vertex 0", "face")
    assert_names(message("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), "line 1", "coordinate 'nan'")
    assert_names(message("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"), "triangles 0", "no area")
    same = message("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 1 0\nf 1 2 3\nf 1 2 4\n")
    assert_names(same, "vertices 2, 3", "position")
    assert_names(message(vertices + "f 1 2\n"), "line 5", "at least 3 vertices")
    assert_names(refused("obstacles.0.source=missing.obj"), "obstacles.0.source", "missing.obj")
    assert_names(refused("obstacles.0.source=sphere"), "obstacles.0.source is 'sphere'")
    assert_names(refused("obstacles.0.scale=0"), "obstacles.0.scale is 0.0")


def test_polygons_of_an_obstacle_are_triangulated(tmp_path: Path) -> None:
    turns = np.arange(7) * 2 * np.pi / 7
    vertices = "".join(f"v {0.4 * np.cos(t):.6f} {0.4 * np.sin(t):.6f} 0.1\n" for t in turns)
    (tmp_path / "heptagon.obj").write_text(vertices + "f 1 2 3 4 5 6 7\n")
    simulation = Simulation(load_scene("drape", [*SMALL, f"obstacles.0.source={tmp_path / 'heptagon.obj'}"]))
    for _ in range(100):
        simulation.step()
    inside = np.linalg.norm(simulation.positions[:, :2], axis=1) < 0.3
    assert inside.sum() > 20
    assert simulation.positions[inside, 2].min() > 0.1


def test_a_start_inside_an_obstacle_is_refused_or_lifted() -> None:
    inside = "springs.position=[0, 0, 0.1]"
    assert_names(refused(inside), "nodes", "obstacles.0", "contact.start = 'lift'")
    simulation = Simulation(load_scene("drape", [*SMALL, inside, "contact.start=lift"]))
    heights = simulation.positions[:, 2]
    assert np.ptp(heights) == 0
    assert 0.2 < heights[0] < 0.21
    simulation.step()
    assert simulation.report.contact
    assert simulation.report.contact.smallest_gap > -0.002
    # wholly inside: a cloth smaller than the sphere
    assert_names(refused("springs.size=0.1", "springs.position=[0, 0, 0]"), "inside", "obstacles.0")


def test_a_chain_is_caught_by_an_edge() -> None:
    """Its springs are shapes of their own: a chain across the edge of a cube hangs there."""
    chain = ["springs.source=chain", "springs.nodes=9", "springs.size=0.6", "obstacles.0.source=cube.obj"]
    simulation = Simulation(
        load_scene("drape", [*chain, "springs.position=[-0.3, 0.01, 0.12]", "contact.friction=2"])
    )
    for _ in range(200):
        simulation.step()
    assert simulation.positions[:, 2].max() > 0.09
