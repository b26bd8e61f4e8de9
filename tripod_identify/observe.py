"""What a state of a scene shows of the measured numbers: pose of the disc, sets, points that move with a set."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_host.rotations import rotation_matrix, rotation_vector
from tripod_identify.csv_columns import EFFECTOR, Channel
from tripod_identify.errors import DataError
from tripod_sim.scene import Scene
from tripod_sim.state import State
from tripod_sim.tables.sets import Marker
from tripod_sim.tables.short_forms import effector_of

DISC = "effector"


@dataclass(frozen=True)
class Point:
    """A point that moves with a set, or the effector, as with a rigid body: one that is glued to it, on a stalk say.

    Attributes:
        name: As the columns of the data have it.
        set: Whose nodes it moves with, or `effector`.
        at: Where it is on the undeformed body, or in the effector's frame [m].
    """

    name: str
    set: str
    at: tuple[float, float, float]


def parse_point(text: str) -> Point:
    """Return the point that `NAME=SET:X,Y,Z` describes, X, Y, Z in [m]. Raises DataError."""
    name, _, rest = text.partition("=")
    group, _, place = rest.partition(":")
    try:
        at = tuple(float(v) for v in place.split(","))
    except ValueError:
        at = ()
    if not (name and group and len(at) == 3 and np.isfinite(at).all()):
        raise DataError(f"--point {text!r} is not of the form NAME=SET:X,Y,Z with X, Y, Z in metres")
    return Point(name.strip(), group.strip(), (at[0], at[1], at[2]))


def with_watched(scene: Scene, points: Sequence[Point]) -> Scene:
    """Return the scene with a marker for the set of each point."""
    have = {marker.set for marker in scene.marker}
    names = dict.fromkeys(p.set for p in points if p.set != DISC)
    more = [Marker(name) for name in names if name not in have]
    return replace(scene, marker=(*scene.marker, *more))


def has_disc(scene: Scene) -> bool:
    """Return whether the effector is rigid, so that it has an orientation: a disc or a platform."""
    effector = effector_of(scene)
    return effector is not None and effector.is_disc


def sources_of(scene: Scene, points: Sequence[Point]) -> tuple[str, ...]:
    """Return the names that columns of data may have for this scene.

    Raises DataError: a point is on an effector that the scene has not.
    """
    disc = EFFECTOR if has_disc(scene) else ()
    for point in points:
        if point.set == DISC and not disc:
            why = "is no disc" if effector_of(scene) else "is missing"
            raise DataError(
                f"--point {point.name}={DISC}: the effector of scene {scene.name!r} {why}; name a set of the scene"
            )
    return (*disc, *(marker.set for marker in scene.marker), *(p.name for p in points))


@dataclass(frozen=True, eq=False)
class Sensor:
    """How the data see the robot.

    A place x is measured as T(turn) x + shift, a rotation R as T R; what is seen of the disc is the point `mount` [m]
    of its own frame.

    Attributes:
        shift: [m], shape (3,).
        turn: Rotation vector [rad], shape (3,).
        mount: [m], shape (3,).
    """

    shift: FloatArray
    turn: FloatArray
    mount: FloatArray


def plain_sensor() -> Sensor:
    """Return the sensor that sees the world as it is, and the centre of the disc."""
    return Sensor(np.zeros(3), np.zeros(3), np.zeros(3))


class Observer:
    """Reads the channels of data from states."""

    def __init__(
        self, channels: Sequence[Channel], points: Sequence[Point], watched: Mapping[str, IndexArray], rest: FloatArray
    ) -> None:  # fmt: skip
        """`watched`: nodes of sets by name; `rest`: undeformed places of nodes [m], shape (n, 3)."""
        self._sources = tuple(dict.fromkeys(c.source for c in channels))
        at = {source: i for i, source in enumerate(self._sources)}
        self._place = np.array([[at[c.source], c.axis, c.angle] for c in channels], dtype=np.int64).reshape(
            -1, 3
        )
        glued = {p.name: p for p in points}
        self._nodes: list[IndexArray | None] = []
        self._mounts = dict[str, FloatArray]()
        self._arms: list[tuple[FloatArray, FloatArray] | None] = []
        for source in self._sources:
            point = glued.get(source)
            name = point.set if point else source
            nodes = None if name == DISC else watched[name]
            if point and nodes is None:
                self._mounts[source] = np.array(point.at)
            self._nodes.append(nodes)
            turned = any(c.angle for c in channels if c.source == source)
            if nodes is None or not (point or turned):
                self._arms.append(None)
                continue
            body = rest[nodes]
            centre = body.mean(axis=0)
            arm = np.array(point.at) - centre if point else np.zeros(3)
            self._arms.append((body - centre, arm))

    def see(self, state: State, sensor: Sensor) -> FloatArray:
        """Return the channels [m, rad], shape (m,)."""
        return self.framed(self.raw(state, sensor.mount)[None], sensor)[0]

    def raw(self, state: State, mount: FloatArray) -> FloatArray:
        """Return place [m] and rotation vector [rad] of each source in the world, shape (sources, 2, 3)."""
        seen = np.zeros((len(self._sources), 2, 3))
        for i, (nodes, arms) in enumerate(zip(self._nodes, self._arms, strict=True)):
            if nodes is None:
                R = state.rotations[0]
                glued = self._mounts.get(self._sources[i], mount)
                seen[i] = state.centres[0] + R @ glued, rotation_vector(R)
                continue
            here = state.positions[nodes]
            seen[i, 0] = here.mean(axis=0)
            if arms:
                R = best_rotation(arms[0], here - seen[i, 0])
                seen[i] = seen[i, 0] + R @ arms[1], rotation_vector(R)
        return seen

    def framed(self, raw: FloatArray, sensor: Sensor) -> FloatArray:
        """Return the channels [m, rad], shape (k, m), for rows as `raw` gives them, shape (k, sources, 2, 3)."""
        turn = rotation_matrix(sensor.turn)
        seen = raw @ turn.T
        seen[:, :, 0] += sensor.shift
        if sensor.turn.any():
            for k, i in np.ndindex(*raw.shape[:2]):
                seen[k, i, 1] = rotation_vector(turn @ rotation_matrix(raw[k, i, 1]))
        else:
            seen[:, :, 1] = raw[:, :, 1]
        source, axis, angle = self._place.T
        return np.asarray(seen[:, source, angle, axis])


def best_rotation(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return the rotation R that makes sum |R before_i - after_i|² least, both about their means [Kabsch1976].

    Args:
        before, after: Shape (k, 3).
    """
    u, _, vt = np.linalg.svd(after.T @ before)
    sign = np.sign(np.linalg.det(u) * np.linalg.det(vt)) or 1.0
    return np.asarray(u @ np.diag([1.0, 1.0, sign]) @ vt)
