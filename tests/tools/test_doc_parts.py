"""What scripts write into docs/: rows of a table by case, parts of a page; the page of time steps shows its tables."""

import csv
from pathlib import Path

import pytest

from tests.messages import raises_naming

ROOT = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def _benchmarks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))


def test_rows_of_a_case_are_replaced_and_others_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import doc_parts

    monkeypatch.setattr(doc_parts, "DOCS", tmp_path)
    head = ["| a | b |", "|---|---|"]
    doc_parts.write_rows("t.csv", "one", [*head, "| 1 |  |"])
    doc_parts.write_rows("t.csv", "two", [*head, "| 2 | x, y |"])
    doc_parts.write_rows("t.csv", "one", [*head, "| 3 | z |", "| 4 | w |"])
    rows = list(csv.reader((tmp_path / "t.csv").read_text().splitlines()))
    assert rows == [["case", "a", "b"], ["one", "3", "z"], ["one", "4", "w"], ["two", "2", "x, y"]]
    assert doc_parts.markdown(doc_parts.read_rows("t.csv")[-1:], ["b", "case"])[2:] == ["| x, y | two |"]


def test_the_page_of_time_steps_shows_what_its_tables_hold() -> None:
    import auto_dt
    import time_error

    page = (ROOT / "docs" / "time_error.md").read_text(encoding="utf-8")
    for name, lines in (("front", time_error.front()), ("auto", auto_dt.summary())):
        assert len(lines) > 8
        assert f"<!-- {name} -->\n\n" + "\n".join(lines) + f"\n\n<!-- end {name} -->" in page


def test_the_page_of_inverse_kinematics_sums_up_its_circles() -> None:
    import ik_circles

    page = (ROOT / "docs" / ik_circles.PAGE).read_text(encoding="utf-8")
    part = page.partition("<!-- ik circles: summary -->")[2].partition("<!-- end")[0]
    assert ik_circles.summary(page).split() == part.split()


def test_a_part_of_a_page_is_read_as_it_was_written() -> None:
    from benchmarks.doc_parts import part, renewed, table_of

    lines = ["Of 3.", "", "| a | b |", "|---|---|", "| 1 |  |", "| 2 | x, y |", "", "After."]
    text = renewed("# Page\n\n<!-- one -->\n<!-- end one -->\n", "one", lines)
    assert part(text, "one") == lines
    assert table_of(text, "one") == [{"a": "1", "b": ""}, {"a": "2", "b": "x, y"}]
    with raises_naming(ValueError, "<!-- two -->"):
        part(text, "two")
