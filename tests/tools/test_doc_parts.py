"""What scripts write into docs/: rows of a table by case, parts of a page; the page of time steps shows its tables."""

import csv
from pathlib import Path

import pytest

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


def test_the_page_of_verification_shows_what_its_table_holds() -> None:
    from benchmarks import stability

    page = (ROOT / "docs" / "verification.md").read_text(encoding="utf-8")
    lines = stability.summary()
    assert len(lines) == 2 + len(stability.CASES)
    assert "<!-- stability -->\n\n" + "\n".join(lines) + "\n\n<!-- end stability -->" in page
    passed = sum(int(line.split(" of ")[0].rsplit(" ", 1)[-1]) for line in lines[2:])
    assert f"{passed} runs of {passed}" in page
