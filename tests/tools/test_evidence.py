"""The pages of evidence: of what is stored, figures first, tables folded, and hardly any text written by hand."""

import re
from pathlib import Path

import pytest

from benchmarks import evidence, evidence_figures, evidence_tables, peers_report, stability
from benchmarks.doc_parts import DOCS

PAGES = ("accuracy.md", "verification.md", "reality.md", "speed.md", "peers.md")
MOST_WORDS = 4000
"""That people have written on all of these pages together."""

PART = re.compile(r"<!-- (?P<name>.+?) -->.*?<!-- end (?P=name) -->", re.DOTALL)


def by_hand(page: str) -> str:
    """Return what people have written on a page: neither parts that scripts write nor tables nor pictures."""
    text = peers_report.HEAD if page == "peers.md" else PART.sub("", evidence.read(page))
    return "\n".join(line for line in text.splitlines() if not line.startswith(("|", "<", "!")))


def test_the_pages_are_of_what_is_stored() -> None:
    assert not evidence.old(), "run python benchmarks/evidence.py"


@pytest.mark.parametrize("page", PAGES)
def test_a_page_begins_with_a_figure_and_a_short_table(page: str) -> None:
    lines = evidence.read(page).partition("<details")[0].splitlines()
    figure = next(k for k, line in enumerate(lines) if line.startswith("!["))
    table = [k for k, line in enumerate(lines) if line.startswith("|")]
    assert figure < 16
    assert table[0] < figure + 16
    words = " ".join(line for line in lines[1:figure] if not line.startswith("<"))
    assert 2 <= len(re.findall(r"[.?!](?: |$)", words)) <= 5


def test_people_have_written_little_on_them() -> None:
    assert sum(len(by_hand(page).split()) for page in PAGES) < MOST_WORDS


@pytest.mark.parametrize("page", PAGES)
def test_blocks_that_fold_have_a_summary_and_end(page: str) -> None:
    text = evidence.read(page)
    blocks = re.findall(
        r'<details markdown="1">\n<summary>[^\n]+</summary>\n\n(.*?)\n\n</details>\n', text, re.DOTALL
    )
    assert len(blocks) == text.count("<details") == text.count("</details>") > 0
    for block in blocks:
        assert block.count("<!-- end") * 2 == block.count("<!--"), "a part is all in a block"


def test_every_picture_of_the_pages_is_drawn_and_used(tmp_path: Path) -> None:
    used = {name for page in PAGES for name in re.findall(r"\]\(images/(\w+)\.png\)", evidence.read(page))}
    drawn = evidence.pictures()
    assert used == set(drawn)
    assert all((evidence.IMAGES / f"{name}.png").exists() for name in used)
    for name in ("accuracy_kept", "verification", "reality", "speed", "convergence"):
        drawn[name](tmp_path / f"{name}.png")
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_numbers_of_a_cell_are_read() -> None:
    assert evidence_figures.numbers("+2e-03, 4.1 x") == [0.002, 4.1]
    assert evidence_figures.numbers("-82.77") == [-82.77]
    assert evidence_figures.numbers("0.084, at most 0.86") == [0.084, 0.86]


def test_a_short_table_has_the_largest_difference_of_a_long_one() -> None:
    lines = evidence_tables.verification(evidence.read("verification.md"))
    cases = {line.split(" | ")[0].strip("| "): line for line in lines}
    twin = evidence.read("verification.md").partition("<!-- calculix -->")[2].partition("<!-- end")[0]
    found = [float(cell) for line in twin.splitlines()[4:] for cell in re.findall(r"\d\.\de-\d\d", line)]
    assert f"| {max(found):.2g} %" in cases["CalculiX on the same mesh"]


def test_the_page_of_verification_counts_the_runs_of_its_table() -> None:
    passed = sum(int(line.split(" of ")[0].rsplit(" ", 1)[-1]) for line in stability.summary()[2:])
    assert f"| {passed} of {passed} pass |" in (DOCS / "verification.md").read_text(encoding="utf-8")
