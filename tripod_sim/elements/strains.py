"""The quadratic form of an element's strains: its stiffness where the material is the simplest."""

import numpy as np

from tripod_host.arrays import FloatArray

PAIRS = ((0, 0, 1.0), (1, 1, 1.0), (2, 2, 1.0), (0, 1, 2.0), (1, 2, 2.0), (2, 0, 2.0))
"""Components i, j of a strain, and how often each stands in it."""


def strain_squares(gradients: FloatArray, weights: FloatArray, frames: FloatArray) -> FloatArray:
    """Return each element's matrix of sum over points of weight |J^T sym(grad u) J|², shape (m, 3n, 3n).

    With J the identity and weights E dV this is the stiffness, nu = 0.

    Args:
        gradients: dN_a/dX [1/m], shape (m, q, n, 3).
        weights: Of the points, shape (m, q).
        frames: J of each element, shape (m, 3, 3).
    """
    m, q, n, _ = gradients.shape
    own = gradients @ frames[:, None]
    strains = np.empty((m, q, len(PAIRS), n, 3))
    for c, (i, j, times) in enumerate(PAIRS):
        both = (
            own[..., j, None] * frames[:, None, None, :, i] + own[..., i, None] * frames[:, None, None, :, j]
        )
        strains[:, :, c] = both * (np.sqrt(weights * times) / 2)[:, :, None, None]
    flat = strains.reshape(m, q * len(PAIRS), 3 * n)
    return np.asarray(flat.transpose(0, 2, 1) @ flat)
