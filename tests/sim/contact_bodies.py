"""Boxes, balls and plates for the tests of contact."""

from weakref import WeakKeyDictionary

import numpy as np

from tests.sim.implicit_schemes import scheme_of
from tripod_sim.constraints.groups import Groups
from tripod_sim.contact.contact_solver import ContactSolver
from tripod_sim.contact.response import Law
from tripod_sim.contact.rigid_bodies import RigidBodies
from tripod_sim.contact.stepper import contact_steps
from tripod_sim.integrators.report import ContactReport
from tripod_sim.integrators.substeps import Substeps
from tripod_sim.mesh.surfaces import Part
from tripod_sim.state import State
from tripod_sim.system import System

G = 9.81

_LOOPS = WeakKeyDictionary[ContactSolver, tuple[Substeps, State]]()


def step(world: ContactSolver, h: float) -> ContactReport:
    """Advance the rigid bodies of `world` by `h` [s] from where they are now."""
    bodies = world.rigid
    assert bodies
    if world not in _LOOPS:
        system = System(np.zeros((0, 3)), (), Groups(0, free=len(bodies.mass)))
        state = system.undeformed(np.zeros(1))
        _LOOPS[world] = contact_steps(world), state
    steps, state = _LOOPS[world]
    bodies.store(state)
    report = steps.step(state, state.joints.copy(), h).contact
    assert report
    return report


def box(edges: np.ndarray | list[float]) -> Part:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = [[q[0], q[k], q[k + 1]] for q in quads for k in (1, 2)]
    return Part(corners * np.array(edges) / 2, np.array(triangles), rigid=True)


def plate(size: float = 5.0) -> Part:
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * size
    return Part(corners, np.array([[0, 1, 2], [0, 2, 3]]), fixed=True)


def boxes_on_plate(
    law: Law,
    centres: list[list[float]],
    gravity: np.ndarray,
    mass: float = 0.3,
    scheme: str = "implicit_euler",
) -> ContactSolver:
    """Cubes of 0.1 m on a plate in z = 0."""
    n = len(centres)
    inertia = np.tile(mass * 0.01 / 6 * np.eye(3), (n, 1, 1))
    bodies = RigidBodies(np.full(n, mass), inertia, np.array(centres), gravity)
    parts = [box([0.1, 0.1, 0.1]) for _ in range(n)]
    return ContactSolver(law, 3 * law.distance, scheme_of(scheme), obstacles=[plate()], rigid=(bodies, parts))


def ball_on(
    obstacle: Part,
    law: Law,
    centre: list[float],
    radius: float = 0.05,
    mass: float = 0.2,
    scheme: str = "implicit_euler",
    gravity: list[float] | None = None,
) -> ContactSolver:
    inertia = 0.4 * mass * radius**2 * np.eye(3)[None]
    bodies = RigidBodies(np.array([mass]), inertia, np.array([centre]), np.array(gravity or [0, 0, -G]))
    ball = Part(np.zeros((1, 3)), rigid=True, radius=radius)
    return ContactSolver(
        law, 5 * law.distance, scheme_of(scheme), obstacles=[obstacle], rigid=(bodies, [ball])
    )


def balls(
    law: Law, centres: list[list[float]], radius: float = 0.05, mass: float = 0.2, still: int = 0
) -> ContactSolver:
    """Balls without gravity, the last `still` of them fixed; 5 contact distances of alarm."""
    parts = [Part(np.zeros((1, 3)), rigid=True, radius=radius) for _ in centres[still:]]
    obstacles = [Part(np.array([c]), fixed=True, radius=radius) for c in centres[len(centres) - still :]]
    moving = np.array(centres[: len(centres) - still])
    inertia = np.tile(0.4 * mass * radius**2 * np.eye(3), (len(moving), 1, 1))
    bodies = RigidBodies(np.full(len(moving), mass), inertia, moving, np.zeros(3))
    return ContactSolver(law, 5 * law.distance, obstacles=obstacles, rigid=(bodies, parts))
