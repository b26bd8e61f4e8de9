"""The effects, each a module here that its name finds (see `effect.py`): whoever adds one adds a file.

What a scene does not name is not imported beyond its table, allocates nothing and has no stage of a step
(docs/effects.md).
"""

from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from tripod_sim.effect import Described, Effect


def _found() -> dict[str, Effect]:
    names = [module.name for module in iter_modules(__path__)]
    found = {name: import_module(f"{__name__}.{name}").EFFECT for name in names}
    return dict(sorted(found.items(), key=lambda item: item[1].rank))


EFFECTS: dict[str, Effect] = _found()
"""All effects by name."""


def named(scene: Described) -> list[str]:
    """Return the effects that a scene names."""
    return [name for name in EFFECTS if getattr(scene, name)]


def absent(scene: Described) -> list[str]:
    """Return the effects that a scene does not name."""
    return [name for name in EFFECTS if not getattr(scene, name)]


def has(scene: Described, name: str) -> bool:
    """Return whether a scene has an effect, by its own table or by one of a body."""
    there = EFFECTS[name].there
    return there(scene) if there else bool(table_of(scene, name))


def table_of(scene: Described, name: str) -> Any:
    """Return the table that a scene has of an effect, or all of them where there may be several."""
    found = EFFECTS[name].found
    return found(scene) if found else getattr(scene, name)


def words(name: str) -> tuple[str, ...]:
    """Return the overrides that switch an effect on with its defaults."""
    return (EFFECTS[name].words if name in EFFECTS else ()) or (f"{name}={{}}",)


def meaning(name: str) -> str:
    """Return in one sentence what an effect is, from its table's docstring."""
    paragraph = (EFFECTS[name].table.__doc__ or "").strip().partition("\n\n")[0]
    return " ".join(paragraph.split()).partition(". ")[0].rstrip(".") + "."
