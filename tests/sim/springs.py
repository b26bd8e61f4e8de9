"""Gradient and Hessian of a body of springs, and the body of a scene, for tests."""

import numpy as np

from tripod_sim.forces.spring_force import SpringForce
from tripod_sim.scene import Scene
from tripod_sim.springs.body import SpringBody
from tripod_sim.springs.net import spring_net

NO_MODES = np.zeros((0, 0, 3))


def net_of(scene: Scene) -> SpringBody:
    """Return the springs of a scene where they are described to begin."""
    assert scene.springs
    return spring_net(scene.springs)


def force_of(body: SpringBody) -> SpringForce:
    """Return the elastic term of a body."""
    return SpringForce(
        body.ends, body.rest_length, body.stiffness, body.damping, slack=body.slack, owner="net"
    )


def add_whole_gradient(body: SpringBody, x: np.ndarray, g: np.ndarray) -> float:
    """Add dE/dx to `g` [N], shape (n, 3), fixed nodes included, and return E [J]."""
    return force_of(body).add_gradient(x, NO_MODES, g)


def hessian(body: SpringBody, x: np.ndarray, *, project: bool) -> np.ndarray:
    """Return d²E/dx² of the free nodes [N/m], shape (unknowns, unknowns)."""
    term, free = force_of(body), (3 * body.free[:, None] + np.arange(3)).ravel()
    term.stiffness(x, NO_MODES, project=project)
    H = np.zeros((x.size, x.size))
    for ends, block in zip(body.ends, term.matrices, strict=True):
        own = (3 * ends[:, None] + np.arange(3)).ravel()
        H[np.ix_(own, own)] += block
    return H[np.ix_(free, free)]
