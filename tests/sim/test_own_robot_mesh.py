"""Meshes of a user's own robot that are not what they should be: with a gap, beside the arms' plane, or turned."""

from pathlib import Path

import meshio
import numpy as np
import pytest

from tests.messages import assert_names, names, raises_naming
from tripod_sim import SceneError, Simulation, load_scene

EMIO = Path(__file__).parents[2] / "examples" / "emio.toml"

SCENE = """
name = "bridge"
[mesh]
source = "strip.vtk"
scale = 0.001
[material]
density = 1070
[gravity]
[servos]
count = 2
[effector]
"""


def written(folder: Path, *, lift: float = 0.0, turned: bool = False, gap: bool = False) -> str:
    """Write a strip of 110 x 20 x 5 mm with its scene; return the path of that."""
    counts, size = (24, 2, 2), (110.0, 20.0, 5.0)
    i, j, k = np.meshgrid(*(np.arange(n + 1) for n in counts), indexing="ij")
    points = (np.stack([i, j, k], axis=-1).reshape(-1, 3) / counts - 0.5) * size + [0, 0, lift]
    node = np.arange(i.size).reshape(i.shape)
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    x, y, z = counts
    bricks = np.stack([node[a : a + x, b : b + y, c : c + z].ravel() for a, b, c in corners], axis=1)
    if gap:
        bricks = bricks[bricks[:, 0] // ((y + 1) * (z + 1)) != 6]  # without one layer across the strip
    if turned:
        points = points[:, [1, 0, 2]] * [1, -1, 1]
    meshio.Mesh(points, [("hexahedron", bricks)]).write(folder / "strip.vtk")
    (folder / "bridge.toml").write_text(SCENE, encoding="utf-8")
    return str(folder / "bridge.toml")


def notes(path: str) -> str:
    return " ".join(Simulation(load_scene(path)).notes)


def test_a_sound_mesh_has_no_note(tmp_path: Path) -> None:
    told = notes(written(tmp_path))
    assert not names(told, "parts")
    assert not names(told, "plane")


@pytest.mark.parametrize("words", [(), ("inertia={}",)])
def test_a_gap_in_the_mesh_is_told(tmp_path: Path, words: tuple[str, ...]) -> None:
    told = " ".join(Simulation(load_scene(written(tmp_path, gap=True), words)).notes)
    assert_names(told, "2 parts", "no node", "gap")


@pytest.mark.parametrize("lift", [25.0, -25.0])
def test_a_mesh_beside_the_plane_of_the_arms_is_told(tmp_path: Path, lift: float) -> None:
    assert_names(notes(written(tmp_path, lift=lift)), "servo_0", f"{lift - 2.5:g}", "z = 0", "axis_depth")


def test_arms_that_stand_where_the_user_puts_them_have_no_plane() -> None:
    """Those of emio hold what lies below their axes."""
    told = " ".join(Simulation(load_scene(EMIO, ["servos.axis_depth=0.2"])).notes)
    assert not names(told, "plane")


def test_where_an_arm_holds_nothing_the_way_out_is_the_right_one(tmp_path: Path) -> None:
    with raises_naming(SceneError, "servos.clamp_radius", "smaller", "turn"):
        Simulation(load_scene(written(tmp_path, turned=True)))
