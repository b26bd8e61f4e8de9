"""What moves in a step with contact: each body is a potential in its unknowns, and its surfaces follow these."""

from typing import Any

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.scheme import Stage
from tripod_sim.state import State


class Body:
    """The potential of one stage of an implicit scheme in a body's unknowns u, the moves over the stage.

    A body is read from a state at the start of a step, and written to it at the end. What a body says nothing of does
    nothing.

    Attributes:
        unknowns: Their number.
        given: Which of them are not sought: they move as servos, timelines or rollers say, shape (g,).
        pattern: Upper triangle of the Hessian, CSC, with full blocks of nodes or bodies; `hessian` writes its data.
        reach: By how much each of them moves points of the body at most [m], per m 1, per rad the largest arm, shape
            (unknowns,).
        base, width: First unknown of each vertex of its surfaces, -1 if it never moves, and 3 (node) or 6 (rigid
            group), shape (k,).
        held: Along which axes each vertex does not yield, whatever presses it, shape (k, 3).
        looked_back: Whether the next stage may look back on the last.
        served: Whether the Hessian of the stage before serves: then `begin` need not prepare another.
    """

    unknowns: int
    given: Any
    pattern: Any
    reach: Any
    base: Any
    width: Any
    held: Any
    looked_back = served = False

    @property
    def lasting(self) -> bool:
        """Whether the Hessian of a step may serve in the next."""
        return True

    def load(self, state: State, joints: FloatArray, dt: float) -> None:
        """Begin a step of `dt` [s] from `state`, in which driven frames move to `joints`."""

    def store(self, state: State) -> None:
        """Write where the body is now, and how it moves, to `state`."""

    def forget(self) -> None:
        """Drop what was kept from earlier steps."""

    def place(self, positions: FloatArray, arm: FloatArray) -> None:
        """Write the vertices and their arms from the centres of rigid groups [m], both of shape (k, 3)."""

    def ends(self, u: FloatArray, out: FloatArray) -> None:
        """Write where the vertices are after the moves `u` [m], shape (k, 3)."""

    def taut(self) -> bool:
        """Return whether a bound of its strains pulls."""
        return False

    def add_reactions(self, forces: FloatArray) -> None:
        """Tell servos, and what else holds nodes, what forces on the vertices [N], shape (k, 3), ask of them."""

    def past(self) -> tuple[FloatArray, ...]:
        """Return the arrays that the next stage may look back on."""
        return ()

    def begin(self, stage: Stage) -> None:
        """Prepare a stage from the body's present state."""

    def guess(self, u: FloatArray) -> None:
        """Write the moves of a stage without forces."""

    def add(self, u: FloatArray, out: FloatArray) -> float:
        """Add the gradient at `u` [N, N m] to `out`; return the potential [J]. Both of shape (unknowns,)."""
        return 0.0

    def hessian(self, u: FloatArray, *, project: bool) -> None:
        """Write the Hessian at `u` into `pattern.data`; `project` makes it positive definite."""

    def rate_at_start(self, out: FloatArray) -> None:
        """Write the velocities of the unknowns at the start of the stage [m/s, rad/s]."""

    def free_rate(self, out: FloatArray) -> None:
        """Write the velocities of the unknowns at the end of the stage if no force acted [m/s, rad/s]."""
        self.rate_at_start(out)

    def rate_at_end(self, u: FloatArray, out: FloatArray) -> None:
        """Write those at its end, after the moves `u` [m/s, rad/s]."""

    def inverse_mass(self, out: FloatArray) -> None:
        """Write the inverse masses in the present pose, a block for each three unknowns [1/kg, 1/(kg m²)].

        `out`: shape (unknowns / 3, 3, 3), zero; rows and columns of given unknowns stay zero.
        """

    def stop(self) -> None:
        """Take all velocities."""

    def finish(self, u: FloatArray) -> None:
        """Let the moves `u` be made."""

    def add_velocity(self, change: FloatArray) -> None:
        """Add to the present velocities of the unknowns [m/s, rad/s], shape (unknowns,)."""
