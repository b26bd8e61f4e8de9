"""Which poses would tell most: those that make det(J^T J / sigma² + W^-2) largest, one after the other [Fedorov1972].

W are the plausible widths, so that values that the data do not tell yet count most.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_identify.measured import Measured
from tripod_identify.model import Rest, rest_states
from tripod_identify.parameters import Parameter, told
from tripod_identify.problem import Problem, Solved, rest_jacobian
from tripod_sim.errors import StepError
from tripod_sim.state import State

CANDIDATES, PROPOSED = 24, 3


@dataclass(frozen=True, eq=False)
class Proposal:
    """A pose that would tell much.

    Attributes:
        joints: Commands of all joints, and the slide [m], shape (a + 1,).
        half: By how much the standard deviation of each value would be after it and those before it, over what it is
            now, shape (p,).
    """

    joints: FloatArray
    half: FloatArray


def candidates(measured: Measured, joints: FloatArray, count: int = CANDIDATES) -> FloatArray:
    """Return poses within the range of the commands `joints`, shape (k, a + 1), evenly spread, always the same."""
    from scipy.stats import qmc  # noqa: PLC0415 - slow to import

    low, high = joints.min(axis=0), joints.max(axis=0)
    share = qmc.Halton(joints.shape[1], seed=1).random(count)
    return np.asarray(low + share * (high - low))


def propose(
    problem: Problem, wanted: Sequence[Parameter], u: FloatArray, sigma: tuple[float, float], poses: FloatArray,
    now: FloatArray,
) -> list[Proposal]:  # fmt: skip
    """Return the best of some poses, best first.

    Args:
        problem: Of poses at rest; its data say what is measured.
        wanted: All values that are asked for, also those that were held.
        u: Of all of them.
        sigma: Of places [m] and rotations [rad].
        poses: To choose from, shape (n, a + 1).
        now: d values / du of the present rows over sigma, of all of `wanted`, shape (r, p).
    """
    channels = problem.measured.channels
    assumed = told(problem.base, wanted, u)
    count = len(wanted)
    known: list[tuple[FloatArray, FloatArray]] = []
    size = np.where([c.angle for c in channels], sigma[1], sigma[0])
    states: list[State] = []
    have_slide = problem.measured.slide is not None
    for joints in poses:
        one = replace(
            problem.measured, times=None, commands=joints[None, :-1], slide=joints[None, -1] if have_slide else None,
            values=np.zeros((1, len(channels))),
        )  # fmt: skip
        rest = Rest(assumed.scene, one, problem.points)
        try:
            states = rest_states(rest, assumed.joints(one.joints(assumed.scene)), states or None)
            here = Solved(
                assumed, np.array([rest.observer.see(states[0], assumed.sensor)]), rest, tuple(states)
            )
            J = rest_jacobian(here, wanted, u, problem.base, one, problem.points)[0] / size[:, None]
        except StepError:
            continue  # no pose to go to
        known.append((joints, J))
    width = np.array([p.width for p in wanted])
    information = now.T @ now + np.diag(width**-2.0)
    before = np.sqrt(np.diag(np.linalg.inv(information)))
    found: list[Proposal] = []
    for i, after in most_telling([J for _, J in known], information, PROPOSED):
        found.append(Proposal(known[i][0], np.sqrt(np.diag(np.linalg.inv(after))) / before))
    assert all(len(p.half) == count for p in found)
    return found


def most_telling(
    jacobians: Sequence[FloatArray], information: FloatArray, count: int
) -> list[tuple[int, FloatArray]]:
    """Return which rows to take, best first, and the information with each and those before it.

    Args:
        jacobians: Of each, d values / du over sigma, shape (m, p).
        information: Without them, shape (p, p).
        count: How many, at most.
    """
    left = list(range(len(jacobians)))
    found: list[tuple[int, FloatArray]] = []
    while left and len(found) < count:
        gains = [
            np.linalg.slogdet(np.eye(len(J)) + J @ np.linalg.solve(information, J.T))[1]
            for J in (jacobians[i] for i in left)
        ]
        best = left.pop(int(np.argmax(gains)))
        information = information + jacobians[best].T @ jacobians[best]
        found.append((best, information))
    return found
