"""Studies of accuracy by name: which package each comes from, and what `tripod study SCENE` runs."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tripod_study.plan import Plan
    from tripod_study.report import Report

PLANS = {
    "pendulum": "tripod_study.plans.pendulum",
    "cloth": "tripod_study.plans.cloth",
    "drape": "tripod_study.plans.drape",
    "silicone": "tripod_study.plans.silicone",
    "tripod_static": "tripod_study.plans.tripod_static",
    "tripod_dynamic": "tripod_study.plans.tripod_dynamic",
    "maze": "tripod_study.plans.maze",
    "ik": "tripod_ik.study_plan",
}
"""Modules with `plan(quick=...)` and `task(settings)`; only the one that runs is imported."""

GROUPS = {"tripod": ("tripod_static", "tripod_dynamic")}
"""Names that stand for several studies."""

REPORTS = ("pendulum", "drape")
"""Those whose module has `report(full=...)` as well, a table of the course report's variations."""


def names(scene: str) -> tuple[str, ...]:
    """Return the studies that a scene's name stands for; none if it is unknown."""
    return GROUPS.get(scene, (scene,) if scene in PLANS else ())


def plan(name: str, *, quick: bool) -> "Plan":
    """Return a study of accuracy, not yet run.

    Args:
        name: A key of PLANS.
        quick: Few points, against a coarser reference.
    """
    made: Plan = import_module(PLANS[name]).plan(quick=quick)
    return made


def report(name: str, *, full: bool) -> "Report":
    """Return a table of the course report's variations, not yet run.

    Args:
        name: One of REPORTS.
        full: All combinations of the values instead of one varied at a time.
    """
    made: Report = import_module(PLANS[name]).report(full=full)
    return made
