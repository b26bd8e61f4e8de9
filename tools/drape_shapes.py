"""Writes the surfaces of the scenes with contact: cloth.obj (quadrangles), sphere.obj, cube.obj and plate.obj.

python tools/drape_shapes.py
"""

from itertools import product
from pathlib import Path

import numpy as np

SCENES = Path(__file__).parents[1] / "tripod_sim" / "scenes"

Faces = list[list[int]]


def cloth(count: int = 21, size: float = 0.8) -> tuple[np.ndarray, Faces]:
    """Return a square of `count` x `count` vertices in z = 0 about the origin, edge `size` [m]."""
    x = np.linspace(-size / 2, size / 2, count)
    vertices = np.array([[a, b, 0.0] for b, a in product(x, x)])
    corners = [j * count + i for j, i in product(range(count - 1), range(count - 1))]
    return vertices, [[k, k + 1, k + count + 1, k + count] for k in corners]


def sphere(radius: float = 0.2, rings: int = 12, around: int = 23) -> tuple[np.ndarray, Faces]:
    """Return a sphere of 2 `around` (`rings` - 1) triangles about the origin."""
    vertices = [[0.0, 0.0, radius]]
    for i in range(1, rings):
        polar = np.pi * i / rings
        for j in range(around):
            turn = 2 * np.pi * (j + 0.5 * (i % 2)) / around
            vertices.append(
                [
                    radius * np.sin(polar) * np.cos(turn),
                    radius * np.sin(polar) * np.sin(turn),
                    radius * np.cos(polar),
                ]
            )
    vertices.append([0.0, 0.0, -radius])

    def at(ring: int, j: int) -> int:
        return 1 + (ring - 1) * around + j % around

    faces: Faces = []
    last = len(vertices) - 1
    for j in range(around):
        faces += [[0, at(1, j), at(1, j + 1)], [last, at(rings - 1, j + 1), at(rings - 1, j)]]
        for i in range(1, rings - 1):
            a, b, c, d = at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)
            faces += [[a, c, d], [a, d, b]] if i % 2 else [[a, c, b], [b, c, d]]
    return np.array(vertices), faces


def cube(edge: float = 0.2) -> tuple[np.ndarray, Faces]:
    """Return a cube about the origin, its faces quadrangles."""
    vertices = np.array(list(product((-1.0, 1.0), repeat=3))) * edge / 2
    return vertices, [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def plate(edge: float = 2.0) -> tuple[np.ndarray, Faces]:
    """Return a square in z = 0 about the origin that faces up, one quadrangle."""
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * edge / 2
    return corners, [[0, 1, 2, 3]]


def write(name: str, vertices: np.ndarray, faces: Faces) -> None:
    """Write an OBJ file."""
    lines = ["# written by tools/drape_shapes.py; metres"]
    lines += ["v " + " ".join(f"{c:.9g}" for c in vertex) for vertex in vertices.tolist()]
    lines += ["f " + " ".join(str(k + 1) for k in face) for face in faces]
    (SCENES / name).write_text("\n".join(lines) + "\n")


def main() -> None:
    """Write all."""
    write("cloth.obj", *cloth())
    write("sphere.obj", *sphere())
    write("cube.obj", *cube())
    write("plate.obj", *plate())


if __name__ == "__main__":
    main()
