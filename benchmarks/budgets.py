"""How much more accurate than what `--budget` picks any setting is that takes no longer; `evidence.py` has the table.

For each studied motion six budgets of CPU time for a simulated second, evenly spaced in their logarithm from the
cheapest setting that `--budget` may pick to the dearest; against all settings of the study, those included whose steps
would not stay stable on another body. The error is the largest of all that the study promises: of the Tripod in motion
that of the move or of the pose. `--budget` takes the same with margins, which differ, and so may another. Errors and
times are the study's; what the ratio is of the first alone, the move, stands in brackets.
"""

from collections.abc import Callable

import numpy as np

from tripod_study.accuracy.choice import Budget, pick, stays_stable
from tripod_study.accuracy.stored import StoredPoint, StoredStudy, read_study, stored_studies

COUNT = 6
"""Of budgets."""


def budgets(study: StoredStudy) -> list[float]:
    """Return CPU times of a simulated second on the study's machine [s]."""
    costs = [p.cpu for p in study.points if stays_stable(p)]
    return np.geomspace(min(costs), max(costs), COUNT).tolist()


def of_all(point: StoredPoint) -> float:
    """Return the largest relative error of all that a study promises."""
    return max([point.error, *(error for error, _ in point.others)])


def of_first(point: StoredPoint) -> float:
    """Return the relative error of the first of these."""
    return point.error


def ratio(study: StoredStudy, budget: float, error: Callable[[StoredPoint], float] = of_all) -> float:
    """Return the error of what is picked for a budget over the least of all settings that take no longer."""
    picked = pick(study, Budget("budget", share=budget * (1 + 1e-9)), 1.0)
    return error(picked) / min(error(p) for p in study.points if p.cpu <= budget * (1 + 1e-9))


def table() -> list[str]:
    """Return the table."""
    lines = [
        "| study | settings | budgets [CPU s per simulated second] | error over the least possible, by budget | worst |"
    ]
    lines.append("|---" * 5 + "|")
    for study in map(read_study, stored_studies()):
        if study.solves:
            continue
        shares = budgets(study)
        found = [ratio(study, share) for share in shares]
        alone = max(ratio(study, share, of_first) for share in shares)
        words = (
            f"{shares[0]:.2g} to {shares[-1]:.2g}",
            ", ".join(f"{v:.2f}" for v in found),
            f"{max(found):.2f}" + f" ({alone:.2f})" * bool(study.others),
        )
        lines.append(f"| {study.name} | {len(study.points)} | {' | '.join(words)} |")
    return lines
