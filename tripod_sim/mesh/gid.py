"""Reads GiD's text meshes (`.gidmsh`, `.msh`), the format of the public tutorial's meshes.

    MESH "name" dimension 3 ElemType Tetrahedra Nnode 4
    Coordinates
    1  0.0 0.0 0.0
    End Coordinates
    Elements
    1  1 2 3 4  [material]
    End Elements

Blocks may follow each other and share the nodes of the first; words in any case; `#` begins a comment; a line `Unit` is
left out, since the scene names the length unit. Numbers of nodes and elements need neither begin at 1 nor be in order.
"""

from array import array
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from tripod_host.arrays import IndexArray
from tripod_sim.elements.catalogue import SIZES
from tripod_sim.errors import SceneError
from tripod_sim.mesh.cells import Cells
from tripod_sim.mesh.lines import numbered_lines, to_coordinates, to_integer, word

TYPES = {
    "tetrahedra": {4: "tetra", 10: "tetra10"},
    "hexahedra": {8: "hexahedron", 20: "hexahedron20", 27: "hexahedron27"},
    "prism": {6: "wedge", 15: "wedge15", 18: "wedge18"},
    "pyramid": {5: "pyramid", 13: "pyramid13"},
    "triangle": {3: "triangle", 6: "triangle6"},
    "quadrilateral": {4: "quad", 8: "quad8", 9: "quad9"},
    "linear": {2: "line", 3: "line3"},
    "point": {1: "vertex"},
    "sphere": {1: "sphere"},
    "circle": {1: "circle"},
}
"""Names of cells by ElemType and Nnode."""

ROUND = ("sphere", "circle")
"""Cells that have further numbers, such as their radius."""


def read_gid(path: Path, name: str) -> Cells:
    """Return points and cells of a GiD text mesh.

    Args:
        path: The file.
        name: What messages call it.

    Raises:
        SceneError: not such a file; the message names the line and what is wrong with it.
    """
    return _Reader(path, name).cells()


class _Reader:
    """Goes through the lines once; numbers are kept in flat arrays, 40 bytes a node, 8 a node of an element."""

    def __init__(self, path: Path, name: str) -> None:
        self._lines = numbered_lines(path, name)
        self._name = name
        self._at = 0
        self._ids, self._id_lines, self._xyz = array("q"), array("q"), array("d")
        self._nodes: dict[str, array[int]] = {}
        self._element_lines: dict[str, array[int]] = {}

    def cells(self) -> Cells:
        """Return what the file holds. Raises SceneError."""
        kind, size = "", 0
        for tokens in self._tokens():
            match tokens[0].lower():
                case b"mesh":
                    kind, size = self._header(tokens)
                    self._element_lines.setdefault(kind, array("q"))
                    if kind in SIZES:
                        self._nodes.setdefault(kind, array("q"))
                case b"unit":
                    continue
                case b"coordinates" if kind and len(tokens) == 1:
                    self._block(b"coordinates", self._node)
                case b"elements" if kind and len(tokens) == 1:
                    self._block(b"elements", partial(self._element, kind=kind, size=size))
                case _:
                    wanted = (
                        "Coordinates, Elements or MESH" if kind else "MESH dimension 3 ElemType ... Nnode ..."
                    )
                    raise SceneError(f"{self._where}: expected {wanted}, found {word(tokens[0])}")
        if not kind:
            raise SceneError(f"{self._name} has no line MESH dimension 3 ElemType ... Nnode ...")
        points = np.array(self._xyz, dtype=np.float64).reshape(-1, 3)
        others = tuple(sorted(set(self._element_lines) - set(SIZES)))
        skipped = {kind: len(self._element_lines[kind]) for kind in ROUND if kind in others}
        solid = tuple(kind for kind in others if kind.startswith(("wedge", "pyramid")))
        return Cells(points, self._resolved(), others, solid, skipped)

    @property
    def _where(self) -> str:
        return f"{self._name}, line {self._at}"

    def _tokens(self) -> Iterator[list[bytes]]:
        """Yield the words of each line that has any."""
        for number, line in self._lines:
            self._at = number
            if tokens := line.partition(b"#")[0].split():
                yield tokens

    def _header(self, tokens: list[bytes]) -> tuple[str, int]:
        """Return the kind of cell that a MESH line announces, and its number of nodes."""
        words = b" ".join(tokens).rpartition(b'"')[2].lower().split()
        found = {}
        for key in (b"dimension", b"elemtype", b"nnode"):
            if key not in words[:-1]:
                raise SceneError(
                    f"{self._where}: MESH without {key.decode()}; MESH dimension 3 ElemType T Nnode N"
                )
            found[key] = words[words.index(key) + 1]
        if found[b"dimension"] != b"3":
            raise SceneError(f"{self._where}: dimension is {word(found[b'dimension'])}; only 3 can be read")
        kinds = TYPES.get(found[b"elemtype"].decode("ascii", errors="replace"))
        if kinds is None:
            raise SceneError(
                f"{self._where}: ElemType is {word(found[b'elemtype'])}; Tetrahedra, Hexahedra or Prism are needed"
            )
        size = to_integer(found[b"nnode"], self._where, "a number of nodes")
        if size not in kinds:
            allowed = ", ".join(str(k) for k in kinds)
            raise SceneError(
                f"{self._where}: {word(found[b'elemtype'])} with Nnode {size}; allowed: {allowed}"
            )
        return kinds[size], size

    def _block(self, name: bytes, take: Callable[[list[bytes]], None]) -> None:
        """Hand each line to `take` until the block's end."""
        began = self._at
        for tokens in self._tokens():
            if tokens[0].lower() == b"end":
                if [t.lower() for t in tokens[1:]] != [name]:
                    raise SceneError(f"{self._where}: expected End {name.decode().capitalize()}")
                return
            take(tokens)
        raise SceneError(
            f"{self._name}: {name.decode().capitalize()} of line {began} never end; is the file cut short?"
        )

    def _node(self, tokens: list[bytes]) -> None:
        if len(tokens) != 4:
            raise SceneError(
                f"{self._where}: a node needs its number and 3 coordinates, found {len(tokens)} words"
            )
        self._ids.append(to_integer(tokens[0], self._where, "the number of a node"))
        self._id_lines.append(self._at)
        self._xyz.extend(to_coordinates(tokens[1:], self._where))

    def _element(self, tokens: list[bytes], kind: str, size: int) -> None:
        if len(tokens) not in (size + 1, size + 2) and kind not in ROUND:
            raise SceneError(
                f"{self._where}: an element needs its number, {size} nodes and perhaps a material, "
                f"found {len(tokens)} words"
            )
        self._element_lines[kind].append(self._at)
        if kind in self._nodes:
            self._nodes[kind].extend(
                [to_integer(t, self._where, "the number of a node") for t in tokens[1 : size + 1]]
            )

    def _resolved(self) -> dict[str, IndexArray]:
        """Return the cells with node numbers turned into indices of points. Raises SceneError."""
        ids = np.array(self._ids, dtype=np.int64)
        order = np.argsort(ids, kind="stable")
        ranked = ids[order]
        if (again := np.flatnonzero(ranked[1:] == ranked[:-1])).size:
            first, second = (self._id_lines[order[again[0] + k]] for k in (0, 1))
            raise SceneError(
                f"{self._name}, line {second}: node {ranked[again[0]]} was already given in line {first}; "
                "give each node a number of its own"
            )
        volumes = {}
        for kind, numbers in self._nodes.items():
            wanted = np.array(numbers, dtype=np.int64).reshape(-1, SIZES[kind])
            place = np.searchsorted(ranked, wanted)
            known = place < len(ranked)
            known[known] = ranked[place[known]] == wanted[known]
            if (bad := np.argwhere(~known)).size:
                e, k = bad[0]
                line = self._element_lines[kind][e]
                raise SceneError(
                    f"{self._name}, line {line}: node {wanted[e, k]} is not among the Coordinates"
                )
            volumes[kind] = order[place]
        return volumes
