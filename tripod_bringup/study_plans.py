"""Studies of accuracy by name, which package each comes from, and what `tripod study SCENE` runs."""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tripod_study.plan import Plan
    from tripod_study.report import Report


def _folder(package: str) -> Path:
    """Return the folder of a package, which is not imported."""
    found = find_spec(package)
    assert found
    assert found.origin
    return Path(found.origin).parent


PLANS = {
    **{path.stem: path for path in sorted((_folder("tripod_study") / "plans").glob("*.toml"))},
    "ik": _folder("tripod_ik") / "ik.toml",
}
"""Files of plans (`tripod_study.plan_file`)."""

GROUPS = {"tripod": ("tripod_static", "tripod_dynamic")}
"""Names that stand for several studies."""

REPORTS = {
    "pendulum": "tripod_study.variations.pendulum",
    "drape": "tripod_study.variations.drape",
}
"""Modules with `report(full=...)`, a table of the course report's variations."""


def names(scene: str) -> tuple[str, ...]:
    """Return the studies that a scene's name stands for; none if it is unknown."""
    return GROUPS.get(scene, (scene,) if scene in PLANS else ())


def plan(name: str, *, quick: bool) -> "Plan":
    """Return a study of accuracy, not yet run.

    Args:
        name: A key of PLANS.
        quick: Few points, against a coarser reference.
    """
    from tripod_study.plan_file import read_plan  # noqa: PLC0415 - heavy

    return read_plan(PLANS[name], quick=quick)


def report(name: str, *, full: bool) -> "Report":
    """Return a table of the course report's variations, not yet run.

    Args:
        name: One of REPORTS.
        full: All combinations of the values instead of one varied at a time.
    """
    made: Report = import_module(REPORTS[name]).report(full=full)
    return made
