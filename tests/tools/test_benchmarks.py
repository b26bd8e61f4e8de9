"""Every benchmark has a use: a page names it, or another benchmark imports it."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
BENCHMARKS = sorted((ROOT / "benchmarks").glob("*.py"))
PAGES = [*sorted((ROOT / "docs").rglob("*.md")), ROOT / "README.md", ROOT / "Makefile"]


def unused(pages: str, programs: dict[str, str]) -> list[str]:
    """Return the programs, texts by name, that no page names as a file and no other program imports."""
    used = {name for text in programs.values() for name in imported(text)}
    return [name for name in programs if name not in used and not re.search(rf"benchmarks/{name}\.py", pages)]


def imported(text: str) -> set[str]:
    """Return the last names of the modules that a program imports or names as `benchmarks.NAME`."""
    found = set(re.findall(r"\bbenchmarks\.(\w+)", text))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom):
            found |= {(node.module or "").rpartition(".")[2], *(alias.name for alias in node.names)}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return found


def test_a_page_names_each_benchmark_or_another_one_imports_it() -> None:
    programs = {path.stem: path.read_text(encoding="utf-8") for path in BENCHMARKS}
    assert len(programs) > 50
    assert unused("\n".join(path.read_text(encoding="utf-8") for path in PAGES), programs) == []


def test_a_benchmark_without_use_is_found() -> None:
    programs = {
        "alone": "from benchmarks import (\n    peers,\n)\nfrom doc_parts import cells\n",
        "peers": "KINDS = ['benchmarks.peers_own']\n",
        "peers_own": "",
        "doc_parts": "",
        "named": "",
    }
    assert unused("`python benchmarks/named.py`, alone.py", programs) == ["alone"]
