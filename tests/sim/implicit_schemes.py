"""The registered implicit schemes, for tests that every one of them has to pass."""

from tripod_sim.integrators.scheme import ImplicitScheme
from tripod_sim.integrators.schemes import IMPLICIT, SCHEMES


def scheme_of(name: str) -> ImplicitScheme:
    """Return the implicit scheme of that name."""
    scheme = SCHEMES[name]
    assert isinstance(scheme, ImplicitScheme)
    return scheme


MULTISTEP = [name for name in IMPLICIT if SCHEMES[name].is_multistep]

ORDERS = [(name, SCHEMES[name].order) for name in IMPLICIT]
