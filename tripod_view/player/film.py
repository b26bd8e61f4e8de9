"""A film: what moves, as named arrays over time, for whoever shows it. Metres, seconds, z up. Pure."""

import dataclasses
from dataclasses import dataclass

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray

Rgb = tuple[int, int, int]


class FilmError(ValueError):
    """Arrays that make no film; the message names the one at fault and says what is needed."""


@dataclass(frozen=True, eq=False)
class Field:
    """A number at each node of a body, by which its surface may be coloured.

    Attributes:
        name: What it is.
        unit: Of the values; empty: none.
        values: In each picture, shape (k, n); NaN where there is none.
        signed: Whether it is shown from -a to a.
    """

    name: str
    unit: str
    values: FloatArray
    signed: bool = False


@dataclass(frozen=True, eq=False)
class Arrows:
    """Vectors at points, as many in each picture as there are then.

    Attributes:
        name: What they are.
        unit: Of the vectors.
        colour: 0 to 255.
        counts: How many there are in each picture, shape (k,).
        points: Where they begin [m], those of all pictures one behind the other, shape (sum of counts, 3).
        vectors: In that unit, likewise.
    """

    name: str
    unit: str
    colour: Rgb
    counts: IndexArray
    points: FloatArray
    vectors: FloatArray


@dataclass(frozen=True, eq=False)
class Deforming:
    """A body whose nodes move, each by itself.

    Attributes:
        name: For people.
        triangles: Node indices, shape (m, 3).
        positions: Of the nodes in each picture [m], shape (k, n, 3).
        colour: Of its surface, 0 to 255.
        through: Whether it is seen through others, faintly.
        fields: Numbers at its nodes.
        lines: Pairs of nodes between which pictures show lines on the surface, shape (l, 2).
    """

    name: str
    triangles: IndexArray
    positions: FloatArray
    colour: Rgb
    through: bool = False
    fields: tuple[Field, ...] = ()
    lines: IndexArray = dataclasses.field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))


@dataclass(frozen=True, eq=False)
class Piece:
    """A body that keeps its shape.

    Attributes:
        name: For people.
        triangles: Indices of vertices, shape (m, 3).
        vertices: In its own frame [m], shape (n, 3).
        colour: Of its surface, 0 to 255.
        poses: Its frame in each picture, position [m] and quaternion (x, y, z, w), shape (k, 7); None: it stands
            still, and its frame is that of the world. In a picture in which its pose is NaN it is not there.
    """

    name: str
    triangles: IndexArray
    vertices: FloatArray
    colour: Rgb
    poses: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Curve:
    """Numbers over time, drawn beside the picture.

    Attributes:
        title: What they are.
        unit: As they are shown.
        names: Of the numbers, w of them.
        values: In that unit, shape (k, w); NaN leaves a gap.
        limits: Values that are drawn as lines across.
    """

    title: str
    unit: str
    names: tuple[str, ...]
    values: FloatArray
    limits: tuple[float, ...] = ()


@dataclass(frozen=True)
class Colouring:
    """By which field surfaces are coloured at first.

    Attributes:
        name: Of the field.
        limits: Lowest and highest value of the colours; None: those of the whole film.
    """

    name: str
    limits: tuple[float, float] | None = None


@dataclass(frozen=True)
class Event:
    """Something that happened: the time [s] and what, in words."""

    time: float
    text: str


@dataclass(frozen=True, eq=False)
class Film:
    """A motion as pictures.

    Attributes:
        title: What it shows.
        times: Of the pictures, rising [s], shape (k,), k at least 1.
        bodies: What deforms.
        pieces: What keeps its shape.
        curves: What is drawn beside it.
        arrows: Forces and the like.
        events: What happened.
        description: A sentence about it.
        source: Where it comes from: simulated by which version, or recorded where.
        colouring: How surfaces are coloured at first; None: by their own colours.
    """

    title: str
    times: FloatArray
    bodies: tuple[Deforming, ...] = ()
    pieces: tuple[Piece, ...] = ()
    curves: tuple[Curve, ...] = ()
    arrows: tuple[Arrows, ...] = ()
    events: tuple[Event, ...] = ()
    description: str = ""
    source: str = ""
    colouring: Colouring | None = None

    def field(self, name: str) -> Field | None:
        """Return the first field of that name; None where no body has one."""
        return next((field for body in self.bodies for field in body.fields if field.name == name), None)

    def limits(self, name: str) -> tuple[float, float]:
        """Return the lowest and highest value of the fields of that name, of signed ones -a and a; 0 and 0 for none."""
        found = [field for body in self.bodies for field in body.fields if field.name == name]
        finite = [values for field in found if (values := field.values[np.isfinite(field.values)]).size]
        if not finite:
            return 0.0, 0.0
        low, high = min(float(v.min()) for v in finite), max(float(v.max()) for v in finite)
        if any(field.signed for field in found):
            high = max(-low, high)
            low = -high
        return low, high

    def __post_init__(self) -> None:
        k = len(self.times)
        _need(k > 0 and bool(np.isfinite(self.times).all()), "times", "at least one, all finite")
        _need(bool((np.diff(self.times) > 0).all()), "times", "each later than the one before")
        for body in self.bodies:
            _need(
                body.positions.ndim == 3 and len(body.positions) == k, body.name, f"{k} pictures of its nodes"
            )
            _need(body.positions.shape[2] == 3, body.name, "three coordinates of each node")
            _need(bool(np.isfinite(body.positions).all()), body.name, "finite positions")
            _check_triangles(body.name, body.triangles, body.positions.shape[1])
            for field in body.fields:
                _need(
                    field.values.shape == body.positions.shape[:2],
                    field.name,
                    "a value of each node and picture",
                )
            _check_colour(body.name, body.colour)
        for piece in self.pieces:
            _need(
                piece.vertices.ndim == 2 and piece.vertices.shape[1] == 3,
                piece.name,
                "vertices of shape (n, 3)",
            )
            _need(bool(np.isfinite(piece.vertices).all()), piece.name, "finite vertices")
            _need(piece.poses is None or piece.poses.shape == (k, 7), piece.name, f"poses of shape ({k}, 7)")
            _check_triangles(piece.name, piece.triangles, len(piece.vertices))
            _check_colour(piece.name, piece.colour)
        if self.colouring and self.colouring.limits:
            low, high = self.colouring.limits
            _need(
                -np.inf < low < high < np.inf,
                self.colouring.name,
                "limits of its colours, the lower one first",
            )
        for event in self.events:
            _need(bool(np.isfinite(event.time)), event.text, "a time of each event")
        for arrows in self.arrows:
            total = int(arrows.counts.sum()) if len(arrows.counts) == k else -1
            shape = (total, 3)
            _need(
                arrows.points.shape == shape == arrows.vectors.shape, arrows.name,
                "points and vectors of shape (sum of counts, 3), and a count for each picture",
            )  # fmt: skip
            _need(
                bool(np.isfinite(arrows.vectors).all() and np.isfinite(arrows.points).all()),
                arrows.name,
                "finite arrows",
            )
            _check_colour(arrows.name, arrows.colour)
        for curve in self.curves:
            _need(curve.values.shape == (k, len(curve.names)), curve.title, f"values of shape ({k}, names)")


def _check_triangles(name: str, triangles: IndexArray, count: int) -> None:
    _need(triangles.ndim == 2 and triangles.shape[1] == 3, name, "triangles of shape (m, 3)")
    within = triangles.size == 0 or (triangles.min() >= 0 and triangles.max() < count)
    _need(bool(within), name, f"triangles of nodes 0 to {count - 1}")


def _check_colour(name: str, colour: Rgb) -> None:
    fine = len(colour) == 3 and all(isinstance(c, int) and 0 <= c <= 255 for c in colour)
    _need(fine, name, "a colour of three whole numbers 0 to 255")


def _need(fine: bool, name: str, what: str) -> None:
    if not fine:
        raise FilmError(f"{name}: a film needs {what}")
