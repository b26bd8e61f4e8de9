"""What the mesh of a part costs and how far it errs: as a bar that its weight bends, or in a scene."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from time import thread_time

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.effects.damping import Damping
from tripod_sim.effects.gravity import Gravity
from tripod_sim.effects.inertia import Inertia
from tripod_sim.errors import SceneError
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.scene import Scene
from tripod_sim.simulation import Simulation
from tripod_sim.tables.bodies import Material, Mesh
from tripod_sim.tables.sets import Fixed
from tripod_study.spatial_error import spatial_error

CLAMPED = 0.05
"""Length of the end whose faces are held, in parts of the largest extent."""

HELD = "held_end"
"""Name of the set that is held."""

SAG = 0.01
"""How far the free end goes down, about, in parts of the largest extent: Young's modulus is chosen for that."""

DENSITY, WEIGHT = 1000.0, 9.81
"""Of the part [kg/m³], and the acceleration that bends it [m/s²]."""

FEWEST, PATIENCE = 3, 5.0
"""Steps that are timed at least, and time for more [s]."""

LARGEST_CHANGE, MARGIN = 0.5, 0.9
"""Of the size from one mesh to the next: at most by this factor; and what is taken beyond the estimate."""


def held_faces(mesh: SolidMesh) -> IndexArray:
    """Return the faces at the lower end of the longest side of a part of tetrahedra, shape (k, 3 or 6), k > 0.

    Faces are held, not a box: a finer mesh of the part then holds the same.
    """
    low, extent = mesh.nodes.min(axis=0), np.ptp(mesh.nodes, axis=0)
    long = int(extent.argmax())
    rows = np.concatenate([faces.nodes for faces in mesh.boundary])
    reach = mesh.nodes[rows][:, :, long].max(axis=1) - low[long]
    return rows[reach <= max(CLAMPED * extent[long], (1 + 1e-6) * float(reach.min()))]


def bar_scene(file: Path, nodes: FloatArray) -> Scene:
    """Return the scene of a part that is held at one end of its longest side and bends a little under its weight.

    Args:
        file: Its mesh, in metres, in which the set `HELD` is held.
        nodes: Of that [m], shape (n, 3).
    """
    extent = np.ptp(nodes, axis=0)
    down = [0.0, 0.0, 0.0]
    down[2 if extent.argmax() != 2 else int(extent[:2].argmin())] = -WEIGHT
    # the sag of a bar of rectangular section is 3/2 rho g L⁴ / (E t²)
    young = 1.5 * DENSITY * WEIGHT * extent.max() ** 3 / (SAG * extent.min() ** 2)
    return Scene(
        name="part",
        mesh=Mesh(source=str(file)),
        material=Material(young=float(young), density=DENSITY),
        gravity=Gravity((down[0], down[1], down[2])),
        inertia=Inertia(),
        damping=Damping(),
        fixed=(Fixed(set=HELD),),
    )


def scene_with(scene: Scene, file: Path) -> Scene:
    """Return a scene with another mesh file, in metres. Raises SceneError where it has no mesh of its own."""
    if not scene.mesh:
        raise SceneError(f"--scene {scene.name!r} has no [mesh] for the part; add one with its source")
    return replace(scene, mesh=Mesh(source=str(file)))


@dataclass(frozen=True)
class StepCost:
    """What a step costs here.

    Attributes:
        unknowns: Of the mesh.
        step: CPU time of a step [s].
        dt: Length of a step [s].
    """

    unknowns: int
    step: float
    dt: float


def step_cost(scene: Scene) -> StepCost:
    """Return what the first steps of a scene cost on this machine."""
    simulation = Simulation(scene)
    simulation.step()  # compiles what is left, and factors
    start, count = thread_time(), 0
    while count < FEWEST or (thread_time() - start < PATIENCE and count < 10 * FEWEST):
        simulation.step()
        count += 1
    return StepCost(simulation.unknowns, (thread_time() - start) / count, scene.dt)


def relative_error(scene: Scene) -> tuple[float, int]:
    """Return the estimated error of the mesh at rest, in parts of the largest displacement, and the unknowns.

    Raises SceneError and StepError as `spatial_error`.
    """
    found = spatial_error(scene)
    return found.largest / found.moved, found.unknowns[0]


@dataclass(frozen=True)
class Trial:
    """A mesh on the way to an accuracy: its size [m], its error (relative) and its unknowns."""

    size: float
    error: float
    unknowns: int


def refined(
    start: float, accuracy: float, most: int, error_of: Callable[[float], tuple[float, int]]
) -> list[Trial]:
    """Return the meshes that were tried, the last of them the one to take.

    The error is taken to be proportional to the size, as that of `spatial_error`. The size falls until the error is
    small enough, or the next mesh would have too many unknowns.

    Args:
        start: Length of an edge of the first mesh [m].
        accuracy: Relative error that is enough.
        most: Unknowns of a mesh, at most.
        error_of: Returns error and unknowns of the mesh of a size.
    """
    trials = list[Trial]()
    size = start
    while True:
        trials.append(Trial(size, *error_of(size)))
        last = trials[-1]
        if last.error <= accuracy:
            return trials
        factor = max(LARGEST_CHANGE, MARGIN * accuracy / last.error)
        if last.unknowns * factor**-2 > most:  # between the growth of a sheet and of a thick part
            return trials
        size *= factor
