"""Which settings are worth taking: the Pareto front, the cheapest for an accuracy, fitted orders."""

from collections.abc import Sequence

import numpy as np

LEVELS = {"10%": 0.10, "5%": 0.05, "1%": 0.01, "0.1%": 0.001}
"""Accuracies for which the cheapest setting is named."""


def front(errors: Sequence[float | None], costs: Sequence[float | None]) -> list[int]:
    """Return the indices of the points that no other beats or equals in both error and cost, cheapest first.

    A point without error or cost is not on the front. Of equal points the first is.
    """
    known = [
        (cost, error, i)
        for i, (error, cost) in enumerate(zip(errors, costs, strict=True))
        if error is not None and cost is not None
    ]
    found: list[int] = []
    best = np.inf
    for _, error, i in sorted(known):
        if error < best:
            found.append(i)
            best = error
    return found


def cheapest(bounds: Sequence[float | None], costs: Sequence[float | None], allowed: float) -> int | None:
    """Return the index of the cheapest point whose error is within `allowed` for sure, None if there is none."""
    fit = [
        (cost, i)
        for i, (bound, cost) in enumerate(zip(bounds, costs, strict=True))
        if bound is not None and cost is not None and bound <= allowed
    ]
    return min(fit)[1] if fit else None


def order(sizes: Sequence[float], errors: Sequence[float]) -> float | None:
    """Return p of errors C h^p by least squares in logarithms over the three smallest `sizes`; None of fewer."""
    pairs = sorted(zip(sizes, errors, strict=True))[:3]
    if len(pairs) < 3 or any(h <= 0 or e <= 0 for h, e in pairs):
        return None
    h, e = np.log(np.array(pairs)).T
    return float(np.polyfit(h, e, 1)[0])
