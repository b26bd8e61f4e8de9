"""Tables of what a scene is made of: meshes, materials, springs, rigid bodies, obstacles."""

import pkgutil
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_host.rotations import quaternion_matrix
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.materials.laws import NAMES
from tripod_sim.tables.fields import number, one_of
from tripod_sim.tables.robot import Effector, Servos

YOUNG, DENSITY = (1e3, 1e12), (10.0, 25e3)
"""What is usual: from jelly to diamond [Pa], from foam to osmium [kg/m³]."""


SHAPES: Final = tuple(
    sorted(m.name for m in pkgutil.iter_modules([str(Path(__file__).parents[1] / "shapes")]))
)
"""What rigid bodies and obstacles can be: a file each, none of which a scene without contact imports."""

AUTO, GENERATED = "auto", {"y_piece": "h8_modes", "block": "h8_modes"}
"""The element of a mesh where a scene names none, and which one that is of what each generator makes."""


@dataclass(frozen=True)
class Mesh:
    """Where the solid's mesh comes from.

    Attributes:
        source: The generators `y_piece` and `block` (a brick, or what it becomes with other corners), or the path of a
            file with tetrahedra, hexahedra or wedges (relative to the scene's file): GiD text, gmsh, VTK, Abaqus and
            what else meshio reads; the content tells the format, whatever the name. A part (STL, OBJ, STEP) is filled
            with tetrahedra, once; the mesh is kept beside it.
        level: Resolution of the generator, 1 (coarse) to 4; 5 to 7 for `t4`, of the sizes of the workshop's meshes;
            8 to 11 for compliant clamps, whose bedded ends they divide, too; 12 (`h8_modes`) and 13 (`h20`) graded for
            them with as few unknowns as 1 % takes at rest; 14 (`h20`) as 0.5 % takes in motion.
        element: Kind of element: `h8_modes` (with incompatible modes), `h8_mean` (with mean dilatation), `h8`,
            `h20`, `h20_full`, `h27`, wedges `w6`, tetrahedra `t4`, `t10`; of a file those that its cells allow (linear
            hexahedra all, linear tetrahedra `t4` and `t10`). `auto`: the best that the cells allow without more of
            them, `h8_modes` of linear hexahedra, `t10` of tetrahedra, `h20` and `h27` of hexahedra of as many nodes,
            `w6` of wedges. In a file with several kinds of cells each becomes an element with its own nodes (linear
            tetrahedra `t4`), those that the element fits the one named here.
        scale: Length unit of a file or of `corners` [m]: 0.001 for millimetres.
        size: Length of an edge of the tetrahedra in a part [m].
        refine: How many times every edge is halved, so that each element becomes eight.
        legs: Strips of the piece, evenly about Z; the servos' `count` goes with it.
        corners: Of a block, eight in VTK order: four below, counter-clockwise seen from above, and those over them, in
            units of `scale`.
        cells: Of a block along its three edges, the first from corner 0 to 1, then to 3 and to 4.
    """

    source: str = "y_piece"
    level: int = number(2, low=1, high=14)
    element: str = one_of(AUTO, *ELEMENTS, default=AUTO)
    scale: float = number(1.0, unit="m", above=0, high=1e3)
    size: float | None = number(None, unit="m", above=0, high=1e3)
    refine: int = number(0, low=0, high=3)
    legs: int = number(3, low=3, high=6)
    corners: tuple[tuple[float, float, float], ...] = number((), unit="m", low=-1e3, high=1e3)
    cells: tuple[int, int, int] = number((1, 1, 1), low=1, high=1000)

    def __post_init__(self) -> None:
        """Name the element of what a generator makes; that of a file is known when it is read."""
        if self.element == AUTO:
            object.__setattr__(self, "element", GENERATED.get(self.source, AUTO))


@dataclass(frozen=True)
class Material:
    """The solid's elastic law.

    Attributes:
        law: A file of `materials/laws`; it takes `young` or, as `yeoh` does, `parameters`, and `poisson`.
        young: E [Pa]; 250e3 where neither it nor `parameters` is given.
        poisson: nu for small strains.
        parameters: Of a law that takes them, in its own order and units; E follows.
        mass: Of the whole solid [kg], spread evenly over its volume.
        density: [kg/m³]; where it is given the mass follows from it.
    """

    law: str = one_of(*NAMES, default="neo_hooke")
    young: float | None = number(None, unit="Pa", above=0, high=1e13, usual=YOUNG)
    poisson: float = number(0.45, low=0, high=0.499)
    parameters: tuple[float, ...] = number((), low=-1e13, high=1e13)
    mass: float = number(0.032, unit="kg", above=0, high=1e6)
    density: float | None = number(None, unit="kg/m³", above=0, high=1e6, usual=DENSITY)


@dataclass(frozen=True)
class Region:
    """A part of a solid that is of another material: the elements in a set.

    Of a set by places those are in it whose centroid is there, of a group of cells of the mesh file its cells, of a
    group of nodes those whose nodes are all in it.

    Attributes:
        set: Name of the set; of elements in two regions the later one counts.
        law, young, poisson, parameters, density: As of the material; without a density that of the rest.
    """

    set: str
    law: str = one_of(*NAMES, default="neo_hooke")
    young: float | None = number(None, unit="Pa", above=0, high=1e13, usual=YOUNG)
    poisson: float = number(0.45, low=0, high=0.499)
    parameters: tuple[float, ...] = number((), low=-1e13, high=1e13)
    density: float | None = number(None, unit="kg/m³", above=0, high=1e6, usual=DENSITY)


@dataclass(frozen=True)
class Springs:
    """A body of nodes and springs: a chain, a grid or the edges of a surface.

    Attributes:
        source: `chain` (nodes in a line from the origin along X), `grid` (a square in z = 0 about the origin), or the
            path of an OBJ or STL file (relative to the scene's file), whose edges become springs.
        nodes: Of a chain; along each edge of a grid.
        size: Length of a chain, edge of a grid [m].
        scale: Length unit of a file [m]: 0.001 for millimetres.
        position: Where the origin of chain, grid or file lies [m].
        rest: Rest length of each spring, as a share of its length in the net; below 1 the net is taut.
        node_mass: Of each node [kg].
        stiffness: k of the springs along lines and edges [N/m].
        shear: k of those across the cells of a grid, or the quadrangles of a file [N/m]; 0 leaves them out.
        bending: k of those from a node to the next but one, or across the edge of two triangles [N/m]; 0 leaves them
            out.
        damping: c of each spring, the force per rate of its length [N s/m].
        compressed: `push`: a compressed spring pushes; `slack`: it carries no force.
        fixed_nodes: Nodes that never move.
        fixed_corners: Corners that never move: ends 0 and 1 of a chain, 0 to 3 of a grid, counter-clockwise from the
            smallest x and y.
    """

    source: str = "grid"
    nodes: int = number(20, low=2, high=200_000)
    size: float = number(1.0, unit="m", above=0, high=1e3)
    scale: float = number(1.0, unit="m", above=0, high=1e3)
    position: tuple[float, float, float] = number((0.0, 0.0, 0.0), unit="m", low=-1e3, high=1e3)
    rest: float = number(1.0, low=0, high=100)
    node_mass: float = number(0.001, unit="kg", above=0, high=1e6)
    stiffness: float = number(1500.0, unit="N/m", low=0, high=1e9)
    shear: float = number(0.0, unit="N/m", low=0, high=1e9)
    bending: float = number(0.0, unit="N/m", low=0, high=1e9)
    damping: float = number(0.0, unit="N s/m", low=0, high=1e6)
    compressed: str = one_of("push", "slack", default="push")
    fixed_nodes: tuple[int, ...] = number((), low=0)
    fixed_corners: tuple[int, ...] = number((), low=0, high=3)

    @property
    def holds(self) -> bool:
        """Whether it has nodes that never move."""
        return bool(self.fixed_nodes or self.fixed_corners)


HOME = (0.0, 0.0, 0.0, 1.0)
"""No rotation."""


@dataclass(frozen=True)
class Body:
    """A soft body: a solid (`mesh` and `material`) or `springs`. Any number of them may be beside each other.

    Tables of its own are written below it: `[body.mesh]`, `[body.material]`, `[[body.region]]`, `[body.springs]`,
    `[body.servos]`, `[body.effector]`. Its nodes are a set of its name.

    Attributes:
        name: By which others refer to it; `body` is that of the short form, `[mesh]` or `[springs]`.
        like: Name of a body before it, whose mesh and material it has, too.
        position: Where the origin of mesh or net lies [m].
        orientation: Of its axes about that point: unit quaternion x, y, z, w.
        mesh, material: The solid.
        region: Parts of the solid that are of other materials.
        springs: The net of springs.
        servos: Servo arms about its own Z axis, behind those of the bodies before it.
        effector: A rigid disc about its own Z axis; the first of the scene is its effector.
    """

    name: str
    position: tuple[float, float, float] = number((0.0, 0.0, 0.0), unit="m", low=-1e3, high=1e3)
    orientation: tuple[float, float, float, float] = number((0.0, 0.0, 0.0, 1.0), low=-1.01, high=1.01)
    like: str = ""
    mesh: Mesh | None = None
    material: Material | None = None
    region: tuple[Region, ...] = ()
    springs: Springs | None = None
    servos: Servos | None = None
    effector: Effector | None = None

    @property
    def pose(self) -> tuple[FloatArray, FloatArray]:
        """Position [m] and rotation matrix."""
        return np.array(self.position), quaternion_matrix(self.orientation)


@dataclass(frozen=True)
class Tie:
    """Nodes of one body that are nodes of another, too: they move as one.

    Attributes:
        set: Name of a set; each of its nodes is tied to the nearest one of the other.
        to: Name of that other set.
        within: Farthest that two nodes which become one may be apart [m]; the one of the later body is moved.
    """

    set: str
    to: str
    within: float = number(1e-6, unit="m", low=0, high=1.0)


@dataclass(frozen=True)
class Obstacle:
    """A body that never moves. Needs contact.

    Attributes:
        shape: `surface` (from a file, which may be open), `box` (edges `size`), `ball` (`radius`) or `capsule`
            (`radius`, `length`).
        source: Path of the OBJ or STL file of a `surface` (relative to the scene's file).
        scale: Length unit of the file [m]: 0.001 for millimetres.
        size: Edges of a box [m].
        radius: Of a ball or a capsule [m].
        length: Of a capsule, between the centres of its ends, along its Z axis [m].
        position: Where the centre, or the file's origin, lies [m].
        orientation: Of its axes about that point: unit quaternion x, y, z, w.
    """

    source: str = ""
    scale: float = number(1.0, unit="m", above=0, high=1e3)
    shape: str = one_of(*SHAPES, default="surface")
    size: tuple[float, float, float] = number((0.1, 0.1, 0.1), unit="m", above=0, high=1e3)
    radius: float = number(0.05, unit="m", above=0, high=1e3)
    length: float = number(0.1, unit="m", above=0, high=1e3)
    position: tuple[float, float, float] = number((0.0, 0.0, 0.0), unit="m", low=-1e3, high=1e3)
    orientation: tuple[float, float, float, float] = number((0.0, 0.0, 0.0, 1.0), low=-1.01, high=1.01)


@dataclass(frozen=True)
class Rigid:
    """A body that moves as a whole. Needs contact.

    Attributes:
        shape: `box` (edges `size`), `ball` (`radius`), `capsule` (`radius`, `length`) or `surface`, the inside of a
            closed surface from a file.
        source: Path of the OBJ or STL file of a `surface` (relative to the scene's file).
        scale: Length unit of the file [m]: 0.001 for millimetres.
        size: Edges of a box [m].
        radius: Of a ball or a capsule [m].
        length: Of a capsule, between the centres of its ends, along its Z axis [m].
        mass: [kg], spread evenly.
        position: Of the centre of mass at the start [m].
        orientation: At the start: unit quaternion x, y, z, w.
        velocity: Of the centre at the start [m/s].
        spin: Angular velocity at the start, in world [rad/s].
    """

    shape: str = one_of(*SHAPES, default="box")
    source: str = ""
    scale: float = number(1.0, unit="m", above=0, high=1e3)
    size: tuple[float, float, float] = number((0.1, 0.1, 0.1), unit="m", above=0, high=1e3)
    radius: float = number(0.05, unit="m", above=0, high=1e3)
    length: float = number(0.1, unit="m", above=0, high=1e3)
    mass: float = number(1.0, unit="kg", low=1e-9, high=1e6)
    position: tuple[float, float, float] = number((0.0, 0.0, 0.0), unit="m", low=-1e3, high=1e3)
    orientation: tuple[float, float, float, float] = number((0.0, 0.0, 0.0, 1.0), low=-1.01, high=1.01)
    velocity: tuple[float, float, float] = number((0.0, 0.0, 0.0), unit="m/s", low=-1e4, high=1e4)
    spin: tuple[float, float, float] = number((0.0, 0.0, 0.0), unit="rad/s", low=-1e5, high=1e5)
