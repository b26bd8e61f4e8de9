"""The elastic laws, each a file of this folder: a further one is a further file, and nothing else.

A law is compiled functions of F and of its vector p of parameters, and what turns a scene's table into that vector:

    stress(F, p, P) -> psi [J/m³]       writes P = dpsi/dF [Pa]; psi is infinite where there is none
    stretches(s, p, first, second)      adds dpsi_0/ds [Pa], shape (3,), and d²psi_0/ds² [Pa], shape (3, 3)
    tangent(F, p, project, C) -> bool   writes d²psi/dF² [Pa], shape (9, 9), index 3 i + J, or returns False: then it is
                                        made of `stretches`, as it is where a law has no `tangent` of its own
    VOLUME, volume_term(lam, mu)        measure v of its volume (see `volume`), and kappa [Pa] and c
    PARAMETERS, COUNTS, shear(own)      what `parameters` of a scene lists, how many of them, and the initial shear
                                        modulus that follows [Pa]; no PARAMETERS: the law takes young and poisson

where psi(F) = psi_0(s) + kappa/2 (v(F) - c)^2 but for a constant, s the singular values of F, the last with the sign of
det F. The vector begins with kappa [Pa], c and the initial shear modulus mu [Pa]; behind them, from OWN on, are the
law's own parameters. `tests/sim/test_materials.py` tests every law that is found here.
"""

import pkgutil
from typing import Final

NAMES: Final = tuple(sorted(module.name for module in pkgutil.iter_modules(__path__)))
"""The laws by name."""

KAPPA: Final = 0
REST: Final = 1
SHEAR: Final = 2
OWN: Final = 3
"""Places in a vector of parameters."""
