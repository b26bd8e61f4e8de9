"""Where a moving body would rest: an equilibrium that goes along with the servos, a Newton step for each compliance.

A body that swings has another tangent than at rest, near a limit point an indefinite one: what it tells of its rest is
wrong. So beside the motion goes a state of rest, which knows nothing of it. From one compliance to the next it is
carried by the angles' change Δq and the response that is known, and then corrected by the tangent there,

    x <- x - K⁻¹ K_s Δq,    x <- x - K⁻¹ r(x),

which is Newton's method with one iteration for each compliance, and costs no factorisation more. Near a snap, where a
small turn moves the body far, more of them follow.
"""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.state import State
from tripod_sim.system import System
from tripod_sim.system_kernels import write_moves

FAR = 0.2
"""Turn of a servo [rad] between two compliances after which the state of rest begins again from the moving one."""

SLID = 1e-4
"""The same for the slide [m]."""

WIDE = 5e-3
"""A correction that moves a node farther than this [m] is no small one: it begins again next time."""

MISSED = 5e-5
"""A correction that moves a node farther than this [m] is followed by another one at once."""

CALM, APART = 2e-3, 1e-3
"""An effector slower than CALM [m/s] and farther than APART [m] from where it is said to rest, rests elsewhere."""


class RestState:
    """The state of rest of a system, near a moving state."""

    def __init__(self, system: System) -> None:
        self._system = system
        self._dx = np.zeros_like(system.rest)
        self._state: State | None = None
        self._trial: State | None = None
        self._turning: FloatArray | None = None

    def forget(self) -> None:
        """Begin again from the next moving state."""
        self._state = self._turning = None

    def carried(self, moving: State) -> State:
        """Return the state of rest, carried to the joints of `moving`; a copy of that where it begins."""
        rest, turning = self._state, self._turning
        if rest is None or turning is None or self._left_by(moving, rest):
            self._state, self._trial = moving.copy(), moving.copy()
            return self._state
        turn = moving.joints - rest.joints
        rest.step, rest.time = moving.step, moving.time
        if turn.any() and self._trial is not None:
            trial = self._trial
            rest.copy_to(trial)
            self._dx[:] = 0.0
            self._system.drive(trial, moving.joints)
            write_moves(self._system.driven, rest.positions, trial.positions, self._dx)
            self._move(turning @ turn[: turning.shape[1]])
        return rest

    def misses(self, fall: FloatArray) -> bool:
        """Return whether `fall`, as for `correct`, is so long that the tangent is not that of rest, though sound."""
        if self._state is None:
            return False
        self._dx[:] = 0.0
        self._system.update_levers(self._state)
        self._system.reduction.moves(fall, self._system.lever, self._dx)
        return MISSED < float(np.abs(self._dx).max()) < WIDE

    def correct(self, turning: FloatArray, fall: FloatArray, *, stable: bool) -> None:
        """Take up the response at the state that `carried` gave.

        Args:
            turning: Of all unknowns to the angles, shape (unknowns, s).
            fall: Of all unknowns to the unbalanced forces, shape (unknowns,).
            stable: Whether the tangent there is positive definite; else it begins again next time.
        """
        if self._state is None or self._trial is None:
            return
        self._state.copy_to(self._trial)
        self._dx[:] = 0.0
        self._move(fall)
        sound = stable and float(np.abs(self._dx).max()) < WIDE  # and false where it is not a number
        self._turning = turning if sound else None

    def _move(self, solution: FloatArray) -> None:
        """Move the state by `solution`, its driven nodes by what `_dx` and the trial say."""
        rest, trial = self._state, self._trial
        assert rest
        assert trial
        self._system.update_levers(rest)
        self._system.reduction.moves(solution, self._system.lever, self._dx)
        self._system.move(rest, solution, self._dx, 1.0, trial)
        trial.copy_to(rest)

    def _left_by(self, moving: State, rest: State) -> bool:
        """Return whether the body is not where it is said to rest, and no longer on its way there."""
        move, s = moving.joints - rest.joints, self._system.actuators
        if self._system.turns(move).max(initial=0.0) > FAR or abs(move[s]) > SLID or move[s + 1 :].any():
            return True
        slow = np.abs(moving.velocities).max() < CALM
        held = len(self._system.groups.rigid)
        there, here = moving.centres[:held], rest.centres[:held]
        if not held:  # the effector is observed
            there, here = moving.positions, rest.positions
        return bool(slow and np.abs(there - here).max() > APART)
