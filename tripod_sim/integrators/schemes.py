"""The implicit schemes by name."""

import numpy as np
from numpy.typing import NDArray

from tripod_sim.forces.anchor import Anchor
from tripod_sim.integrators.backward import Bdf2, ImplicitEuler
from tripod_sim.integrators.newton import Newton
from tripod_sim.integrators.stage import ImplicitStage
from tripod_sim.integrators.substeps import Substeps
from tripod_sim.integrators.tr_bdf2 import TrBdf2

FloatArray = NDArray[np.float64]


def make_scheme(
    name: str, newton: Newton, inertia: Anchor, mass: FloatArray, mass_damping: float, max_halvings: int
) -> Substeps:
    """Return the scheme `implicit_euler`, which `auto` is with a fixed dt, `bdf2` or `tr_bdf2` for one system.

    Args:
        name: Of the scheme.
        newton: Solver of the system.
        inertia: The system's inertia term.
        mass: Of nodes [kg], shape (n,).
        mass_damping: a of the force -a M v [1/s].
        max_halvings: The smallest part of a step is 2^-max_halvings of it.
    """
    stage = ImplicitStage(newton, inertia, mass, mass_damping)
    if name == "bdf2":
        return Bdf2(stage, max_halvings)
    if name == "tr_bdf2":
        return TrBdf2(stage, max_halvings)
    return ImplicitEuler(stage, max_halvings)
