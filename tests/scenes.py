"""Scenes of tests and benchmarks alone."""

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
