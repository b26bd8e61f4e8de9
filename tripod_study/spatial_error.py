"""Estimate of the error that the mesh makes: the same static state on a mesh twice as fine.

A quantity Q that a mesh of element length h gets wrong by C h^p, to leading order, is wrong by 2^-p of that on the mesh
with every edge halved, so that

    Q_exact - Q_h = (Q_h/2 - Q_h) / (1 - 2^-p)

[Richardson1911]. Where strips are clamped the stress is singular, at the edge of a sharp clamp and, weaker, at that of
a bedding; quantities of the whole body then converge with p = 1 whatever the element, which is what is assumed. That
says nothing about the law of the material, the clamp, or the time steps (`time_error`).
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from tripod_host.arrays import FloatArray
from tripod_sim.errors import SceneError
from tripod_sim.scene import Scene, at_rest
from tripod_sim.simulation import Simulation, joint_values
from tripod_sim.tables.short_forms import joints_of, posed

ORDER = 1
"""p."""


@dataclass(frozen=True, eq=False)
class SpatialError:
    """How far a mesh is from the exact solution of its equations, in one static state; each value estimated.

    Attributes:
        effector: Exact minus computed position of the effector's centre [m], shape (3,); None without an effector.
        largest: Largest distance of a node from where it should be [m].
        node: That node.
        strain: Exact minus computed strain energy [J].
        efforts: Exact minus computed torques of the servos [N m], shape (s,).
        position: Computed position of the effector [m], shape (3,), or None.
        strain_computed: Computed strain energy [J].
        efforts_computed: Computed torques [N m], shape (s,).
        unknowns: Of the mesh, and of that with every edge halved.
        moved: Largest computed displacement of a node from the undeformed shape [m].
        entries: Of the factor L on the finer mesh; 0 where it was not factored by `Ldl`.
    """

    effector: FloatArray | None
    largest: float
    node: int
    strain: float
    efforts: FloatArray
    position: FloatArray | None
    strain_computed: float
    efforts_computed: FloatArray
    unknowns: tuple[int, int]
    moved: float
    entries: int = 0


def spatial_error(scene: Scene, joints: FloatArray | None = None) -> SpatialError:
    """Return the estimated error of a scene's mesh in the static equilibrium at given joints.

    Both states are computed from the undeformed shape; the finer one has about eight times as many elements and takes
    ten to a hundred times as long as the scene's own.

    Args:
        scene: Its effects of motion, balls and contact are left out.
        joints: Angles [rad] and slide [m], shape (s + 1,); None takes those at which the scene starts.

    Raises:
        SceneError: the scene is of springs or rigid bodies, nothing holds it, its mesh cannot be halved once more, or
            `joints` do not fit.
        StepError: one of the two meshes has no equilibrium there.
    """
    mesh = scene.mesh
    if scene.springs or scene.body:
        raise SceneError(
            "the error of the mesh is estimated for one solid only: springs have no mesh, and of several "
            "bodies only one would be refined"
        )
    if not mesh:
        raise SceneError("rigid bodies have no mesh, so there is no error of the mesh to estimate")
    if not (joints_of(scene) or scene.fixed or scene.prescribed):
        raise SceneError(
            "nothing holds the body (no servos, nothing fixed or prescribed), so it has no static state "
            "for which to estimate the error; add [[fixed]] or [servos]"
        )
    if joints is not None:
        scene = _posed(scene, joints)
    still = at_rest(scene)
    halved = replace(still, mesh=replace(mesh, refine=mesh.refine + 1))
    coarse, fine = _settled(still), _settled(halved)
    share = 1 / (1 - 0.5**ORDER)
    apart, same = cKDTree(fine.mesh.nodes).query(coarse.mesh.nodes)
    size = float(np.ptp(coarse.mesh.nodes, axis=0).max())
    moved = np.where((apart < 1e-6 * size)[:, None], fine.positions[same] - coarse.positions, 0.0)
    distance = share * np.sqrt((moved**2).sum(axis=1))
    node = int(np.argmax(distance))
    ends = [s.effector.position if s.effector else None for s in (coarse, fine)]
    energies = [s.energies().strain for s in (coarse, fine)]
    return SpatialError(
        effector=share * (ends[1] - ends[0]) if ends[0] is not None and ends[1] is not None else None,
        largest=float(distance[node]),
        node=node,
        strain=share * (energies[1] - energies[0]),
        efforts=share * (fine.efforts - coarse.efforts),
        position=ends[0],
        strain_computed=energies[0],
        efforts_computed=coarse.efforts.copy(),
        unknowns=(coarse.unknowns, fine.unknowns),
        moved=float(np.linalg.norm(coarse.positions - coarse.mesh.nodes, axis=1).max()),
        entries=getattr(fine._system.linear, "entries", 0),
    )


def _posed(scene: Scene, joints: FloatArray) -> Scene:
    """Return the scene with its servos at `joints`."""
    found = joints_of(scene)
    values = joint_values(joints, found.count + 1 if found else 1)
    return posed(scene, values[:-1], float(values[-1])) if found else scene


def _settled(scene: Scene) -> Simulation:
    """Return the scene in static equilibrium."""
    simulation = Simulation(scene)
    simulation.step()
    return simulation
