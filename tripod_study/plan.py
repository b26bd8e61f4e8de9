"""What a study of accuracy is: knobs and their values, what is measured, and against what.

A study runs a scene at points, each a full set of values of scene fields. A point gives observations, rows of numbers;
its errors are those of its rows against a reference's rows, so points and references are measured alike, in any order.
"""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

from tripod_sim.errors import SceneError

Value = str | float | int | bool
Settings = Mapping[str, Value]
"""Values by scene field, such as `{"mesh.level": 2}`; the value `off` switches an effect off."""

Observed = dict[str, list[list[float]]]
"""Rows of numbers by quantity, SI units; the same rows at every point of a study."""


@dataclass(frozen=True)
class Knob:
    """A scene field that a study varies.

    Attributes:
        name: For `--knobs`.
        field: Of the scene.
        what: In words, with the unit.
    """

    name: str
    field: str
    what: str


_ALL = (
    Knob("element", "mesh.element", "kind of element"),
    Knob("level", "mesh.level", "resolution of the mesh"),
    Knob("refine", "mesh.refine", "how many times every edge is halved"),
    Knob("size", "mesh.size", "length of an edge of the mesh of a part [m]"),
    Knob("clamp", "clamp", "stiffness of the clamps' bedding [N/m⁴]; off: ideal, sharp clamps"),
    Knob("law", "material.law", "elastic law"),
    Knob("response", "contact.response", "multipliers or penalty"),
    Knob(
        "distance",
        "contact.contact_distance",
        "at which surfaces are held [m]; a third of the alarm distance",
    ),
    Knob("contact_tolerance", "contact.tolerance", "of gaps and slips, over the contact distance"),
    Knob("scheme", "inertia.scheme", "time integrator"),
    Knob("substeps", "inertia.substeps", "whether explicit schemes divide a step until it is stable"),
    Knob("dt", "dt", "time step [s]"),
    Knob("mode", "solver.mode", "Newton to the tolerance, or one linear solve a stage"),
    Knob("linear", "solver.linear", "linear solver"),
    Knob("linear_tolerance", "solver.linear_tolerance", "relative residual of conjugate gradients"),
    Knob("tolerance", "solver.tolerance", "unbalanced force of static and implicit solutions [N]"),
    Knob("turn", "solver.max_turn", "largest servo move of one increment [rad]"),
    Knob("substep", "ball.substep", "longest part of a step in which the ball moves [s]"),
)
KNOBS = {knob.field: knob for knob in _ALL}
"""Scene fields that studies vary."""


@dataclass(frozen=True)
class Quantity:
    """What a user cares about.

    Attributes:
        name: Also the name of its rows among the observations, unless `rows` names others.
        unit: Of its absolute error.
        what: One line.
        reference: Name of the reference that it is held against.
        measure: `distance`: the norm of a row's difference; `rms`: the root mean square over the points in a row, each
            three numbers. The error is the largest over the rows.
        scale: What an error is relative to: `travel`: the largest difference between two rows of the reference;
            `largest`: the largest norm of a row of the reference.
        rows: Name of its rows among the observations, if not its own.
        promised: Whether `--accuracy` promises it as well as the first quantity of the study, which it always does.
    """

    name: str
    unit: str
    what: str
    reference: str = "reference"
    measure: str = "distance"
    scale: str = "travel"
    rows: str = ""
    promised: bool = False

    @property
    def key(self) -> str:
        """Name of its rows among the observations."""
        return self.rows or self.name


NODES = Quantity(
    "nodes",
    "m",
    "positions of all nodes, root mean square, the worst instant of the first second",
    measure="rms",
)
"""As `motion.nodes` observes them."""


@dataclass(frozen=True)
class Reference:
    """Settings that converge, coarse to fine, and what they tend to.

    With `order` p and `sizes` h the reference is Richardson's limit of the two finest, r = f + (f - m) / (q - 1) with
    q = (hm/hf)^p. Its own error is, of three rungs, how far that limit moves if the finest is left out, over q - 1:
    what the limit lacks falls at least as fast as what its rungs lack. Of two rungs it is how far the limit is from the
    finest. Without `order` the finest itself is the reference, and its distance from the next its own error.

    Attributes:
        name: As quantities name it.
        rungs: Makes the settings, coarse to fine, for a point's settings; at least two.
        order: p, or None.
        sizes: h of each rung, of any unit.
    """

    name: str
    rungs: Callable[[Settings], Sequence[Settings]]
    order: float | None = None
    sizes: tuple[float, ...] = ()


def always(rungs: Sequence[Settings], order: float | None = None, sizes: tuple[float, ...] = ()) -> Reference:
    """Return the reference of this one name whose rungs are the same for all points."""
    return Reference("reference", lambda _: rungs, order, sizes)


@dataclass(frozen=True)
class Point:
    """One row of a study.

    Attributes:
        settings: Of all knobs.
        label: Of a setting that people know by a name; such a point stays whatever `--knobs` leaves out.
    """

    settings: Settings
    label: str = ""


@dataclass(frozen=True)
class Plan:
    """A study of accuracy, not yet run.

    Attributes:
        name, title: Of the study.
        module: Has the function `task`, which measures the settings of a point.
        version: Raised whenever the task changes, so that points measured before it are not taken for new ones.
        default: Values of the knobs in the shipped scene, or the nearest that the study can run.
        points: What is run.
        quantities: What is measured; the first is the error that the study is about.
        references: What they are held against.
        solves: Whether a point is a number of static solutions, not a motion.
        quick: Whether it is the short form of the study.
        scene: That it varies; empty: that of the study's name.
        base: Settings of all points.
        others: What is varied besides those of `default` that `KNOBS` has.
        group: Field by which a picture colours the points.
        order_knob: Field whose order of convergence is fitted; empty for none.
        order_quantity: Quantity of which it is fitted.
        limit: CPU or wall time after which a point is given up [s].
        note: What a reader must know.
        given: What `task` is told besides, which is no field of a scene.
        draft: Settings of the point that `--accuracy draft` takes; empty: the cheapest that is exact enough for it.
        studied: Digest of the scene of a user (`accuracy.studied.studied`).
    """

    name: str
    title: str
    module: str
    version: int
    default: Settings
    points: tuple[Point, ...]
    quantities: tuple[Quantity, ...]
    references: tuple[Reference, ...]
    quick: bool
    scene: str = ""
    base: Settings = field(default_factory=dict)
    others: tuple[Knob, ...] = ()
    group: str = "inertia.scheme"
    solves: bool = False
    order_knob: str = ""
    order_quantity: str = ""
    limit: float = 300.0
    note: str = ""
    given: Settings = field(default_factory=dict)
    draft: Settings = field(default_factory=dict)
    studied: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "scene", self.scene or self.name)

    @property
    def knobs(self) -> tuple[Knob, ...]:
        """What is varied, in the order of `default`."""
        return (*(KNOBS[name] for name in self.default if name in KNOBS), *self.others)

    def full(self, settings: Settings) -> dict[str, Value]:
        """Return all that is set at a point, the base too."""
        return {**self.base, **settings}

    def told(self, settings: Settings) -> dict[str, Value]:
        """Return what `task` is told of a point."""
        return {**self.given, **self.full(settings)}

    def key(self, settings: Settings) -> str:
        """Return what tells measured points apart: a digest of what is told, study and its version."""
        text = json.dumps([self.name, self.version, self.told(settings)], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:20]

    def runs(self) -> tuple[list[Settings], list[Settings]]:
        """Return all settings to measure, each once: those of references, which take longest, and the others."""
        rungs = {
            self.key(rung): rung
            for reference in self.references
            for point in self.points
            for rung in reversed(list(reference.rungs(point.settings)))
        }
        others = {self.key(p.settings): p.settings for p in self.points}
        return list(rungs.values()), [s for key, s in others.items() if key not in rungs]

    def only(self, names: Sequence[str]) -> tuple[Point, ...]:
        """Return the points that differ from the default in the knobs of these names alone. Raises SceneError."""
        known = {knob.name: knob.field for knob in self.knobs}
        for name in names:
            if name not in known:
                raise SceneError(f"knob {name!r} is unknown; knobs of {self.name}: {', '.join(known)}")
        held = [field for name, field in known.items() if name not in names]
        kept = [
            p for p in self.points if p.label or all(p.settings.get(f) == self.default.get(f) for f in held)
        ]
        if not any(not p.label for p in kept):
            raise SceneError(
                f"--knobs {','.join(names)}: no setting of study {self.name} varies only these; "
                f"{self._instead(names)}"
            )
        return tuple(kept)

    def _instead(self, names: Sequence[str]) -> str:
        """Return which sets of knobs, with one of `names` or else any, points do vary alone; the shortest ones."""
        varied = {
            tuple(k.name for k in self.knobs if p.settings.get(k.field) != self.default.get(k.field))
            for p in self.points
            if not p.label
        } - {()}
        like = sorted((v for v in varied if set(v) & set(names)), key=lambda v: (len(v), v))
        others = sorted(varied, key=lambda v: (len(v), v))
        ways = [
            *(["without --quick"] if self.quick else []),
            *("--knobs " + ",".join(v) for v in (like or others)[:3]),
        ]
        return "try " + ", or ".join(ways)


def grid(default: Settings, **values: Sequence[Value]) -> list[Point]:
    """Return points of all combinations of values; the others as in `default`.

    Args:
        default: Values of all knobs.
        values: By field, `__` for the dot.
    """
    fields = [name.replace("__", ".") for name in values]
    return [Point({**default, **dict(zip(fields, row, strict=True))}) for row in product(*values.values())]


def points_of(default: Settings, points: Sequence[Point], label: str = "the default") -> tuple[Point, ...]:
    """Return the default, of this label, and the points, without repetitions; a label stays."""
    found: dict[str, Point] = {}
    for point in (Point(default, label), *points):
        key = json.dumps(dict(point.settings), sort_keys=True)
        if key not in found or (point.label and not found[key].label):
            found[key] = point
    return tuple(found.values())
