"""A report as one HTML file that loads nothing: headings, tables, sentences, pictures."""

import base64
import html
from collections.abc import Sequence

STYLE = """body{font:16px/1.5 sans-serif;max-width:60em;margin:2em auto;padding:0 1em;color:#222}
table{border-collapse:collapse;margin:1em 0}td,th{padding:.2em .8em;border-bottom:1px solid #ccc;text-align:left}
td.n{text-align:right;font-variant-numeric:tabular-nums}img{max-width:100%}.warn{border-left:4px solid #d55e00;
padding-left:.8em}pre{background:#f4f4f4;padding:.6em;overflow:auto}
@media(prefers-color-scheme:dark){body{background:#181818;color:#ddd}pre{background:#222}img{background:#fff}}"""


class Page:
    """Grows part by part; `text` is the whole."""

    def __init__(self, title: str) -> None:
        self._title = html.escape(title)
        self._parts = [f"<h1>{self._title}</h1>"]

    def heading(self, text: str) -> None:
        """Begin a part."""
        self._parts.append(f"<h2>{html.escape(text)}</h2>")

    def say(self, text: str) -> None:
        """Add a paragraph."""
        self._parts.append(f"<p>{html.escape(text)}</p>")

    def warn(self, text: str) -> None:
        """Add a paragraph that stands out."""
        self._parts.append(f'<p class="warn">{html.escape(text)}</p>')

    def code(self, text: str) -> None:
        """Add a text as it is."""
        self._parts.append(f"<pre>{html.escape(text)}</pre>")

    def table(self, head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """Add a table; cells that begin with a digit or a sign are set as numbers."""
        top = "".join(f"<th>{html.escape(h)}</th>" for h in head)
        body = "".join("<tr>" + "".join(_cell(cell) for cell in row) + "</tr>" for row in rows)
        self._parts.append(f"<table><tr>{top}</tr>{body}</table>")

    def picture(self, png: bytes, what: str) -> None:
        """Add a picture; `what` says what it shows to who cannot see it."""
        data = base64.b64encode(png).decode()
        self._parts.append(f'<p><img alt="{html.escape(what)}" src="data:image/png;base64,{data}"></p>')

    @property
    def text(self) -> str:
        """The file."""
        return (
            f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{self._title}</title>'
            f"<style>{STYLE}</style><body>{''.join(self._parts)}</body></html>\n"
        )


def _cell(text: str) -> str:
    number = text[:1].isdigit() or text[:1] in "-+"
    return f"<td{' class=n' if number else ''}>{html.escape(text)}</td>"
