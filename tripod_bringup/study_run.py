"""Running a study's points, here or on a cluster, keeping each as it is done."""

import math
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import TYPE_CHECKING, Any

from tripod_bringup.study_store import Store
from tripod_bringup.study_worker import Workers, lost
from tripod_study.fingerprint import fingerprint

if TYPE_CHECKING:
    from tripod_study.plan import Plan, Settings

Job = tuple[str, str, "Settings", float]
"""Key of a point, its task's module, its settings, its time limit [s]."""

LOST = {"status": "crashed"}
AGAIN = ("crashed", "time limit")
"""Points that are run again when a study is resumed: what ended them may have been the machine."""

Executor = Callable[[Sequence[Job]], Iterator[tuple[str, dict[str, Any]]]]
"""Yields key and record of each job as it is done."""


def local(jobs: int) -> Executor:
    """Return what runs points on this machine, `jobs` at a time, each in a process of its own."""

    def run(work: Sequence[Job]) -> Iterator[tuple[str, dict[str, Any]]]:
        workers, pool = Workers(), ThreadPoolExecutor(jobs)
        try:
            futures = {pool.submit(workers.measure, *job[1:]): job[0] for job in work}
            for future in as_completed(futures):
                yield futures[future], future.result()
        finally:  # whatever ends this: no process stays behind, no thread waits for one
            pool.shutdown(wait=False, cancel_futures=True)
            workers.end()

    return run


def run_plan(
    plan: "Plan", store: Store, execute: Executor, *, seed: int = 0, progress: Callable[[int, int], None] | None = None
) -> dict[str, dict[str, Any]]:  # fmt: skip
    """Measure what the store lacks of a study; return all its records by key.

    A point that a machine of a cluster measured with other code than this counts as crashed.

    Args:
        plan: The study.
        store: Of points; those in it that finished, or failed for a reason of their own, are not measured again, unless
            other code did that (see `outdated`).
        execute: `local(jobs)` or a cluster.
        seed: Of the order of the points, so that what changes on the machine meanwhile is no trend in a knob.
        progress: Called with the numbers of points done and of all.
    """
    here = fingerprint(plan.module)
    rungs, others = plan.runs()
    random.Random(seed).shuffle(others)
    jobs = {plan.key(s): (plan.key(s), plan.module, plan.told(s), plan.limit) for s in [*rungs, *others]}
    work = [job for key, job in jobs.items() if not _stands(plan, store.records.get(key, LOST), here)]
    done = len(jobs) - len(work)
    if progress:
        progress(done, len(jobs))
    for key, record in execute(work) if work else ():
        if record.get("code", here) != here:
            record = lost("crashed", f"measured by other code, {record['code']}; here it is {here}")  # noqa: PLW2901
        store.add(key, {"study": plan.name, "settings": dict(jobs[key][2]), **record})
        done += 1
        if progress:
            progress(done, len(jobs))
    return {key: store.records[key] for key in jobs}


def outdated(plan: "Plan", store: Store) -> int:
    """Return how many points of a study the store has from other code than this: they are measured again."""
    here, records = fingerprint(plan.module), store.records
    keys = {plan.key(s) for some in plan.runs() for s in some}
    found = [records[key] for key in keys & records.keys() if whole(plan, records[key])]
    return sum(record["status"] not in AGAIN and record.get("code") != here for record in found)


def whole(plan: "Plan", record: Mapping[str, Any]) -> bool:
    """Return whether a record from a file has all that a result is made of; a damaged one is measured again."""
    words = (record.get("status"), record.get("message"))
    numbers, observed = record.get("cpu"), record.get("observed")
    if not (all(isinstance(word, str) for word in words) and isinstance(numbers, list)):
        return False
    if not all(
        _positive(record.get(key) or 1.0) for key in ("unknowns", "calibration")
    ):  # 0 or none: not told
        return False
    if words[0] != "ok":
        return True
    return (
        bool(numbers)
        and all(_positive(number) for number in [*numbers, record.get("amount")])
        and isinstance(observed, dict)
        and all(_rows(observed.get(quantity.key)) for quantity in plan.quantities)
    )


def _positive(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 < value < math.inf


def _rows(value: Any) -> bool:
    """Return whether a value is a table of finite numbers."""
    if not (isinstance(value, list) and value and all(isinstance(row, list) and row for row in value)):
        return False
    cells = [cell for row in value for cell in row]
    return len({len(row) for row in value}) == 1 and all(
        isinstance(cell, int | float) and math.isfinite(cell) for cell in cells
    )


def _stands(plan: "Plan", record: dict[str, Any], here: str) -> bool:
    """Return whether a point need not be measured again; `here`: fingerprint of the code that would do it."""
    return whole(plan, record) and record["status"] not in AGAIN and record.get("code") == here
