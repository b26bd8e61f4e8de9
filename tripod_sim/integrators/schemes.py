"""The implicit schemes by name."""

from tripod_sim.integrators.backward import Bdf2, ImplicitEuler
from tripod_sim.integrators.stage import ImplicitStage
from tripod_sim.integrators.substeps import Substeps
from tripod_sim.integrators.tr_bdf2 import TrBdf2


def make_scheme(name: str, stage: ImplicitStage, max_halvings: int) -> Substeps:
    """Return the scheme `implicit_euler`, which `auto` is with a fixed dt, `bdf2` or `tr_bdf2`.

    Args:
        name: Of the scheme.
        stage: Solves its stages.
        max_halvings: The smallest part of a step is 2^-max_halvings of it.
    """
    if name == "bdf2":
        return Bdf2(stage, max_halvings)
    if name == "tr_bdf2":
        return TrBdf2(stage, max_halvings)
    return ImplicitEuler(stage, max_halvings)
