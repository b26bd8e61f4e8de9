"""The elements by name, each found in the module that makes it: whoever adds one adds a file to this package."""

from importlib import import_module
from pkgutil import iter_modules
from typing import Final

import tripod_sim.elements
from tripod_sim.elements.element import Element


def _found() -> dict[str, Element]:
    names = [m.name for m in iter_modules(tripod_sim.elements.__path__) if m.name != "catalogue"]
    modules = [import_module(f"tripod_sim.elements.{name}") for name in names]
    return {e.name: e for module in modules for e in vars(module).values() if isinstance(e, Element)}


ELEMENTS: Final = _found()

SIZES: Final = {e.cell: e.size for e in ELEMENTS.values()}
"""Nodes of the cells that elements are made of, by meshio's names."""

LINEAR: Final = {e.plain.cell: e.plain for e in ELEMENTS.values()}
"""The plainest element of each linear cell."""

CHOSEN: Final = {cell: e.name for e in ELEMENTS.values() for cell in e.chosen_for}
"""The element of each kind of cells where a scene names none."""
