"""What a run leaves behind: every step as arrays, and all that is needed to show them again.

| key | shape | what |
|---|---|---|
| `version` | text | version of tripod |
| `scene` | text | the scene with all its values, as TOML |
| `units` | text | unit of each array, as JSON |
| `time` | k | at the end of each step [s] |
| `positions` | k, n, 3 | nodes; those of rigid bodies last [m] |
| `vertices` | k, v, 3 | points to draw a body without a surface, such as a chain [m]; absent otherwise |
| `triangles` | t, 3 | of the surface: indices of `vertices` if present, else of `positions` |
| `bodies` | b | number of triangles of each soft body (a single 0: none), then of each rigid body |
| `energies` | k, 3 | kinetic energy, strain energy, gravitational potential [J] |
| `effector` | k, 7 | pose of the disc: position [m], quaternion x, y, z, w; with an effector |
| `angles`, `torques` | k, s | of the servos [rad], [N m] |
| `actuator_positions`, `actuator_efforts` | k, a | of other actuators [m or m³], [N or Pa]; with any |
| `actuator_names`, `actuator_units` | a | name, unit of the command |
| `cables` | k, p, 3 | points of all cables [m]; with any |
| `cable_names`, `cable_points` | c | of each: name, how many points |
| `arms` | s, 13 | hub [m], quaternion, direction of the slide, lengths of arm, grip and rail [m]; with servos |
| `slide` | k | of the servo bodies [m] |
| `ball` | k, 7 | pose of the ball; with a ball |
| `rigid` | k, r, 7 | poses of rigid bodies; with any |
| `maze_vertices`, `maze_triangles` | v, 3 and t, 3 | of the maze, in the frame of the disc [m]; with a maze |
| `maze_goal` | 4 | centre of the goal in the frame of the disc, radius [m]; with a maze that has one |
| `still_vertices`, `still_triangles` | v, 3 and t, 3 | of the obstacles [m]; with any |
| `event_times`, `event_texts` | e | events: time [s], text |
| `mesh_error` | k, v | [field](#colours) at the nodes of the surface [m]; with `--colour mesh_error` |
| `force_names`, `force_units` | g | groups of `--forces`, with that option: name, unit |
| `force_counts` | k, g | how many vectors each has |
| `force_points`, `force_vectors` | p, 3 | of the first step, group by group, then of the next: place [m], force |
"""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_host.writing import check_place, replaced
from tripod_sim.errors import SceneError, shown
from tripod_sim.scene.file import scene_to_toml
from tripod_sim.simulation import Pose, Simulation

MOST_BYTES = 4e9
"""Of one run, held in memory [bytes]."""

UNITS = {
    "time": "s",
    "positions": "m",
    "vertices": "m",
    "cables": "m",
    "energies": "J",
    "effector": "m, m, m, 1, 1, 1, 1",
    "angles": "rad",
    "torques": "N m",
    "arms": "m, m, m, 1, 1, 1, 1, 1, 1, 1, m, m, m",
    "slide": "m",
    "ball": "m, m, m, 1, 1, 1, 1",
    "rigid": "m, m, m, 1, 1, 1, 1",
    "maze_vertices": "m",
    "maze_goal": "m",
    "still_vertices": "m",
    "event_times": "s",
    "mesh_error": "m",
    "force_points": "m",
    "force_vectors": "force_units",
}
"""Of the arrays."""


class Recording:
    """Every step of a run, in memory.

    Attributes:
        count: Steps that are in it: another thread may read what is before.
        dt: Of a step [s].
        fields: Returns what computes fields of the recorded positions.
        with_mesh_error: Whether the error of the mesh is recorded.
    """

    def __init__(
        self, simulation: Simulation, steps: int, *, forces: bool = False, mesh_error: bool = False
    ) -> None:
        """Prepare.

        Args:
            simulation: What will run.
            steps: The most that it takes.
            forces: Whether it has the forces on the bodies, too.
            mesh_error: Whether it has the error of the mesh at each node.

        Raises SceneError: the steps need more memory than there is, or are none; the error is not estimated.
        """
        if not isinstance(steps, int | np.integer) or steps < 1:
            raise SceneError(f"steps is {shown(steps)}; it must be a whole number, at least 1")
        nodes, servos, rigid = (
            len(simulation.mesh.nodes),
            len(simulation.driven_frames),
            len(simulation.rigid),
        )
        own_skin = simulation.skin is not simulation.mesh
        shapes: dict[str, tuple[int, ...]] = {
            "time": (),
            "positions": (nodes, 3),
            "energies": (3,),
            "angles": (servos,),
            "slide": (),
            "torques": (servos,),
        }
        if others := len(simulation.efforts) - servos:
            shapes |= {"actuator_positions": (others,), "actuator_efforts": (others,)}
        if routes := simulation.routes:
            shapes["cables"] = (sum(len(route.fixed) for route in routes.values()), 3)
        if own_skin:
            shapes["vertices"] = (len(simulation.skin.nodes), 3)
        if simulation.effector:
            shapes["effector"] = (7,)
        if simulation.ball:
            shapes["ball"] = (7,)
        if rigid:
            shapes["rigid"] = (rigid, 7)
        if mesh_error:
            if (field := simulation.mesh_error_field()) is None:
                raise SceneError(
                    "field 'mesh_error': the scene does not estimate it; add [mesh_error], or --set mesh_error={}"
                )
            shapes["mesh_error"] = field.shape
        size = 8.0 * steps * sum(math.prod(shape) for shape in shapes.values())
        if size > MOST_BYTES:
            raise SceneError(
                f"the results of the run would take {size / 1000000000.0:.1f} GB (allowed: "
                f"{MOST_BYTES / 1000000000.0:g} GB); shorten --duration or enlarge dt"
            )
        try:
            self._moving = {name: np.empty((steps, *shape)) for name, shape in shapes.items()}
        except MemoryError:
            raise SceneError(
                f"the results of the run need {size / 1000000000.0:.1f} GB of memory, more than is free; "
                "shorten --duration or enlarge dt"
            ) from None
        self._still, self._forces = _still(simulation), None
        there = {*shapes, *self._still, "event_times"}
        if forces:
            self._forces = RecordedForces(simulation, steps, MOST_BYTES - size)
            there |= {"force_points", "force_vectors"}
        self._still["units"] = np.array(json.dumps({n: unit for n, unit in UNITS.items() if n in there}))
        self._events: list[tuple[float, str]] = []
        self.count, self.dt, self.fields = 0, simulation.scene.dt, simulation.fields
        self.with_mesh_error = mesh_error

    def add(self, simulation: Simulation) -> None:
        """Add the present state of `simulation`. Raises SceneError where there is no room for one more."""
        if self.count == len(self._moving["time"]):
            raise SceneError(
                f"the recording is full after the {self.count} steps that it was made for; make it for more "
                "steps"
            )
        a, k, state, energies = self._moving, self.count, simulation.state, simulation.energies()
        a["time"][k] = state.time
        positions = a["positions"][k] = simulation.positions
        a["energies"][k] = energies.kinetic, energies.strain, energies.gravity
        servos, count = len(simulation.driven_frames), len(simulation.efforts)
        a["angles"][k], a["slide"][k] = state.joints[:servos], state.joints[count]
        a["torques"][k] = simulation.efforts[:servos]
        if count > servos:
            joints, efforts = simulation.joint_work()
            a["actuator_positions"][k], a["actuator_efforts"][k] = joints[servos:count], efforts[servos:]
        if "cables" in a:
            a["cables"][k] = np.concatenate(list(simulation.cables(positions).values()))
        if "vertices" in a:
            a["vertices"][k] = simulation.shown(positions)
        for name, pose in (("effector", simulation.effector), ("ball", simulation.ball)):
            if pose:
                a[name][k] = _row(pose)
        for i, pose in enumerate(simulation.rigid):
            a["rigid"][k, i] = _row(pose)
        if "mesh_error" in a:
            a["mesh_error"][k] = simulation.mesh_error_field()
        if self._forces:
            self._forces.add(simulation, k)
        event = simulation.ball_event
        if event and not (self._events and self._events[-1][1] == event):
            self._events.append((state.time, event))
        self.count = k + 1

    def arrays(self, first: int = 0) -> dict[str, Any]:
        """Return what is in it from step `first` on, by the names that the module's table tells."""
        end = self.count
        found: dict[str, Any] = {name: a[first:end] for name, a in self._moving.items()}
        if self._forces:
            found |= self._forces.arrays(first, end)
        events = list(self._events)
        found["event_times"] = np.array([time for time, _ in events])
        found["event_texts"] = np.array([text for _, text in events], dtype=str)
        return found | self._still

    def save(self, path: str | Path) -> None:
        """Write the steps added so far; nothing if there are none. Raises SceneError where `path` cannot be written."""
        if not self.count:
            return
        try:
            with replaced(path) as file:
                np.savez(file, allow_pickle=False, **self.arrays())
        except OSError as error:
            raise unwritable("--out", path, error) from None


class RecordedForces:
    """The forces on the bodies in each step of a run: as many as there are then."""

    def __init__(self, simulation: Simulation, steps: int, most: float) -> None:
        """`steps`: the most that it takes; `most`: bytes."""
        simulation.keep_forces()
        self._most, self._groups = most, list(simulation.force_groups)
        self._counts: IndexArray = np.zeros((steps, len(self._groups)), dtype=np.int64)
        self._ends: IndexArray = np.zeros(steps + 1, dtype=np.int64)
        self._rows: FloatArray = np.zeros((256, 6))

    def add(self, simulation: Simulation, k: int) -> None:
        """Add those of step `k`. Raises SceneError where they need too much memory."""
        groups, end = simulation.forces(), int(self._ends[k])
        self._add_groups(simulation.force_groups)
        for group in groups:
            count = self._counts[k, self._groups.index(group.name)] = len(group.points)
            if end + count > len(self._rows):
                room = 2 * (end + count)
                if 48.0 * room > self._most:
                    raise SceneError(
                        f"the forces of {k} steps take more than {MOST_BYTES / 1e9:g} GB with all else that is "
                        "recorded; shorten --duration, or leave --forces out"
                    )
                self._rows = np.concatenate([self._rows[:end], np.zeros((room - end, 6))])
            self._rows[end : end + count, :3], self._rows[end : end + count, 3:] = group.points, group.vectors
            end += count
        self._ends[k + 1] = end

    def _add_groups(self, groups: tuple[str, ...]) -> None:
        """Take groups in their order: there are more as soon as somebody applies forces."""
        if len(groups) == len(self._groups):
            return
        counts = np.zeros((len(self._counts), len(groups)), dtype=np.int64)
        counts[:, [groups.index(name) for name in self._groups]] = self._counts
        self._counts, self._groups = counts, list(groups)

    def arrays(self, first: int, end: int) -> dict[str, Any]:
        """Return those of the steps from `first` to before `end`."""
        from tripod_sim.acting_forces import UNITS, kind_of  # noqa: PLC0415 - only on request

        rows = self._rows[self._ends[first] : self._ends[end]]
        return {
            "force_names": np.array(self._groups, dtype=str),
            "force_units": np.array([UNITS[kind_of(name)] for name in self._groups], dtype=str),
            "force_counts": self._counts[first:end],
            "force_points": rows[:, :3],
            "force_vectors": rows[:, 3:],
        }


def check_out(option: str, path: Path | None, suffixes: tuple[str, ...]) -> None:
    """Raise SceneError if `path` has another suffix, or could not be written after the run."""
    if path is None:
        return
    if path.suffix.lower() not in suffixes:
        raise SceneError(
            f"{option} {str(path)!r} must end in {' or '.join(suffixes)}, the format that is written"
        )
    try:
        check_place(path)
    except OSError as error:
        raise unwritable(option, path, error) from None


def unwritable(option: str, path: str | Path, error: OSError) -> SceneError:
    """Return what to tell of a file that cannot be written."""
    return SceneError(f"{option} {str(path)!r} cannot be written: {error.strerror or error}")


def version() -> str:
    """Return the version of tripod."""
    from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415 - slow to import

    try:
        return version("tripod")
    except PackageNotFoundError:
        return "not installed"


def _still(simulation: Simulation) -> dict[str, Any]:
    """Return what stays the same in all steps."""
    scene = simulation.scene
    found: dict[str, Any] = {
        "version": np.array(version()),
        "scene": np.array(scene_to_toml(scene)),
        "triangles": simulation.skin.surface,
        "bodies": np.array(simulation.bodies, dtype=np.int64),
    }
    if simulation.joints and simulation.joints.arms:
        from tripod_sim.scene.description import standing  # noqa: PLC0415 - only with servos

        rows = [standing(arm).values() for arm in simulation.joints.arms]
        found["arms"] = np.array([np.hstack(list(row)) for row in rows])
    if scene.obstacles:
        from tripod_sim.contact.contact_build import obstacle_shapes  # noqa: PLC0415 - only with obstacles

        parts = obstacle_shapes(scene.obstacles)
        first = np.cumsum([0, *(len(part.vertices) for part in parts)])
        found["still_vertices"] = np.concatenate([part.vertices for part in parts])
        found["still_triangles"] = np.concatenate(
            [part.triangles + k for part, k in zip(parts, first, strict=False)]
        )
    if simulation.joints and (others := simulation.joints.others):
        found["actuator_names"] = np.array([actuator.name for actuator in others])
        found["actuator_units"] = np.array([actuator.unit for actuator in others])
    if routes := simulation.routes:
        found["cable_names"] = np.array(list(routes))
        found["cable_points"] = np.array([len(route.fixed) for route in routes.values()])
    if plate := simulation.plate:
        from tripod_sim.maze.board_mesh import board_mesh  # noqa: PLC0415 - only with a maze

        mesh = board_mesh(plate.board, plate.offset)
        found["maze_vertices"], found["maze_triangles"] = mesh.vertices, mesh.triangles
        x, y, radius = plate.board.goal
        if radius > 0:
            found["maze_goal"] = np.array([x, y, plate.offset, radius])
    return found


def _row(pose: Pose) -> list[float]:
    return [*pose.position.tolist(), *pose.quaternion.tolist()]
