"""The elements by name."""

from typing import Final

from tripod_sim.elements.element import Element
from tripod_sim.elements.hexahedron import H8, H8_MODES
from tripod_sim.elements.mean_dilatation import H8_MEAN
from tripod_sim.elements.quadratic_hexahedron import H20, H20_FULL, H27
from tripod_sim.elements.tetrahedron import T4, T10

ELEMENTS: Final[dict[str, Element]] = {
    e.name: e for e in (T4, T10, H8, H8_MODES, H8_MEAN, H20, H20_FULL, H27)
}
