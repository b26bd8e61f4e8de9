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
from tripod_sim.linear.choice import LARGE
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

PLAIN = 1.4
"""Size over the mean edge of meshes of parts without small features, about: a larger size makes no other mesh."""

FILL = 6.0
"""Entries of L over the unknowns to the power 1.5: of a cube of quadratic tetrahedra; of a slender bar it is 2.8."""

ENTRY_BYTES, FEWEST_BYTES = 21.0, 1.5e8
"""Memory of a static solution for each entry of L, and for the program [B]: as measured, 1.50 GB of a bar of 81,120
unknowns and 65 million entries, 2.51 GB of a cube of 70,644 and 116 million."""

FACTOR_TIME, FACTORISATIONS, BUILD_TIME = 7.3e-12, 8, 3e-4
"""CPU time of a factorisation over the entries of L to the power 1.5 [s], how many a static solution takes in bending,
and what building takes for each unknown [s]: 9 s and 21 s of that cube."""


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


@dataclass(frozen=True)
class Need:
    """What a static solution takes, about: unknowns, entries of L, memory [B] and CPU time [s]."""

    unknowns: int
    entries: float
    memory: float
    seconds: float


def error_need(unknowns: int, fill: float = FILL) -> Need:
    """Return what it takes to estimate the error of a mesh: the solution on a mesh twice as fine.

    Args:
        unknowns: Of the mesh.
        fill: As `FILL`, of this part.
    """
    finer = 8 * unknowns
    entries = fill * finer**1.5
    seconds = FACTORISATIONS * FACTOR_TIME * entries**1.5 + BUILD_TIME * finer
    return Need(finer, entries, solution_memory(entries), seconds)


def solution_memory(entries: float) -> float:
    """Return about the memory [B] of a static solution whose L has so many entries."""
    return FEWEST_BYTES + ENTRY_BYTES * entries


@dataclass(frozen=True)
class Trial:
    """A mesh on the way to an accuracy.

    Attributes:
        size: Length of an edge [m].
        error: Estimated error, in parts of the largest displacement.
        unknowns: Of the mesh.
        edge: Mean edge [m].
        fill: As `FILL`, of this part.
    """

    size: float
    error: float
    unknowns: int
    edge: float
    fill: float = FILL


def judged(scene: Scene, size: float, edge: float) -> Trial:
    """Return the mesh of a part in a scene with its estimated error at rest.

    Args:
        scene: The part in it.
        size: Length of an edge that was asked for [m].
        edge: Mean edge of the mesh [m].

    Raises:
        SceneError, StepError: as `spatial_error`.
    """
    found = spatial_error(scene)
    fill = found.entries / found.unknowns[1] ** 1.5 or FILL
    return Trial(size, found.largest / found.moved, found.unknowns[0], edge, fill)


def refined(
    start: float, accuracy: float, most: int, room: float, trial_of: Callable[[float], Trial]
) -> tuple[list[Trial], str]:
    """Return the meshes that were tried, the last of them the one to take, and why there is no finer one.

    The error is taken to be proportional to the size, as that of `spatial_error`. The size falls until the error is
    small enough; then the reason is empty. It is not empty where the next mesh would have too many unknowns, or the
    estimate of its error would need too much memory or too large a factor.

    Args:
        start: Length of an edge of the first mesh [m].
        accuracy: Relative error that is enough.
        most: Unknowns of a mesh, at most.
        room: Memory that may be used [B].
        trial_of: Returns the mesh of a size.
    """
    trials = [trial_of(start)]
    while (last := trials[-1]).error > accuracy:
        factor = max(LARGEST_CHANGE, MARGIN * accuracy / last.error)
        unknowns = round(last.unknowns * factor**-2)  # between the growth of a sheet and of a thick part
        need = error_need(unknowns, last.fill)
        if unknowns > most:
            return (
                trials,
                f"a finer mesh would have more than {most} unknowns; allow more with --most-unknowns",
            )
        if need.memory > room or need.entries > LARGE:
            finer = (
                f"about {float(f'{need.unknowns:.2g}'):.0f} unknowns and {need.memory / 1e9:.2g} GB of memory"
            )
            free, used = f"{room / 1e9:.2g} GB", f"{solution_memory(LARGE) / 1e9:.2g} GB"
            return trials, (
                f"to estimate the error of a finer mesh takes a solution with {finer} ({free} are free, and at most "
                f"{used} are used)"
            )
        trials.append(trial_of(min(last.size, PLAIN * last.edge) * factor))
    return trials, ""
