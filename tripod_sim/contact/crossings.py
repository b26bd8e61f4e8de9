"""Whether a body passed through what never moves: an observer that knows nothing of contacts."""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.contact.start import mark_passing
from tripod_sim.mesh.surfaces import Part, join


class Crossings:
    """Looks at a body step by step.

    What counts are an edge through a triangle, of one and the other, after a step, and a vertex whose straight way
    over the step leads through a triangle: that one also tells of a body that is above at first and below at last.
    """

    def __init__(self, body: Part, obstacles: list[Part]) -> None:
        """`body` where it begins; the obstacles stay."""
        surfaces, x = join([body, *obstacles])
        n = self._count = len(body.vertices)
        self._x = np.concatenate([x, body.vertices])  # at the end: where the body was
        self._marked = np.zeros(len(self._x), dtype=np.bool_)
        edges, triangles = surfaces.edges, surfaces.triangles
        own_edge, own_triangle = edges[:, 0] < n, triangles[:, 0] < n
        ways = np.stack([len(x) + np.arange(n), np.arange(n)], axis=1)
        self._lines = (
            (np.concatenate([edges[own_edge], ways]), triangles[~own_triangle]),
            (edges[~own_edge], triangles[own_triangle]),
        )

    def found(self, x: FloatArray, *, straight: bool = True) -> bool:
        """Return whether the body passed through an obstacle on its way to `x` [m], shape (n, 3), or does so there.

        Args:
            x: Where its vertices are after the step.
            straight: Whether they came on straight lines: not if the step was divided. Otherwise only `x` is looked at.
        """
        n = self._count
        self._x[:n] = x
        if not straight:
            self._x[-n:] = x
        self._marked[:] = False
        for edges, triangles in self._lines:
            mark_passing(edges, triangles, self._x, self._marked)
        self._x[-n:] = x
        return bool(self._marked.any())
