"""The convergence study: its arithmetic, that it resumes, and what its table holds."""

import csv
from pathlib import Path

import numpy as np
import pytest

from benchmarks import convergence, convergence_report
from benchmarks.convergence import Row

ROWS = list(convergence.read().values())
KNOWN = convergence_report.references(ROWS)


@pytest.mark.parametrize("p", [1.3, 2.0, 3.7])
def test_order_and_limit_of_a_power_are_found(p: float) -> None:
    found, limit = convergence_report.order([5.0 - 0.3 * m**-p for m in (2, 3, 4)], [2, 3, 4])
    assert found == pytest.approx(p, abs=1e-4)
    assert limit == pytest.approx(5.0, abs=1e-6)


@pytest.mark.parametrize("values", [[1.0, 2.0, 1.5], [1.0, 2.0, 4.0], [1.0, 1.0, 1.0], [1.0, 0.8, 0.7]])
def test_what_is_no_power_has_no_order(values: list[float]) -> None:
    assert all(np.isnan(found) for found in convergence_report.order(values, [1, 2, 3]))


def test_a_stopped_study_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each row is on disk as soon as it is done; one that is there is not computed again."""
    solved: list[tuple[str, str, int]] = []

    def solve(row: Row) -> None:
        if len(solved) == 2:
            solved.append(row.key)
            raise KeyboardInterrupt
        solved.append(row.key)
        row.unknowns, row.L1, row.note = 7, -1.25e-3, "L4: nothing, found"

    monkeypatch.setattr(convergence, "TABLE", tmp_path / "table.csv")
    monkeypatch.setattr(convergence, "MESHES", [("sharp", "t4", n) for n in (1, 2, 3, 4, 10)])
    monkeypatch.setattr(convergence, "solve", solve)
    with pytest.raises(KeyboardInterrupt):
        convergence.compute(convergence.read(), None, quick=True)
    assert [key[2] for key in solved] == [1, 2, 3]
    rows = convergence.read()
    assert [key[2] for key in rows] == [1, 2]
    row = rows["sharp", "t4", 2]
    assert (row.unknowns, row.L1, row.note) == (7, -1.25e-3, "L4: nothing, found")
    assert np.isnan(row.L4)
    convergence.compute(rows, None, quick=True)
    assert [key[2] for key in solved] == [1, 2, 3, 3, 4]  # 10 is among the finest


def test_a_row_is_what_the_load_cases_give() -> None:
    from benchmarks import load_cases

    row = Row("sharp", "h8_modes", 1)
    convergence.solve(row)
    assert row.note == ""
    found = load_cases.measure(("mesh.level=1",))
    assert pytest.approx(found["L1 height"], abs=1e-7) == row.L1
    assert pytest.approx(found["L2 strain energy"], rel=1e-6) == row.L2
    assert pytest.approx(found["L3 shift"], abs=1e-7) == row.L3
    assert pytest.approx(found["L4 height"], abs=2e-7) == row.L4
    assert 3e-3 < row.L5 < 6e-3


def test_the_table_on_disk_is_what_the_code_computes() -> None:
    row = Row("compliant", "h8_modes", 8)
    convergence.solve(row)
    kept = convergence.read()[row.key]
    assert row.unknowns == kept.unknowns
    for name in convergence_report.NAMES:
        assert getattr(row, name) == pytest.approx(getattr(kept, name), rel=1e-4)


def test_every_element_and_level_is_in_the_table() -> None:
    with convergence.TABLE.open(newline="") as file:
        keys = [(line["clamp"], line["element"], int(line["level"])) for line in csv.DictReader(file)]
    assert len(keys) == len(set(keys))
    assert set(keys) == set(convergence.MESHES)


def test_the_short_table_names_a_setting_of_both_kinds_for_each_clamp() -> None:
    rows = [line.split(" | ") for line in convergence_report.settings(ROWS, KNOWN)[2:]]
    assert len(rows) == 4
    for clamp, purpose, element, level, _, error, _ in rows:
        name = next(k for k, v in convergence_report.CLAMPS.items() if v == clamp.strip("| "))
        row = next(r for r in ROWS if r.key == (name, element.strip("`"), int(level)))
        assert float(error) == pytest.approx(convergence_report.worst(row, KNOWN[name]), abs=0.05)
        assert float(error) < (1 if "within 1 %" in purpose else 5)


def test_the_reference_is_converged_to_a_thousandth() -> None:
    """The limits of two elements agree, and that of the reference with its limit from coarser meshes."""
    assert set(KNOWN["compliant"]) == set(convergence_report.NAMES)
    for name in convergence_report.NAMES:
        limits = [convergence_report.richardson(ROWS, element, name)[1] for element in ("h20", "h27")]
        limits.append(convergence_report.richardson(ROWS, "h27", name, skip=1)[1])
        assert limits[1] == pytest.approx(KNOWN["compliant"][name])
        assert limits[0] == pytest.approx(limits[1], rel=1e-3), name
        assert limits[2] == pytest.approx(limits[1], rel=1e-3), name


def test_there_is_a_setting_within_5_and_one_within_1_percent() -> None:
    for clamp, reference in KNOWN.items():
        own = [r for r in ROWS if r.clamp == clamp]
        assert min(convergence_report.worst(r, reference) for r in own if r.unknowns < 1500) < 5
        assert min(convergence_report.worst(r, reference) for r in own) < 1
