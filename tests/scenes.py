"""Scenes of tests and benchmarks alone."""

from collections.abc import Sequence
from pathlib import Path

import tripod_sim

SHARP = str(Path(__file__).with_name("tripod_sharp.toml"))
"""The Tripod as `--accuracy draft` takes it: 402 unknowns, ideal clamps, implicit Euler with steps of 5 ms. Quick, and
the same whatever the shipped scene becomes."""

FIVE_LEGS = str(Path(__file__).with_name("five_legs.toml"))
"""A robot with five legs and five servos on a coarse mesh; with `mesh.legs` and `servos.count`, one of another number.
"""

CUBE, FLOOR = (str(Path(tripod_sim.__file__).parent / "scenes" / f"{name}.obj") for name in ("cube", "plate"))
"""The shipped cube and plate, for scenes that are not."""


def held_bar(
    cells: Sequence[int], element: str = "t4", *, size: Sequence[float] = (0.2, 0.02, 0.02), young: float = 250e3,
    poisson: float = 0.45,
) -> str:  # fmt: skip
    """Return the text of a scene of a bar along X, held at X = 0, that falls under its weight in steps of 10 ms.

    Args:
        cells: Along X, Y and Z.
        element: Name of the element.
        size: Lengths of its sides [m]; the set `tip` is its end at the largest X.
        young: E [Pa].
        poisson: nu.
    """
    x, y, z = size
    corners = [[0, 0, 0], [x, 0, 0], [x, y, 0], [0, y, 0], [0, 0, z], [x, 0, z], [x, y, z], [0, y, z]]
    return f"""name = "bar"
dt = 0.01
duration = 0.5
[mesh]
source = "block"
element = "{element}"
cells = {list(cells)}
corners = {corners}
[material]
young = {young}
poisson = {poisson}
density = 1070
[gravity]
[inertia]
[damping]
stiffness = 0.01
[[set]]
name = "root"
high = [0, 1, 1]
[[set]]
name = "tip"
low = [{x}, -1, -1]
[[fixed]]
set = "root"
"""
