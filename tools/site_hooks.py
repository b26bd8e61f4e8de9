"""Hooks of mkdocs: pages that are not files of docs/, the command reference, and citations as links."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from mkdocs.plugins import event_priority
from mkdocs.structure.files import File, Files

from tools.reference import citations, command_line, copies, python_api, scene_fields

WRITTEN: dict[str, Callable[[], str]] = {
    "reference/scene.md": scene_fields.page,
    "reference/parameters.md": command_line.parameters_page,
    "reference/python.md": python_api.page,
}
"""Pages generated from the code."""
WEIGHTS = {
    "project/": 0.01,
    "references.md": 0.01,
    "reference/": 0.1,
    "learn/": 0.3,
    "index.md": 0.3,
    "glossary.md": 0.5,
}
"""Weights of pages in the search, by the start of their names; 1 unless listed."""
COMMANDS = "commands.md"
"""The page to which the generated command reference is appended."""


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that are not files of docs/."""
    pages = dict(WRITTEN)
    for page in copies.sources():
        pages[page] = partial(copies.copied, page)
    for name, write in pages.items():
        files.append(File.generated(config, name, content=write()))
    return files


@event_priority(100)  # before the plugin that shows tags
def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Append the command reference to its page, link citations, set the keywords and the weight in the search."""
    page.meta["tags"] = config.extra["keywords"].get(page.file.src_uri, [])
    page.meta["search"] = {
        "boost": next((w for start, w in WEIGHTS.items() if page.file.src_uri.startswith(start)), 1.0)
    }
    if (Path(config.docs_dir) / page.file.src_uri).is_file():
        markdown = copies.relinked(markdown, f"docs/{page.file.src_uri}", page.file.src_uri)
    if page.file.src_uri == COMMANDS:
        markdown = f"{markdown}\n{command_line.command_sections()}"
    if page.file.src_uri == citations.LIST:
        return citations.anchored(markdown)
    known = citations.keys((Path(config.docs_dir) / citations.LIST).read_text(encoding="utf-8"))
    return citations.linked(markdown, page.file.src_uri, known)
