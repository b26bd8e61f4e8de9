"""What the page draws: nodes by path, which move with their parent, and the camera. Metres, z up. Pure but for a lock.

The thread of ROS changes nodes; `changes` returns, for any browser, what changed since its last picture. Only the
newest value of a property is kept, so a slow browser misses pictures and never delays anything.
"""

import json
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import RLock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tripod_view.pose import Pose

Rgb = tuple[int, int, int]

NUMBERS = {
    "vertices": np.float32, "rest": np.float32, "triangles": np.uint32, "values": np.float32,
    "points": np.float32, "vectors": np.float32,
}  # fmt: skip
"""Properties that are arrays, by name: they are sent as bytes, in little-endian order."""


@dataclass(frozen=True)
class Aim:
    """What the camera shows: a sphere of `radius` about `centre` [m], from angles [degrees]; the height `floor` [m]."""

    centre: tuple[float, float, float]
    radius: float
    azimuth: float
    elevation: float
    floor: float


class Node:
    """Something that is drawn; what is set here is sent if it differs from what was there."""

    def __init__(self, drawing: "Drawing", number: int, path: str, properties: dict[str, Any]) -> None:
        """Made by `Drawing` only."""
        self._drawing, self.number, self.path = drawing, number, path
        self.properties = properties
        self.versions = dict.fromkeys(properties, drawing.version)
        self.born = drawing.version

    def set(self, name: str, value: Any) -> None:
        """Set a property; an array is kept, not copied."""
        old = self.properties[name]
        if name in NUMBERS or old != value:
            with self._drawing.lock:
                self.properties[name] = value
                self.versions[name] = self._drawing.version

    def place(self, pose: Pose) -> None:
        """Put it at a pose in the frame of its parent."""
        self.set("pose", (*pose.position.tolist(), *pose.quaternion.tolist()))

    @property
    def visible(self) -> bool:
        """Whether it is drawn, with all that moves with it."""
        return bool(self.properties["visible"])

    @visible.setter
    def visible(self, shown: bool) -> None:
        self.set("visible", shown)

    def remove(self) -> None:
        """Remove it with all that moves with it."""
        self._drawing.remove(self)


class Drawing:
    """The nodes.

    Attributes:
        lock: Held while something changes.
        version: Of what changes now; `changes` ends it.
    """

    def __init__(self) -> None:
        self.lock, self.version = RLock(), 1
        self._nodes: dict[str, Node] = {}
        self._count = 0
        self._gone = 0
        self._aim: Aim | None = None
        self._aimed = self._fitted = 0
        self._time, self._timed = 0.0, 0

    @contextmanager
    def picture(self) -> Iterator[None]:
        """Make a picture of all changes within: no browser gets a part of them."""
        with self.lock:
            yield

    def add(self, path: str, kind: str, pose: Pose | None = None, **properties: Any) -> Node:
        """Add a node at `path`, in place of one that is there, and return it. Its parent is the node above, if any.

        Kinds and their properties beside `visible`:

        - `group`: `axes`, length of the axes that are drawn [m], 0 for none;
        - `mesh`: `vertices`, shape (n, 3); `triangles`, shape (m, 3); `colour`; `deforms`: whether its vertices will
          move; `through`: whether it is seen through others, faintly; `fits`: whether the camera is fitted to it;
          of a body that can be picked `name`, and `first`, the number of its first vertex among those of all, if any;
          of a soft one `rest`, its undeformed vertices;
        - `lines`: `vertices`, shape (2 n, 3), ends of pieces; `colour`;
        - `points`: `vertices`, shape (n, 3); `colour`; `size` [m];
        - `label`: `text`;
        - `field`, below a mesh: `values` at its vertices, shape (n,), NaN for none; named like the end of its path;
        - `arrows`: `name`, `unit`, `colour`; `points` [m] and `vectors` [unit], shape (k, 3);
        - `handle`, which can be dragged: `turns`: whether it can be turned, too.
        """
        with self.lock:
            if path in self._nodes:
                self._nodes[path].remove()
            place = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
            if pose is not None:
                place = (*pose.position.tolist(), *pose.quaternion.tolist())
            parent = self._nodes.get(path.rpartition("/")[0])
            head = {"kind": kind, "path": path, "parent": parent.number if parent else 0}
            self._count += 1
            self._nodes[path] = Node(
                self, self._count, path, {**head, "visible": True, "pose": place, **properties}
            )
            return self._nodes[path]

    def mesh(
        self,
        path: str,
        vertices: NDArray[Any],
        triangles: NDArray[Any],
        colour: Rgb,
        pose: Pose | None = None,
        **more: Any,
    ) -> Node:
        """Add a mesh; see `add`."""
        shape = {"vertices": vertices.astype(np.float32), "triangles": triangles.astype(np.uint32)}
        traits = {"deforms": False, "through": False, "fits": True} | more
        return self.add(path, "mesh", pose, **shape, colour=colour, **traits)

    def remove(self, node: Node) -> None:
        """Remove a node with all that moves with it; one that is no longer there is none."""
        with self.lock:
            if self._nodes.get(node.path) is node:
                below = node.path + "/"
                self._nodes = {
                    p: n for p, n in self._nodes.items() if p != node.path and not p.startswith(below)
                }
                self._gone = self.version

    def aim(self, aim: Aim, *, fit: bool) -> None:
        """Aim the camera: in every browser with `fit`, else where nobody has moved it."""
        with self.lock:
            self._aim, self._aimed = aim, self.version
            if fit:
                self._fitted = self.version

    def set_time(self, time: float) -> None:
        """Say of which simulated time the picture is [s]."""
        with self.lock:
            if time != self._time:
                self._time, self._timed = time, self.version

    def changes(self, seen: int) -> tuple[bytes, int]:
        """Return what a browser needs that has seen version `seen`, 0 for nothing yet, and the version then.

        Empty bytes: nothing changed. Else the length of a JSON head (uint32), the head, arrays. The head has `nodes`
        (number and changed properties; with `kind` for a new one; an array as first byte and count of numbers),
        `alive` (the numbers of all nodes) if one was removed, `camera` if it is to be aimed, `time` if that changed.
        """
        with self.lock:
            head: dict[str, Any] = {}
            now = self.version
            self.version += 1
            changed = [(node, node.properties.copy(), node.versions.copy()) for node in self._nodes.values()]
            if self._aim and self._aimed > seen:
                head["camera"] = {**vars(self._aim), "fit": self._fitted > seen}
            if self._timed > seen:
                head["time"] = self._time
            if self._gone > seen:
                head["alive"] = [node.number for node in self._nodes.values()]
        first, entries, arrays = 0, [], []
        for node, properties, versions in changed:
            names = [name for name in properties if node.born > seen or versions[name] > seen]
            if not names:
                continue
            entry: dict[str, Any] = {"number": node.number}
            for name in names:
                entry[name] = properties[name]
                if (kind := NUMBERS.get(name)) is not None:
                    array = np.ascontiguousarray(properties[name], np.dtype(kind).newbyteorder("<"))
                    entry[name] = [first, array.size]
                    first += array.nbytes
                    arrays.append(array.tobytes())
            entries.append(entry)
        if entries:
            head["nodes"] = entries
        if not head:
            return b"", now
        text = json.dumps(head, allow_nan=False, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        return b"".join([struct.pack("<I", len(text)), text, *arrays]), now
