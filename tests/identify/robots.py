"""Scenes and data that these tests share: a beam of rubber, and the Tripod with linear elements."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tripod_identify.csv_columns import Channel
from tripod_identify.measured import Measured
from tripod_identify.model import Told, predict
from tripod_sim import load_scene
from tripod_sim.scene import Scene
from tripod_sim.scene.file import scene_from_toml

BEAM = """
name = "beam"
dt = 0.005
[mesh]
source = "block"
corners = [[0,0,0], [0.1,0,0], [0.1,0.02,0], [0,0.02,0], [0,0,0.02], [0.1,0,0.02], [0.1,0.02,0.02], [0,0.02,0.02]]
cells = [6, 2, 2]
[material]
young = 200e3
poisson = 0.45
density = 1070.0
[gravity]
[[set]]
name = "foot"
along = [1, 0, 0]
at = 0.0
[[set]]
name = "tip"
along = [1, 0, 0]
at = 0.1
[[fixed]]
set = "foot"
[[load]]
set = "tip"
mass = 0.02
[[marker]]
set = "tip"
"""
MOVING = (
    BEAM.replace("[6, 2, 2]", "[4, 1, 1]") + '[inertia]\nscheme = "tr_bdf2"\n[damping]\nstiffness = 5e-3\n'
)

PLACE = tuple(Channel("effector", axis) for axis in range(3))
POSE = (*PLACE, *(Channel("effector", axis, angle=True) for axis in range(3)))


def beam(text: str = BEAM) -> Scene:
    return scene_from_toml(text)


def tripod(*words: str) -> Scene:
    return load_scene("tripod", ["mesh.element=h8_modes", *words])


def commands(count: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Angles [rad] about the working pose and slides [m]."""
    rng = np.random.default_rng(seed)
    share = rng.uniform(0.3, 1.0, count)
    angles = -1.4 * share[:, None] + rng.uniform(-0.25, 0.25, (count, 3))
    return angles, 0.03 * share


def measured(
    told: Told, angles, slide, channels: Sequence[Channel] = POSE, noise=(0.0, 0.0), seed=2
) -> Measured:
    """What `told` shows at rest, with normal errors of places [m] and rotations [rad]."""
    empty = Measured(None, angles, slide, tuple(channels), np.zeros((len(angles), len(channels))))
    values = predict(told, empty, ())
    sizes = [noise[c.angle] for c in channels]
    values += np.random.default_rng(seed).standard_normal(values.shape) * sizes
    return Measured(None, angles, slide, tuple(channels), values)


def write_csv(path: Path, data: Measured) -> Path:
    """Write poses of the Tripod as people do: degrees and millimetres."""
    head = [f"servo_{i}_deg" for i in range(3)] + (["slide_mm"] if data.slide is not None else [])
    head += [f"{c.label}_{'deg' if c.angle else 'mm'}" for c in data.channels]
    slide = [] if data.slide is None else [1e3 * data.slide[:, None]]
    sizes = [np.degrees(1) if c.angle else 1e3 for c in data.channels]
    table = np.column_stack([np.degrees(data.commands), *slide, data.values * sizes])
    rows = [",".join(f"{v:.9g}" for v in row) for row in table]
    path.write_text("\n".join([",".join(head), *rows]) + "\n")
    return path
