"""The page of all fields of a scene, from the tables of `tripod_sim`."""

import re
from collections.abc import Iterator
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any, get_args, get_origin, get_type_hints

from tools.reference.docstrings import cell, docstring
from tripod_sim.effects import EFFECTS
from tripod_sim.scene import Scene

HEAD = """\
# Fields of a scene

A scene is a TOML file. Each table in it is an effect or a part of the body. What the file does not name is off: it is
not imported and costs nothing ([effects](../effects.md)). `tripod print scene` lists the scenes that come along;
`tripod print scene tripod` prints one to change. `--set TABLE.FIELD=VALUE` sets a field for one run, `--set TABLE={}`
switches an effect on with its defaults, `--set TABLE=off` switches it off. A name, a value or a unit that does not fit
is refused in one line.

This page is written from the code (`tripod_sim/tables`).
"""


def page() -> str:
    """Return the page as Markdown."""
    return "\n".join([HEAD, *_lines()]) + "\n"


def _lines() -> Iterator[str]:
    tables = dict(_tables())
    yield "## The scene itself\n"
    yield from _table(Scene, [f for f in fields(Scene) if f.name not in tables])
    yield "\n| table | | |\n|---|---|---|"
    for name, (kind, many) in tables.items():
        what = "effect" if name in EFFECTS else "part"
        first = docstring(kind).prose.split("\n\n")[0]
        yield f"| [`{_head(name, many)}`](#{name}) | {what} | {cell(first)} |"
    for name, (kind, many) in tables.items():
        text = docstring(kind).prose
        yield f"\n## {name}\n\n`{_head(name, many)}`\n\n{text}"
        if many:
            yield "\nThere may be several: each begins with the line above."
        yield ""
        yield from _table(kind, list(fields(kind)))


def _head(name: str, many: bool) -> str:
    return f"[[{name}]]" if many else f"[{name}]"


def _tables() -> Iterator[tuple[str, tuple[type, bool]]]:
    """Yield the name of each table, its class, and whether there may be several."""
    for name, hint in get_type_hints(Scene).items():
        for kind in (hint, *get_args(hint)):
            if is_dataclass(kind) and isinstance(kind, type):
                yield name, (kind, get_origin(hint) is tuple)


def _table(kind: type, shown: list[Field[Any]]) -> Iterator[str]:
    about = docstring(kind).named.get("Attributes", {})
    yield "| field | default | unit | allowed | |\n|---|---|---|---|---|"
    for f in shown:
        if f.name not in about:
            raise ValueError(f"{kind.__name__}.{f.name} has no text in the docstring")
        unit = f.metadata.get("unit", "")
        text = re.sub(rf"\s*\[{re.escape(unit)}\]", "", about[f.name]) if unit else about[f.name]
        text = cell(text.lstrip(" ,."))
        yield f"| `{f.name}` | {_default(f)} | {unit} | {cell(allowed(f))} | {text[:1].upper()}{text[1:]} |"


def _default(f: Field[Any]) -> str:
    value = f.default_factory() if f.default_factory is not MISSING else f.default
    if value is MISSING:
        return "must be given"
    if value is None or value == ():
        return "none"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, tuple):
        return f"`{list(value)}`"
    return f'`"{value}"`' if isinstance(value, str) else f"`{value!r}`"


def allowed(f: Field[Any]) -> str:
    """Return what a field may be, in words."""
    meta = f.metadata
    if choices := meta.get("choices"):
        return ", ".join(f"`{c}`" for c in choices)
    above, low, high = (meta.get(k) for k in ("above", "low", "high"))
    if above is not None and high is not None:
        return f"above {above:g}, at most {high:g}"
    if low is not None and high is not None:
        return f"{low:g} to {high:g}"
    if above is not None or low is not None:
        return f"above {above:g}" if above is not None else f"at least {low:g}"
    if high is not None:
        return f"at most {high:g}"
    return {"bool": "true, false", "str": "text"}.get(getattr(f.type, "__name__", str(f.type)), "")
