"""From the name of a law to its module and its vector of parameters."""

from importlib import import_module
from types import ModuleType

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.errors import SceneError, shown
from tripod_sim.materials.laws import NAMES


def law_named(name: str) -> ModuleType:
    """Return the module of a law. Raises SceneError where there is none of that name."""
    if name not in NAMES:
        raise SceneError(f"material.law is {shown(name)}; allowed: {', '.join(NAMES)}")
    return import_module(f"tripod_sim.materials.laws.{name}")


def vector(law: str, lam: float, mu: float, own: tuple[float, ...] = ()) -> FloatArray:
    """Return the vector of a law's parameters: kappa [Pa], c, mu [Pa] and its own.

    Args:
        law: Its name.
        lam, mu: Initial constants of Lame [Pa].
        own: What `parameters` of a scene lists.
    """
    return np.array([*law_named(law).volume_term(lam, mu), mu, *own])
