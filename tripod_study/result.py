"""From measured points to a study's result: errors, front, cheapest settings, orders. It is what the JSON file holds.

The result is one table of plain values, SI units throughout:

    format        1; raised when the meaning of a field changes
    study, title, scene, note
    quick         whether it is the short form, against a coarser reference
    group         field by which a picture colours the points
    versions      of tripod and of the study; code: fingerprint of what measured the points, null if it is unknown
    machine       calibration: CPU time of a 1000 x 1000 float64 product beside the points, the median [s]; processor
    base          {field: value} of all points
    knobs         [{name, field, what, values}]
    default       {field: value} of the scene as shipped, or the nearest that the study can run
    draft         {field: value} of `--accuracy draft`; null: the cheapest that is exact enough for it
    cpu           unit of the points' cpu: `s per simulated second` or `s per solve`
    quantities    [{name, unit, what, scale, promised}]; the first is the study's error; scale: what relative errors
                  refer to; promised: whether `--accuracy` promises it beside the first
    reference     of the first quantity: settings of its finest rung, all rungs, own_error (relative)
    references    the same of every quantity, for each group of points that shares a reference
    points        [{label, settings {field: value}, status, message, unknowns, error, own_error, bound, below, errors
                  {quantity: {relative, absolute, own}}, cpu, cpu_median, repeats, on_front}]
    front         indices of points, cheapest first
    cheapest      {"10%": index or null, "5%", "1%", "0.1%"}: least cpu of all whose bound, and that of all else that is
                  promised, is within
    order_knob    field in which orders are fitted, and order_quantity, of which; empty for none
    orders        [{settings, order, points}]: fitted orders
    advice        sentences

error, own_error, bound are of the first quantity and relative: bound = error + own_error is what a user may count on;
below tells that error is less than twice own_error, so that it says no more than "less than that". status is `ok`,
`diverged`, `refused`, `failed`, `time limit` or `crashed`; where it is not `ok`, errors and cpu are null.
"""

import platform
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

import numpy as np

from tripod_study.advice import advice
from tripod_study.deviation import Standard, deviation, standard
from tripod_study.front import LEVELS, cheapest, front, order
from tripod_study.plan import Plan, Point, Quantity, Settings

FORMAT = 1

DRIVE = (
    "let gravity, a load, a servo or an initial velocity move it, or name by [[marker]] a place that moves"
)

Record = Mapping[str, Any]
"""Of a point: see `task.outcome`."""


class _Standards:
    """References of quantities, each made once."""

    def __init__(self, plan: Plan, records: Mapping[str, Record]) -> None:
        self._plan, self._records = plan, records
        self._made: dict[tuple[str, ...], Standard | str] = {}

    def rungs(self, quantity: Quantity, settings: Settings) -> Sequence[Settings]:
        return next(r for r in self._plan.references if r.name == quantity.reference).rungs(settings)

    def of(self, quantity: Quantity, settings: Settings) -> Standard | str:
        """Return the reference of a quantity at a point, or why there is none."""
        reference = next(r for r in self._plan.references if r.name == quantity.reference)
        keys = tuple(self._plan.key(rung) for rung in reference.rungs(settings))
        name = (quantity.name, *keys)
        if name not in self._made:
            records = [self._records[key] for key in keys]
            bad = next((r for r in records if r["status"] != "ok"), None)
            self._made[name] = (
                f"the reference {reference.name!r} could not be computed: {bad['status']}: {bad['message']}"
                if bad
                else standard(quantity, reference, [np.array(r["observed"][quantity.key]) for r in records])
            )
            if quantity == self._plan.quantities[0] and not getattr(self._made[name], "scale", 1.0):
                self._made[name] = f"no measured quantity changes ({quantity.name}): {DRIVE}"
        return self._made[name]


def assemble(plan: Plan, records: Mapping[str, Record], version: str) -> dict[str, Any]:
    """Return the result of a study.

    Args:
        plan: Whose points were run.
        records: By `plan.key`, of all `plan.runs()`; see `task.outcome`, and `code`, a `fingerprint`.
        version: Of tripod.
    """
    standards = _Standards(plan, records)
    rows = [_row(plan, point, records[plan.key(point.settings)], standards) for point in plan.points]
    errors = [None if r["error"] is None else max(r["error"], 2 * r["own_error"]) for r in rows]
    costs, bounds = [r["cpu"] for r in rows], [_widest(plan, r) for r in rows]
    best = front(errors, costs)
    for i, row in enumerate(rows):
        row["on_front"] = i in best
    references = _references(plan, standards)
    calibrations = [r["calibration"] for r in records.values() if r.get("calibration")]
    codes = {r["code"] for r in records.values() if "code" in r}
    made: dict[str, Any] = {
        "format": FORMAT,
        "study": plan.name,
        "title": plan.title,
        "scene": plan.scene,
        "studied": plan.studied or None,
        "note": plan.note,
        "quick": plan.quick,
        "group": plan.group,
        "versions": {
            "tripod": version,
            "study": plan.version,
            "code": codes.pop() if len(codes) == 1 else None,
        },
        "machine": {
            "calibration": median(calibrations) if calibrations else None,
            "processor": platform.machine(),
        },
        "base": dict(plan.base),
        "knobs": [
            {
                "name": k.name,
                "field": k.field,
                "what": k.what,
                "values": list(dict.fromkeys(p.settings[k.field] for p in plan.points)),
            }
            for k in plan.knobs
        ],
        "default": dict(plan.default),
        "draft": dict(plan.draft) if plan.draft else None,
        "cpu": "s per solve" if plan.solves else "s per simulated second",
        "quantities": [
            {
                "name": q.name,
                "unit": q.unit,
                "what": q.what,
                "scale": _scale(references, q),
                "promised": q.promised,
            }
            for q in plan.quantities
        ],
        "reference": next((r for r in references if r["quantity"] == plan.quantities[0].name), None),
        "references": references,
        "points": rows,
        "front": best,
        "cheapest": {name: cheapest(bounds, costs, level) for name, level in LEVELS.items()},
        "order_knob": plan.order_knob,
        "order_quantity": plan.order_quantity,
        "orders": _orders(plan, rows),
    }
    made["advice"] = advice(made)
    return made


def _row(plan: Plan, point: Point, record: Record, standards: _Standards) -> dict[str, Any]:
    """Return a point of the result."""
    row: dict[str, Any] = {
        "label": point.label,
        "settings": dict(point.settings),
        "status": record["status"],
        "message": record["message"],
        "unknowns": record.get("unknowns"),
        "error": None,
        "own_error": None,
        "bound": None,
        "below": False,
        "errors": {},
        "cpu": None,
        "cpu_median": None,
        "repeats": len(record["cpu"]),
    }
    if record["status"] != "ok":
        return row
    row["cpu"] = min(record["cpu"]) / record["amount"]
    row["cpu_median"] = median(record["cpu"]) / record["amount"]
    for quantity in plan.quantities:
        found = standards.of(quantity, point.settings)
        if isinstance(found, str):
            row["message"] = row["message"] or found
            continue
        rows = np.array(record["observed"][quantity.key])
        absolute = deviation(rows, found.rows, quantity.measure)
        scale = found.scale or 1.0
        row["errors"][quantity.name] = {
            "relative": absolute / scale,
            "absolute": absolute,
            "own": found.own / scale,
        }
    if first := row["errors"].get(plan.quantities[0].name):
        row["error"], row["own_error"] = first["relative"], first["own"]
        row["bound"] = row["error"] + row["own_error"]
        row["below"] = row["error"] < 2 * row["own_error"]
    return row


def _widest(plan: Plan, row: Mapping[str, Any]) -> float | None:
    """Return the largest bound of a point among what is promised; None if its own is not known."""
    others = [row["errors"].get(q.name) for q in plan.quantities if q.promised]
    if row["bound"] is None or None in others:
        return None
    return float(max([row["bound"], *(e["relative"] + e["own"] for e in others)]))


def _references(plan: Plan, standards: _Standards) -> list[dict[str, Any]]:
    """Return what each quantity is held against, once for each set of rungs."""
    found: dict[tuple[str, ...], dict[str, Any]] = {}
    for quantity in plan.quantities:
        for point in plan.points:
            rungs = standards.rungs(quantity, point.settings)
            name = (quantity.name, *(plan.key(rung) for rung in rungs))
            if name in found:
                continue
            made = standards.of(quantity, point.settings)
            failed = isinstance(made, str)
            found[name] = {
                "quantity": quantity.name,
                "name": quantity.reference,
                "settings": plan.full(rungs[-1]),
                "rungs": [plan.full(rung) for rung in rungs],
                "own_error": None if isinstance(made, str) else made.own / (made.scale or 1.0),
                "scale": None if isinstance(made, str) else made.scale,
                "message": made if failed else "",
            }
    return list(found.values())


def _scale(references: Sequence[Mapping[str, Any]], quantity: Quantity) -> float | None:
    """Return what a quantity's errors are relative to, at its first reference."""
    return next((r["scale"] for r in references if r["quantity"] == quantity.name), None)


def _orders(plan: Plan, rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the fitted order of each family of points that differ in the order knob alone."""
    if not plan.order_knob:
        return []
    families: dict[tuple[tuple[str, Any], ...], list[tuple[float, float]]] = {}
    for row in rows:
        error = row["errors"].get(plan.order_quantity)
        if error is None or error["relative"] < 2 * error["own"]:
            continue
        others = tuple((k, v) for k, v in row["settings"].items() if k != plan.order_knob)
        families.setdefault(others, []).append((float(row["settings"][plan.order_knob]), error["relative"]))
    found = []
    for others, pairs in families.items():
        sizes, errors = zip(*pairs, strict=True)
        p = order(sizes, errors)
        if p is not None:
            found.append({"settings": dict(others), "order": p, "points": min(len(pairs), 3)})
    return found
