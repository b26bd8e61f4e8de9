"""Keys such as [Hughes1987] become links to the list of references."""

import posixpath
import re
from collections.abc import Set as AbstractSet

LIST = "references.md"
_ENTRY = re.compile(r"^- \*\*\[(\w+)\]\*\*", re.MULTILINE)
_CITED = re.compile(r"(?<![`\w*])\[([A-Z][A-Za-z]+\d{4})((?:, [^\]`]+)?)\](?!\()")


def keys(text: str) -> set[str]:
    """Return the keys of the list of references."""
    return set(_ENTRY.findall(text))


def anchored(text: str) -> str:
    """Return the list of references with a place to link to at each entry."""
    return _ENTRY.sub(r'- <a id="\1"></a>**[\1]**', text)


def linked(text: str, page: str, known: AbstractSet[str]) -> str:
    """Return a page with its citations linked, but for those in blocks of code."""
    way = posixpath.relpath(LIST, posixpath.dirname(page) or ".")

    def link(match: re.Match[str]) -> str:
        key, rest = match.groups()
        return f"[[{key}{rest}]]({way}#{key})" if key in known else match[0]

    parts = re.split(r"(^```.*?^```)", text, flags=re.MULTILINE | re.DOTALL)
    return "".join(part if k % 2 else _CITED.sub(link, part) for k, part in enumerate(parts))
