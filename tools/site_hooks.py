"""What mkdocs asks while it builds the site: pages that are written from the code, and links into the repository."""

from collections.abc import Callable
from functools import partial
from typing import Any

from mkdocs.structure.files import File, Files

from tools.reference import command_line, copies, python_api, scene_fields

PAGES: dict[str, Callable[[], str]] = {
    "reference/scene.md": scene_fields.page,
    "reference/commands.md": command_line.commands_page,
    "reference/parameters.md": command_line.parameters_page,
    "reference/python.md": python_api.page,
    **{
        page: partial(copies.copied, page)
        for page, source in copies.SOURCES.items()
        if (copies.ROOT / source).exists()
    },
}
"""Pages that are no files of docs/."""


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that are written here."""
    for name, write in PAGES.items():
        files.append(File.generated(config, name, content=write()))
    return files
