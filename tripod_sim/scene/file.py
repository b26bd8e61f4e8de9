"""Scenes as TOML: reading, overriding single fields, writing."""

import difflib
import math
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import MISSING, fields, is_dataclass
from importlib import resources
from pathlib import Path
from typing import Any, get_args, get_origin

from tripod_host.reading import read_file
from tripod_sim.errors import LONGEST, SceneError, shown
from tripod_sim.scene.lines import field_named, line_of
from tripod_sim.scene.scene import OPTIONAL, Scene
from tripod_sim.tables.kinds import WORDS, converted, hints_of

MAX_BYTES = 100_000
"""A scene file larger than this is refused unread."""

MOST_DOTS = 1000
"""In one line: the time and memory to parse a dotted key grow with the square of its length."""

AUTO = "auto"
"""As dt: the simulator divides the steps."""

WITH_UNIT = re.compile(r"[-+.0-9eE]+ ?[A-Za-z/³²]+")
"""A number with a unit, as `100kPa`."""

LONGEST_PATH = 100
"""Characters of the path of an override; no field is as deep."""


def scene_names() -> list[str]:
    """Return the names of the shipped scenes."""
    folder = resources.files("tripod_sim") / "scenes"
    return sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml"))


def override_words(text: str) -> list[str]:
    """Return the overrides in a text of them, separated by semicolons that stand in no quotes.

    >>> override_words("mesh.level=1; dt=0.01;")
    ['mesh.level=1', 'dt=0.01']
    >>> override_words('motion.0.path="0:0; 1:2";dt=0.01')
    ['motion.0.path="0:0; 1:2"', 'dt=0.01']
    """
    words = re.findall(r"""(?:"[^"]*"|'[^']*'|[^;])+""", text)
    return [word.strip() for word in words if word.strip()]


def load_scene(source: str | Path, overrides: Iterable[str] = ()) -> Scene:
    """Return a scene by name, or from a TOML file.

    Args:
        source: Name of a shipped scene, or a path that ends in `.toml`.
        overrides: Words `dotted.path=value`, the value in TOML; an effect set to `off` is removed.

    Raises:
        SceneError: no such scene, unknown field, wrong type or value out of range; the message names the path.
    """
    if isinstance(overrides, str) or not isinstance(
        overrides, Iterable
    ):  # of a text each character would be one
        word = overrides if isinstance(overrides, str) else "dt=0.01"
        raise SceneError(
            f"overrides is {shown(overrides)}; it must be a list of settings, such as [{shown(word)}]"
        )
    text, folder = _read(source)
    file = str(source) if folder else ""
    return _scene(text, folder, f"scene {str(source)!r}", overrides, file)


def scene_from_toml(text: str, overrides: Iterable[str] = ()) -> Scene:
    """Return the scene that a TOML text describes, with overrides as for `load_scene`.

    Files that it names are found by their whole paths.

    Raises SceneError as `load_scene` does.
    """
    if not isinstance(text, str):
        raise SceneError(
            f"the scene is {shown(text)}; it must be text in TOML; load_scene takes a name or a file"
        )
    if len(text) > MAX_BYTES:
        raise SceneError(f"the scene has {len(text)} characters; allowed: at most {MAX_BYTES}")
    return _scene(text, None, "the scene", overrides)


def _scene(text: str, folder: Path | None, what: str, overrides: Iterable[str], file: str = "") -> Scene:
    """Return the scene of a text; `what` and `file`, if it is one, name it in messages."""
    try:
        table = _parse(text)
    except ValueError as error:
        raise SceneError(f"{_broken_line(text, what, file, str(error))}") from None
    words = list(overrides)
    _override_all(table, words)
    lists = [table[key] for key in ("obstacles", "rigid", "body") if isinstance(table.get(key), list)]
    several = [part for parts in lists for part in parts if isinstance(part, dict)]
    nested = [part.get(key) for part in (table, *several) for key in ("mesh", "springs")]
    cables = table.get("cable")
    for cable in cables if isinstance(cables, list) else ():
        several += list(via) if isinstance(cable, dict) and isinstance(via := cable.get("via"), list) else []
    for part in (*nested, *several):
        if isinstance(part, dict) and isinstance(part.get("source"), str) and "." in part["source"]:
            part["source"] = _located(part["source"], folder)
    try:
        scene = _build(Scene, table, "")
    except SceneError as error:
        raise SceneError(f"{_place(str(error), text, file, words)}{error}") from None
    assert isinstance(scene, Scene)
    return scene


def _broken_line(text: str, what: str, file: str, error: str) -> str:
    """Return what is said of a text that is no TOML: where, why, and what to do if it is a unit without quotes."""
    reason, _, place = error.partition(" (at line ")
    number = place.partition(",")[0]
    if not number.isdigit():
        return f"{what} is not valid TOML: {error}"
    line = text.splitlines()[int(number) - 1] if int(number) <= len(text.splitlines()) else ""
    value = line.partition("=")[2].partition("#")[0].strip()
    quotes = f'; a value with its unit stands in quotes: "{value}"' if WITH_UNIT.fullmatch(value) else ""
    return f"{f'{file}, line {number}: ' if file else ''}{what} is not valid TOML: {reason} (line {number}){quotes}"


def _place(message: str, text: str, file: str, overrides: Iterable[str]) -> str:
    """Return what a message on a field begins with: file and line; empty for a field that an override gives."""
    field = field_named(message)
    given = [word.partition("=")[0].strip() for word in overrides]
    if not file or any(f"{field}.".startswith(f"{path}.") or path.startswith(f"{field}.") for path in given):
        return ""
    line = line_of(text, field)
    return f"{file}, line {line}: " if line else f"{file}: "


@contextmanager
def naming_file(source: str | Path, overrides: Iterable[str] = ()) -> Iterator[None]:
    """Begin a SceneError of the body with the scene's file and line, as `load_scene` does: for building a simulation.

    A shipped scene has no file of the user; a field that an override gives is in none.
    """
    try:
        yield
    except SceneError as error:
        text, folder = _read(source)
        place = _place(str(error), text, str(source) if folder else "", overrides)
        if not place or str(error).startswith(str(source)):
            raise
        raise SceneError(f"{place}{error}") from None


def _override_all(table: dict[str, Any], overrides: Iterable[str]) -> None:
    """Apply the overrides to a parsed scene, in place, and write its `dt = "auto"` out."""
    interval = table.get("dt")
    named = interval == AUTO
    for word in overrides:
        override(table, word)
        interval = interval if table.get("dt") == AUTO else table.get("dt")
        named |= word.partition("=")[0].strip() in ("inertia", "inertia.scheme")
    if table.get("dt") == AUTO:
        _choose_steps(table, interval, keep_scheme=named)


def scene_text(source: str | Path) -> str:
    """Return a scene as it is written, comments and all. Raises SceneError where there is none."""
    return _read(source)[0]


def _choose_steps(table: dict[str, Any], interval: Any, *, keep_scheme: bool) -> None:
    """Write `dt = "auto"` of a parsed scene out, in place.

    Args:
        table: The scene.
        interval: The dt [s] that was given before, if any.
        keep_scheme: Whether a scheme that the scene names goes with that; else it belongs to a fixed dt, and the scheme
            is left to choice, too, as it is where none is named.
    """
    inertia = table.get("inertia")
    if isinstance(inertia, dict) and not (keep_scheme and "scheme" in inertia):
        inertia["scheme"] = AUTO
    if interval in (None, AUTO):
        del table["dt"]
    else:
        table["dt"] = interval
    wanted = table.setdefault("time_error", {})
    if isinstance(wanted, dict) and wanted.setdefault("steps", AUTO) != AUTO:
        raise SceneError(
            f"dt is 'auto', but time_error.steps is {shown(wanted['steps'])}; give only one of the two"
        )


def _located(name: str, folder: Path | None) -> str:
    """Return the path of a file that a scene names: beside the scene, else of those that come along, else as it is."""
    beside = str(folder / name) if folder else name
    shipped = {f.name: str(f) for f in (resources.files("tripod_sim") / "scenes").iterdir()}
    return shipped[name] if name in shipped and not (folder and Path(beside).exists()) else beside


def _read(source: str | Path) -> tuple[str, Path | None]:
    if str(source).endswith(".toml"):
        path = Path(source)
        try:
            return read_file(path, MAX_BYTES).decode("utf-8-sig"), path.parent.absolute()
        except OSError as error:
            raise SceneError(f"scene file {str(path)!r} cannot be read: {error.strerror}") from None
        except UnicodeDecodeError:
            raise SceneError(f"scene file {str(path)!r} is not UTF-8 text") from None
    if str(source) not in scene_names():
        near = difflib.get_close_matches(str(source), scene_names(), 1)
        with suppress(OSError):  # too long a name
            near = [f"{source}.toml"] if Path(f"{source}.toml").is_file() else near
        hint = f"; did you mean {near[0]!r}?" if near else ""
        names = ", ".join(scene_names())
        raise SceneError(
            f"scene {str(source)!r} is unknown{hint}; scenes: {names}; or give the path of a .toml file"
        )
    return (resources.files("tripod_sim") / "scenes" / f"{source}.toml").read_text(), None


def _parse(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text. Raises ValueError, whatever the text."""
    if any(line.count(".") > MOST_DOTS for line in text.splitlines()):
        raise ValueError(f"a line has more than {MOST_DOTS} dots")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("nested too deeply") from None


def override(table: dict[str, Any], word: str) -> None:
    """Apply one `dotted.path=value` to a parsed scene, in place. Raises SceneError.

    `path=off` removes an effect; the number after the last entry of a list adds one, and 0 begins a list.
    """
    path, equals, text = (
        (part.strip() for part in word.partition("=")) if isinstance(word, str) else ("",) * 3
    )
    keys = path.split(".")
    if not equals or not all(keys) or len(path) > LONGEST_PATH:
        raise SceneError(
            f"setting {shown(word)} is not of the form table.field=value, such as material.young=300kPa or dt=0.001"
        )
    node: Any = table
    for depth, key in enumerate(keys[:-1]):
        node = _inside(node, key, ".".join(keys[: depth + 1]), keys[depth + 1])
    last = keys[-1]
    if text == "off" and not _is_word(keys, text):
        _remove(node, last, keys)
    elif isinstance(node, list) and last == str(len(node)):
        node.append(value_of(text))
    elif isinstance(node, list):
        node[_index(node, last, path)] = value_of(text)
    elif isinstance(node, dict):
        node[last] = value_of(text)
    else:
        above = ".".join(keys[:-1])
        raise SceneError(f"setting {shown(word)}: {above} is a value and has no fields; set {above} itself")


def _is_word(keys: list[str], word: str) -> bool:
    """Return whether the field that `keys` name takes `word` as a value of its own."""
    if len(keys) != 2 or keys[0] not in OPTIONAL:
        return False
    kinds = [a for a in get_args(hints_of(Scene)[keys[0]]) if is_dataclass(a)]
    return any(
        word in f.metadata.get("choices", ()) for kind in kinds for f in fields(kind) if f.name == keys[1]
    )


def value_of(text: str) -> Any:
    """Return the TOML value that `text` writes, or `text` itself: a bare word is a string."""
    try:
        table = _parse(f"v = {text}")
    except ValueError:
        return text
    return table["v"] if len(table) == 1 else text


def _inside(node: Any, key: str, where: str, following: str) -> Any:
    """Return what `key` names in a table or list; what a table lacks is made, a list where the key `following` is 0."""
    if isinstance(node, list):
        return node[_index(node, key, where)]
    if isinstance(node, dict):
        return node.setdefault(key, [] if following == "0" else {})
    raise SceneError(
        f"{where}: {where.rpartition('.')[0]} is a value and has no fields; set {where.rpartition('.')[0]} itself"
    )


def _remove(node: Any, key: str, keys: list[str]) -> None:
    """Switch an effect off, or one entry of an effect that is a list."""
    if keys[0] not in OPTIONAL or len(keys) > 2 or (len(keys) == 2 and not isinstance(node, list)):
        raise SceneError(
            f"setting {'.'.join(keys)}=off: only an effect can be off; effects: {', '.join(OPTIONAL)}"
        )
    if isinstance(node, list):
        del node[_index(node, key, ".".join(keys))]
    else:
        node.pop(key, None)


def _index(node: list[Any], key: str, where: str) -> int:
    allowed = [str(i) for i in range(len(node))]
    if key not in allowed:
        known = f"it has entries 0 to {len(node) - 1}; number {len(node)} adds one" if node else "it is empty"
        raise SceneError(f"{where}: there is no entry {shown(key)}; {known}")
    return int(key)


def _build(cls: Any, table: Any, path: str) -> Any:
    """Return the dataclass `cls` made from a TOML table."""
    if not isinstance(table, Mapping):
        raise SceneError(
            f"{path} is {shown(table)}; it must be a table; its fields: {', '.join(hints_of(cls))}"
        )
    hints = hints_of(cls)
    for key in table:
        if key not in hints:
            meant = _elsewhere(key, hints) if cls is Scene else difflib.get_close_matches(key, hints, 1)
            hint = f"; did you mean {' or '.join(map(repr, meant))}?" if meant else ""
            name = key if key.isidentifier() and len(key) < LONGEST else shown(key[: LONGEST // 2])
            where = f"{path}.{name}" if path else name
            elsewhere = meant and all("." in name for name in meant)  # then those here are of no help
            known = "" if elsewhere else f"; fields: {', '.join(hints)}"
            raise SceneError(f"field {where} is unknown{known}{hint}")
    values = {}
    for f in fields(cls):
        where = f"{path}.{f.name}" if path else f.name
        if f.name in table:
            values[f.name] = converted(
                hints[f.name], table[f.name], where, f.metadata.get("unit", ""), _build, f.default
            )
        elif f.default is MISSING and f.default_factory is MISSING:
            raise SceneError(f"field {where} is missing{_wanted(hints[f.name], f.metadata.get('unit', ''))}")
    return cls(**values)


def _wanted(kind: Any, unit: str) -> str:
    """Return in words what a field that is missing must be; empty for a table."""
    if kind in WORDS:
        return f"; it must be {WORDS[kind]}"
    arguments = get_args(kind)
    return f"; it must be {len(arguments)} numbers{unit and f' in {unit}'}" if arguments[0] is float else ""


def _elsewhere(key: str, names: Iterable[str]) -> list[str]:
    """Return what an unknown field of a scene may have been meant to be: of its tables too, each with its table."""
    paths = field_names()
    same = [path for path in paths if path.rpartition(".")[2] == key]
    near = difflib.get_close_matches(key, [*names, *(path.rpartition(".")[2] for path in paths)], 1)
    return (
        same
        or ([] if near and near[0] in names else [p for p in paths if [p.rpartition(".")[2]] == near])
        or near
    )


def field_names() -> list[str]:
    """Return the paths of all fields of a scene but those in lists, such as `material.young`."""
    found = []
    for name, kind in hints_of(Scene).items():
        tables = [t for t in (kind, *get_args(kind)) if is_dataclass(t) and get_origin(kind) is not tuple]
        found += [f"{name}.{f.name}" for table in tables for f in fields(table)] or [name]
    return found


def words_of(values: Mapping[str, str | float | int | bool]) -> list[str]:
    """Return values by field as overrides; a text stays as it is, such as `off` or a table in TOML."""
    return [f"{field}={v if isinstance(v, str) else _literal(v)}" for field, v in values.items()]


def scene_to_toml(scene: Scene) -> str:
    """Return the scene as TOML text that `load_scene` reads back equal."""
    return "\n".join(_lines(scene, "")) + "\n"


def _lines(table: Any, path: str) -> list[str]:
    own, nested = [], []
    for f in fields(table):
        value = getattr(table, f.name)
        where = f"{path}.{f.name}" if path else f.name
        if value is None or value == ():
            continue
        if is_dataclass(value):
            nested += ["", f"[{where}]", *_lines(value, where)]
        elif isinstance(value, tuple) and is_dataclass(value[0]):
            for part in value:
                nested += ["", f"[[{where}]]", *_lines(part, where)]
        else:
            own.append(f"{f.name} = {_literal(value)}")
    return own + nested


def _literal(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return "[" + ", ".join(_literal(v) for v in value) + "]"
    if isinstance(value, str):
        return '"' + "".join(_escaped(c) for c in value) + '"'
    assert not isinstance(value, float) or math.isfinite(value)
    return repr(value)


def _escaped(character: str) -> str:
    if character in '"\\':
        return "\\" + character
    return character if character.isprintable() else f"\\U{ord(character):08X}"
