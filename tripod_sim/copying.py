"""Objects that copies share no state with."""

from dataclasses import dataclass
from typing import Self

import numpy as np


@dataclass(eq=False)
class Copyable:
    """Has arrays, numbers and others of its kind as attributes; `copy` copies all of them."""

    def copy_to(self, other: Self) -> None:
        """Overwrite `other` with this, without allocating; a part that only one of them has stays as it is."""
        for name in self.__dataclass_fields__:
            value, old = getattr(self, name), getattr(other, name)
            if isinstance(value, np.ndarray):
                old[:] = value
            elif not isinstance(value, Copyable) and not isinstance(old, Copyable):
                setattr(other, name, value)
            elif value and old:
                value.copy_to(old)

    def copy(self) -> Self:
        """Return an independent copy."""
        values = (getattr(self, name) for name in self.__dataclass_fields__)
        return type(self)(*(value.copy() if hasattr(value, "copy") else value for value in values))
