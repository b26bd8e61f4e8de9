"""The Hessian of a step with contact: that of the bodies, and between bodies what their contacts ask for."""

from typing import Any

import numpy as np
from scipy import sparse

from tripod_host.arrays import FloatArray
from tripod_sim.contact import hessian_kernels as kernels
from tripod_sim.contact.contact_set import ContactSet
from tripod_sim.linear.keys import distinct
from tripod_sim.linear.ldl import Ldl


class JointHessian:
    """Bodies and contacts in one matrix, which is factored as one.

    Contacts with what is fixed fit in the pattern of the bodies. As soon as one that presses does not, the pattern is
    made again, with places for all contacts at hand: then it serves for some steps, for those that press are few of
    those that are near.

    Attributes:
        bodies: Pattern of the bodies, upper triangle, CSC; its `data` is theirs alone.
        bare: Solves with the bodies alone.
        linear: Solves with bodies and contacts.
        analyses: How often a pattern was made again.
    """

    def __init__(self, bodies: Any) -> None:
        self.bodies, self.analyses = bodies, 0
        n = bodies.shape[0]
        self._keys = np.repeat(np.arange(n), np.diff(bodies.indptr)) * n + bodies.indices
        self.bare = Ldl(bodies)
        self.forget()

    def forget(self) -> None:
        """Return to the pattern of the bodies: its order, and so what is rounded off, depends on earlier contacts."""
        bodies = self.bodies
        self._slots: Any = slice(None)
        self._whole = sparse.csc_matrix((bodies.data.copy(), bodies.indices, bodies.indptr), bodies.shape)
        self._take(self.bare.sibling(self._whole.data))

    def _take(self, linear: Ldl) -> None:
        whole, self.linear = self._whole, linear
        self._arrays = whole.indptr.astype(np.int64), whole.indices.astype(np.int64), whole.data

    def warm_up(self, contacts: ContactSet, u: FloatArray) -> None:
        """Compile what is needed only when something touches."""
        kernels.add_hessian(contacts.arrays, 0, u, *self._arrays)
        kernels.pairs(contacts.arrays, 0, np.zeros((1, 2), dtype=np.int64))
        self.bodies.data[:] = 0.0
        self.bodies.data[self.bodies.indptr[1:] - 1] = 1.0
        self.bare.factor()
        self.bare.solve_many(u[:, None])

    def factor(self, contacts: ContactSet, u: FloatArray) -> bool:
        """Factor the bodies' Hessian with that of `contacts` at `u`; return whether it is positive definite."""
        if not self._write(contacts, u):
            self._widen(contacts)
            self._write(contacts, u)
        return self.linear.factor() and self.linear.is_positive()

    def _write(self, contacts: ContactSet, u: FloatArray) -> bool:
        """Write bodies and contacts; return False if the pattern has no place for a contact that presses."""
        data = self._whole.data
        if not isinstance(self._slots, slice):
            data[:] = 0.0
        data[self._slots] = self.bodies.data
        return bool(kernels.add_hessian(contacts.arrays, contacts.count, u, *self._arrays))

    def _widen(self, contacts: ContactSet) -> None:
        """Make the pattern again: that of the bodies, and places for all `contacts`."""
        n, found = self.bodies.shape[0], np.empty((16 * contacts.count * 4, 2), dtype=np.int64)
        found = found[: kernels.pairs(contacts.arrays, contacts.count, found)]
        blocks = distinct(found[:, 1] * n + found[:, 0])
        three = (np.arange(3)[:, None] * n + np.arange(3)).ravel()
        keys = distinct(np.concatenate([self._keys, (blocks[:, None] + three).ravel()]))
        keys = keys[keys % n <= keys // n]
        indptr = np.searchsorted(keys, np.arange(n + 1) * n)
        self._whole = sparse.csc_matrix((np.zeros(len(keys)), keys % n, indptr), shape=(n, n))
        self._slots = np.searchsorted(keys, self._keys)
        self.analyses += 1
        self._take(Ldl(self._whole))
