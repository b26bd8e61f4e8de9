"""Errors of observations, and what a reference is worth."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.errors import SceneError
from tripod_study.plan import Quantity, Reference


@dataclass(frozen=True, eq=False)
class Standard:
    """What errors are held against.

    Attributes:
        rows: Of the reference.
        scale: What an error is relative to, in the quantity's unit.
        own: Estimated error of the reference itself, in the quantity's unit.
    """

    rows: FloatArray
    scale: float
    own: float


def deviation(rows: FloatArray, others: FloatArray, measure: str) -> float:
    """Return the largest difference of two sets of rows, as `Quantity.measure` says."""
    if rows.shape != others.shape:
        raise SceneError(f"rows of shape {rows.shape} and {others.shape} cannot be compared")
    norms = np.linalg.norm(rows - others, axis=1)
    if measure == "rms":
        norms = norms / np.sqrt(rows.shape[1] / 3)
    return float(norms.max())


def limit(coarse: FloatArray, fine: FloatArray, ratio: float, order: float) -> FloatArray:
    """Return the limit of two solutions [Richardson1911], f + (f - c) / (ratio^order - 1) with ratio = h_c / h_f."""
    return np.asarray(fine + (fine - coarse) / (ratio**order - 1))


def standard(quantity: Quantity, reference: Reference, rungs: Sequence[FloatArray]) -> Standard:
    """Return a quantity's reference, from the rows of its rungs, coarse to fine (see `Reference`)."""
    fine, h, p = rungs[-1], reference.sizes, reference.order
    if p is None:
        rows, other = fine, rungs[-2]
    else:
        ratio = h[-2] / h[-1]
        rows = limit(rungs[-2], fine, ratio, p)
        other = fine
        if len(rungs) > 2:
            before = limit(rungs[-3], rungs[-2], h[-3] / h[-2], p)
            other = rows + (before - rows) / (ratio**p - 1)
    own = deviation(other, rows, quantity.measure)
    return Standard(rows, _scale(rows, quantity), own)


def _scale(rows: FloatArray, quantity: Quantity) -> float:
    """Return what an error of `quantity` is relative to."""
    if quantity.scale == "travel":
        return max(deviation(np.broadcast_to(row, rows.shape), rows, quantity.measure) for row in rows)
    return deviation(rows, np.zeros_like(rows), quantity.measure)
