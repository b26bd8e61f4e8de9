"""The pendulum by DOP853 on equations written here: the reference of the study `pendulum`; else as `watch`."""

import time

import numpy as np
from scipy.integrate import solve_ivp

from tripod_host.arrays import FloatArray
from tripod_sim.tables.bodies import Springs
from tripod_study import watch
from tripod_study.motion import scene_of
from tripod_study.plan import Settings
from tripod_study.task import Measured

EXACT = "reference.dop853"
"""Not a field of the scene: the relative and absolute tolerance of DOP853, which then takes the place of a scheme."""


def task(settings: Settings) -> Measured:
    """Run the motion; cost: CPU time of a simulated second."""
    if EXACT not in settings:
        return watch.task(settings)
    scene, interval = scene_of(str(settings[watch.FILE]), {}), float(settings[watch.INTERVAL])
    assert scene.springs
    assert scene.gravity
    times: FloatArray = interval * np.arange(0.0, int(settings[watch.SAMPLES]) + 1)
    begin = time.thread_time()
    found = exact(scene.springs, scene.gravity.acceleration[2], float(settings[EXACT]), times)
    taken = time.thread_time() - begin
    return Measured(watch.rows_of_nodes(settings, times[1:], found), [taken], float(times[-1]))


def exact(springs: Springs, gravity: float, tolerance: float, times: FloatArray) -> FloatArray:
    """Return the nodes of the chain at `times` by DOP853 [HairerNorsettWanner1993], shape (t, n, 3).

    Node 0 is fixed; each spring pulls with k (|d| - L) d / |d|, both ways.

    Args:
        springs: The chain.
        gravity: z component [m/s²].
        tolerance: Relative and absolute (m, m/s).
        times: Rising, from zero on [s].
    """
    n, rest = springs.nodes, springs.size / (springs.nodes - 1)

    def rate(_: float, y: FloatArray) -> FloatArray:
        x, v = y.reshape(2, n, 3)
        d = x[1:] - x[:-1]
        length = np.linalg.norm(d, axis=1, keepdims=True)
        pull = springs.stiffness * (length - rest) * d / length
        a = np.zeros((n, 3))
        a[:-1] += pull / springs.node_mass
        a[1:] -= pull / springs.node_mass
        a[:, 2] += gravity
        a[0] = 0.0
        return np.concatenate([v.ravel(), a.ravel()])

    start = np.zeros((2, n, 3))
    start[0, :, 0] = np.linspace(0.0, springs.size, n)
    done = solve_ivp(
        rate, (0.0, times[-1]), start.ravel(), method="DOP853", rtol=tolerance, atol=tolerance, t_eval=times
    )
    return np.asarray(done.y.T[:, : 3 * n].reshape(len(times), n, 3))
