"""The time integrators, each a file of this folder: a further one is a further file, and nothing else.

A file has a `SCHEME`, an object of `integrators.scheme`, whose name is that of the file. `tests/sim/test_schemes.py`
tests every scheme that is found here.
"""

from importlib import import_module
from pkgutil import iter_modules
from typing import Final

from tripod_sim.integrators.scheme import ExplicitScheme, ImplicitScheme, Scheme

SCHEMES: Final[dict[str, Scheme]] = {
    module.name: import_module(f"{__name__}.{module.name}").SCHEME for module in iter_modules(__path__)
}
"""All schemes by name."""

IMPLICIT: Final = tuple(
    s.name for s in SCHEMES.values() if isinstance(s, ImplicitScheme) and not s.is_automatic
)
"""Names of the implicit ones."""

EXPLICIT: Final = tuple(s.name for s in SCHEMES.values() if isinstance(s, ExplicitScheme))
"""Names of the explicit ones."""
