"""A notebook that was executed as Markdown: its texts, its programs, what they printed and drew."""

import json
from collections.abc import Iterator
from typing import Any


def markdown(text: str) -> str:
    """Return the page of a notebook, given the text of its file."""
    return "\n\n".join(part for cell in json.loads(text)["cells"] for part in _cell(cell) if part) + "\n"


def _cell(cell: dict[str, Any]) -> Iterator[str]:
    source = "".join(cell["source"]).strip()
    if cell["cell_type"] == "markdown":
        yield source
        return
    if cell["cell_type"] != "code" or not source:
        return
    yield f"```python\n{source}\n```"
    for output in cell["outputs"]:
        data = output.get("data", {})
        if "image/png" in data:
            yield f"![what the program draws](data:image/png;base64,{''.join(data['image/png']).replace(chr(10), '')})"
        elif said := "".join(output.get("text", data.get("text/plain", []))).rstrip():
            yield f"```\n{said}\n```"
