"""A scheme that is left open: with a fixed dt implicit Euler, with `dt = "auto"` chosen with the steps."""

from dataclasses import dataclass
from typing import ClassVar

from tripod_sim.integrators.scheme import ImplicitScheme
from tripod_sim.integrators.schemes import bdf2, implicit_euler, tr_bdf2


@dataclass(frozen=True)
class Automatic(ImplicitScheme):
    """See the module.

    Attributes:
        at_hits, smooth: For steps by an accuracy, where velocities jump and where not: hits make both restart, and
            BDF2 is cheaper there.
    """

    is_automatic: ClassVar[bool] = True
    pair: ClassVar[tuple[ImplicitScheme, ImplicitScheme] | None] = (implicit_euler.SCHEME, tr_bdf2.SCHEME)
    at_hits: ClassVar[ImplicitScheme] = bdf2.SCHEME
    smooth: ClassVar[ImplicitScheme] = tr_bdf2.SCHEME


SCHEME = Automatic("auto", implicit_euler.SCHEME.order)
