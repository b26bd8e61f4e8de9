"""Read the plan of a study from a TOML file: what is varied, what is measured, and against what.

A plan is data. A new one is one file in `tripod_study/plans`, and nothing else lists it. The tables of the file:

    title, scene, version, ...   as the attributes of `Plan`
    [motion]          duration and interval [s], servo, slide: what `watch.task` runs; none where `module` names a task
    [rows]            what is observed: name = "observable" or ["observable", "reduction"], see `watch`
    [base]            settings of all points
    [default]         settings of the shipped scene
    [settings.NAME]   further settings by name, as changes of the default
    [[points]]        all combinations of the values listed; `label` for a single setting that people know by a name
    [[quantity]]      as the attributes of `Quantity`
    [[reference]]     as the attributes of `Reference`; rungs are changes, of the point itself where `of_point` is set
    [[knob]]          what is varied besides the fields of a scene
    [quick]           what takes the place of tables of the same name in the short form

Points, rungs and named settings are changes of the default, or of the settings that `from` names; `from = "nothing"`
leaves all others out.
"""

import tomllib
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

from tripod_sim.errors import SceneError
from tripod_study.plan import Knob, Plan, Point, Quantity, Reference, Settings, points_of

TABLES = ("motion", "rows", "base", "default", "settings", "points", "quantity", "reference", "knob", "quick")
WORDS = (
    "title", "scene", "version", "module", "group", "solves", "order_knob", "order_quantity", "limit", "note", "draft",
)  # fmt: skip


def read_plan(path: Path, *, quick: bool) -> Plan:
    """Return the plan in a file, under the file's name.

    Args:
        path: Of the TOML file.
        quick: Whether to return the short form.

    Raises:
        SceneError: a table, a name or a value is missing or unknown; the message names the file.
    """
    try:
        read = tomllib.loads(path.read_text(encoding="utf-8"))
        return _plan(path.stem, read | read.get("quick", {}) if quick else read, quick=quick)
    except (tomllib.TOMLDecodeError, KeyError, TypeError, ValueError) as error:
        reason = f"{error} is missing or unknown" if isinstance(error, KeyError) else str(error)
        raise SceneError(
            f"{path}: {reason}; tripod_study.plan_file describes the tables of a plan"
        ) from error


def _plan(name: str, read: Mapping[str, Any], *, quick: bool) -> Plan:
    for key in read:
        if key not in (*TABLES, *WORDS):
            raise KeyError(key)
    default: Settings = read["default"]
    known: dict[str, Settings] = {"nothing": {}, "default": default}
    for key, changes in read.get("settings", {}).items():
        known[key] = _changed(changes, known)
    points = [point for entry in read["points"] for point in _points(entry, known)]
    words = {word: read[word] for word in WORDS if word in read}
    if "draft" in words:
        words["draft"] = known[words["draft"]]
    given = {}
    if "motion" in read:
        from tripod_study import watch  # noqa: PLC0415 - heavy

        words.setdefault("module", watch.__name__)
        given = watch.given(read["scene"], read["rows"], **read["motion"])
    return Plan(
        name=name,
        default=default,
        points=points_of(default, points),
        quantities=tuple(Quantity(**entry) for entry in read["quantity"]),
        references=tuple(_reference(entry, known) for entry in read["reference"]),
        quick=quick,
        base=read.get("base", {}),
        others=tuple(Knob(**entry) for entry in read.get("knob", ())),
        given=given,
        **words,
    )


def _changed(changes: Mapping[str, Any], known: Mapping[str, Settings]) -> dict[str, Any]:
    """Return the settings that `from` names with the changes; values may be lists."""
    return {**known[changes.get("from", "default")], **{k: v for k, v in changes.items() if k != "from"}}


def _points(entry: Mapping[str, Any], known: Mapping[str, Settings]) -> list[Point]:
    """Return the points of all combinations of the values listed, the last one varied fastest."""
    values = _changed({k: v for k, v in entry.items() if k != "label"}, known)
    lists = {k: entry[k] for k in entry if isinstance(values.get(k), list)}
    return [
        Point({**values, **dict(zip(lists, chosen, strict=True))}, entry.get("label", ""))
        for chosen in product(*lists.values())
    ]


def _reference(entry: Mapping[str, Any], known: Mapping[str, Settings]) -> Reference:
    changes: list[dict[str, Any]] = entry["rungs"]
    rungs: Callable[[Settings], Sequence[Settings]]
    if entry.get("of_point", False):

        def rungs(settings: Settings) -> Sequence[Settings]:
            return tuple({**settings, **rung} for rung in changes)
    else:
        fixed = tuple(_changed(rung, known) for rung in changes)

        def rungs(_: Settings) -> Sequence[Settings]:
            return fixed

    return Reference(entry.get("name", "reference"), rungs, entry.get("order"), tuple(entry.get("sizes", ())))
