"""What mkdocs asks while it builds the site: pages that are no files of docs/, and citations as links."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

from tools.reference import citations, command_line, copies, python_api, scene_fields

WRITTEN: dict[str, Callable[[], str]] = {
    "reference/scene.md": scene_fields.page,
    "reference/commands.md": command_line.commands_page,
    "reference/parameters.md": command_line.parameters_page,
    "reference/python.md": python_api.page,
}
"""Pages that are written from the code."""


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that are no files of docs/."""
    pages = dict(WRITTEN)
    for page in copies.sources():
        pages[page] = partial(copies.copied, page)
    for name, write in pages.items():
        files.append(File.generated(config, name, content=write()))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Link citations to the list of references."""
    if page.file.src_uri == citations.LIST:
        return citations.anchored(markdown)
    known = citations.keys((Path(config.docs_dir) / citations.LIST).read_text(encoding="utf-8"))
    return citations.linked(markdown, page.file.src_uri, known)
