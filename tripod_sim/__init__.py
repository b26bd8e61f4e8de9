"""Real-time simulation of soft bodies: a pure library.

>>> from tripod_sim import Simulation, load_scene
>>> simulation = Simulation(load_scene("tripod"))
>>> report = simulation.step()
"""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tripod_sim.errors import SceneError, StepError
from tripod_sim.kernel_cache import remove_stale_kernels

if TYPE_CHECKING:
    from tripod_sim.scene.file import load_scene, scene_names
    from tripod_sim.simulation import Simulation

__all__ = ["SceneError", "Simulation", "StepError", "load_scene", "scene_names"]

_HOMES = {"Simulation": "simulation", "load_scene": "scene", "scene_names": "scene"}

remove_stale_kernels(Path(__file__).parent)


def __getattr__(name: str) -> Any:
    """Import the public names when they are first used: listing scenes need not load numba."""
    if name not in _HOMES:
        raise AttributeError(f"module 'tripod_sim' has no attribute {name!r}")
    return getattr(import_module(f"tripod_sim.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    """Return the public names too that are not imported yet: for `help` and completion."""
    return sorted({*globals(), *__all__})
