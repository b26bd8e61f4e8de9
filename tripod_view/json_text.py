"""JSON texts of other nodes, checked: the page hands on what is in them, and its browsers know no NaN. Pure."""

import json
import math
from typing import Any


class JsonError(ValueError):
    """A text that is refused; the message says why."""


def table_of(text: str) -> dict[str, Any]:
    """Return the table that a JSON text is. Raises JsonError, also where a number is not finite."""
    try:
        table = json.loads(text, parse_float=_finite, parse_constant=_finite)
    except JsonError:
        raise
    except (ValueError, RecursionError):
        raise JsonError(f"{text!r:.60} is not JSON") from None
    if not isinstance(table, dict):
        raise JsonError(f"{text!r:.60} is not a table")
    return table


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise JsonError(f"a number is {text}; it must be finite")
    return value
