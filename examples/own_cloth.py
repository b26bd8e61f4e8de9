"""A cloth of your own: a round one, written as OBJ, whose edges become springs. It falls on a ball and hangs there.

python examples/own_cloth.py           # writes round.obj and round.toml beside you, and runs them
tripod run round.toml --view
"""

from itertools import pairwise
from pathlib import Path

import numpy as np

from tripod_sim import Simulation, load_scene

RADIUS, RINGS = 0.15, 9  # [m]
BALL, GAP = 0.08, 0.002  # radius of the ball, distance at which they touch [m]

SCENE = f"""name = "round"
description = "A round cloth falls on a ball"
dt = 0.01
duration = 2.0

[springs]
source = "round.obj"
position = [0.01, 0.0, {BALL + 0.02}]
node_mass = 0.0005
stiffness = 100.0
bending = 0.5
damping = 0.02
compressed = "slack"

[gravity]

[inertia]

[damping]
mass = 2.0
stiffness = 0.0

[contact]
contact_distance = {GAP}
alarm_distance = 0.006
friction = 0.4

[[obstacles]]
source = "ball.obj"
"""


def write_obj(path: Path, points: np.ndarray, triangles: list[tuple[int, int, int]]) -> None:
    """Write a surface; OBJ counts vertices from 1."""
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles]
    path.write_text("\n".join(lines) + "\n")


def disc(rings: int) -> tuple[np.ndarray, list[tuple[int, int, int]]]:
    """Return points of a disc of radius 1 in z = 0 and its triangles: ring r has 6 r points."""
    points, start = [(0.0, 0.0, 0.0)], [0, 1]
    triangles = []
    for r in range(1, rings + 1):
        angles = 2 * np.pi * np.arange(6 * r) / (6 * r)
        points += [(r / rings * np.cos(a), r / rings * np.sin(a), 0.0) for a in angles]
        start.append(start[-1] + 6 * r)
    for r, (inner, outer) in enumerate(pairwise(start[:-1]), start=1):
        for side in range(6):
            i = [inner + (side * (r - 1) + k) % max(6 * (r - 1), 1) for k in range(r)]
            o = [outer + (side * r + k) % (6 * r) for k in range(r + 1)]
            triangles += [(i[k], o[k], o[k + 1]) for k in range(r)]
            triangles += [(i[k], o[k + 1], i[k + 1]) for k in range(r - 1)]
    return np.array(points), triangles


def ball(rings: int) -> tuple[np.ndarray, list[tuple[int, int, int]]]:
    """Return a sphere of radius 1: two discs, bent."""
    flat, upper = disc(rings)
    theta = np.pi / 2 * np.hypot(flat[:, 0], flat[:, 1])
    phi = np.arctan2(flat[:, 1], flat[:, 0])
    cap = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    inner = len(flat) - 6 * rings  # points before the rim, which both halves share
    below = [k + len(flat) if k < inner else k for k in range(len(flat))]
    points = np.concatenate([cap, cap[:inner] * (1, 1, -1)])
    return points, upper + [(below[a], below[c], below[b]) for a, b, c in upper]


def main() -> None:
    """Write the files, let the cloth fall, and see that it lies on the ball and not in it."""
    points, triangles = disc(RINGS)
    write_obj(Path("round.obj"), RADIUS * points, triangles)
    points, triangles = ball(8)
    write_obj(Path("ball.obj"), BALL * points, triangles)
    Path("round.toml").write_text(SCENE)

    simulation = Simulation(load_scene("round.toml"))
    for _ in range(60):
        report = simulation.step()
    x = simulation.positions
    print(
        f"after {simulation.state.time:.1f} s: {report.contact.pressed} contacts press, "
        f"the rim hangs between {1e3 * x[:, 2].min():.0f} and {1e3 * x[:, 2].max():.0f} mm"
    )
    nearest = np.linalg.norm(x, axis=1).min()
    assert nearest > 0.97 * BALL, "a node is within the ball"  # flat triangles lie a little inside the sphere
    assert report.contact.pressed > 10


if __name__ == "__main__":
    main()
