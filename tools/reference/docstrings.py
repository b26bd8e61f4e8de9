"""Docstrings as this project writes them: prose, then sections `Attributes:`, `Args:`, `Returns:`, `Raises:`."""

import inspect
import re
from dataclasses import dataclass, field

NAMED = ("Attributes", "Args", "Raises")
"""Sections of entries `name: text`; the text goes on in lines that are indented further."""
FREE = ("Returns", "Yields", "References", "Source")
_HEAD = re.compile(rf"^({'|'.join(NAMED + FREE)}):\s*(.*)$")
_ENTRY = re.compile(r"^(\S[^:]*):\s+(.*)$")


@dataclass
class Docstring:
    """A docstring in parts.

    Attributes:
        prose: What stands before the sections, as it is.
        named: Of each section with entries: name to text. One entry for several names is there for each.
        free: Text of each other section.
    """

    prose: str
    named: dict[str, dict[str, str]] = field(default_factory=dict)
    free: dict[str, str] = field(default_factory=dict)


def docstring(what: object) -> Docstring:
    """Return the docstring of a class or function in parts."""
    prose: list[str] = []
    result = Docstring("")
    section, names, begun = "", list[str](), ""
    for line in inspect.cleandoc(getattr(what, "__doc__", None) or "").splitlines():
        indent = len(line) - len(line.lstrip())
        if indent == 0 and (head := _HEAD.match(line)):
            section, names = head[1], []
            if section in NAMED:
                result.named.setdefault(section, {})
            else:
                result.free[section] = head[2]
        elif not section or (indent == 0 and line):
            section = ""
            prose.append(line)
        elif section in FREE:
            result.free[section] = f"{result.free[section]} {line.strip()}".strip()
        elif (indent == 4 or begun) and (entry := _ENTRY.match(f"{begun} {line.strip()}".strip())):
            names, begun = [name.strip() for name in entry[1].split(",")], ""
            result.named[section] |= dict.fromkeys(names, entry[2])
        elif indent == 4:
            begun = line.strip()  # names that go on in the next line
        elif line:
            for name in names:
                result.named[section][name] += f" {line.strip()}"
    result.prose = "\n".join(prose).strip()
    return result


def cell(text: str) -> str:
    """Return `text` as it may stand in a cell of a table."""
    return " ".join(text.split()).replace("|", "\\|")
