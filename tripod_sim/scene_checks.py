"""What the tables of a scene must agree on with each other; each check raises SceneError with one line."""

from typing import TYPE_CHECKING

from tripod_sim.errors import SceneError, shown
from tripod_sim.scene_short import (
    ball_is_rigid,
    discs_of,
    field_of,
    rigids_of,
    servo_tables,
    soft_bodies,
    springs_alone,
)
from tripod_sim.tables.motion import EXPLICIT
from tripod_sim.timeline import parse_timeline

if TYPE_CHECKING:
    from tripod_sim.scene import Scene
    from tripod_sim.tables.bodies import Body
    from tripod_sim.tables.method import TimeError
    from tripod_sim.tables.sets import Vector


def check_body(scene: "Scene") -> None:
    """Raise SceneError if a body is neither a solid nor of springs, or if one lacks a name of its own."""
    bodies = soft_bodies(scene)
    if not (bodies or rigids_of(scene)):
        raise SceneError(
            "field mesh is missing: a scene has mesh and material, or springs, or bodies, or rigid bodies"
        )
    names = [body.name for body in bodies]
    for k, body in enumerate(bodies):
        field = field_of(scene, k)
        if field and (not body.name or body.name == "all" or body.name in names[:k]):
            raise SceneError(
                f"{field}name is {shown(body.name)}; it must be a name of its own: not 'all', nor that of another body"
            )
        if (like := getattr(body, "like", "")) and (
            like not in names[:k] or not bodies[names.index(like)].mesh
        ):
            solids = ", ".join(shown(other.name) for other in bodies[:k] if other.mesh)
            raise SceneError(
                f"{field}like is {shown(like)}; it must be the name of a solid before it: {solids or 'none is'}"
            )
        if like and (scene.body[k - len(bodies)].mesh or scene.body[k - len(bodies)].material):
            raise SceneError(
                f"{field}like and {field}mesh, {field}material exclude each other: leave one out"
            )
        _check_kind(body, field)
    if scene.region and not scene.mesh:
        raise SceneError("region needs mesh: it is a part of a solid")
    if scene.tie and len(bodies) < 2:
        raise SceneError("tie needs two soft bodies: it makes nodes of one those of another")
    if scene.strain_limit and not (scene.inertia and any(body.springs for body in bodies)):
        raise SceneError(
            "strain_limit needs springs and inertia: it bounds how far springs stretch in motion"
        )
    if scene.ball and not ball_is_rigid(scene) and not (bodies and bodies[0].mesh):
        raise SceneError("ball needs contact where the first body is no solid; add [contact]")
    for name in ("servos", "effector"):
        if getattr(scene, name) and bodies and not bodies[0].mesh:
            raise SceneError(
                f"{name} needs a solid as the first body: springs are held by fixed_nodes, fixed_corners or fixed boxes"
            )
        if getattr(scene, name) and bodies and getattr(bodies[0], name):
            raise SceneError(
                f"{name} and {field_of(scene, 0)}{name} are both of the first body; leave one out"
            )


def _check_kind(body: "Body", field: str) -> None:
    """Raise SceneError if a body is not either a solid or of springs; `field` is what its fields begin with."""
    for name, other in (("mesh", "material"), ("material", "mesh")):
        if getattr(body, other) and not getattr(body, name):
            raise SceneError(f"field {field}{name} is missing: a solid has mesh and material")
    if not (body.mesh or body.springs):
        raise SceneError(f"field {field}mesh is missing: a body has mesh and material, or springs")
    if body.mesh and body.springs:
        raise SceneError(f"{field}mesh and {field}springs exclude each other: they are two bodies")
    for name in ("region", "servos", "effector"):
        if getattr(body, name) and not body.mesh:
            raise SceneError(f"{field}{name} needs {field}mesh: it is of a solid")


MADE_OF = {"servos": servo_tables, "effector": discs_of}
"""What a scene has also by tables of its bodies."""

NEEDS = (
    ("damping", "inertia", "without velocity there is nothing to damp"),
    ("clamp", "servos", "it is the bedding of the strips on their arms"),
    ("servo_dynamics", "servos", "without them there is nothing that turns"),
    ("maze", "effector", "it is fastened to the disc"),
    ("ball", "gravity", "without it the ball would never touch anything"),
    ("initial_velocity", "inertia", "without it nothing has a velocity"),
    ("sleep", "inertia", "without velocity every step is at rest"),
    ("time_error", "inertia", "at rest no time passes that steps could divide"),
    ("mesh_error", "effector", "it is the error of its position"),
    (
        "mesh_error",
        "clamp",
        "at the edge of an ideal clamp the stress is singular, so that no mesh tells the error",
    ),
)
"""An effect, the one that it needs, and why."""


def check_needs(scene: "Scene") -> None:
    """Raise SceneError if an effect lacks another that it needs."""
    for name, other, why in NEEDS:
        there = MADE_OF[other](scene) if other in MADE_OF else getattr(scene, other)
        if getattr(scene, name) and not there:
            raise SceneError(f"{name} needs {other}: {why}")


def check_holds(scene: "Scene") -> None:
    """Raise SceneError if nothing holds a body at rest."""
    nets = any(body.springs and body.springs.holds for body in soft_bodies(scene))
    held = servo_tables(scene) or scene.fixed or scene.prescribed or nets
    if not (scene.inertia or held):
        raise SceneError(
            "nothing holds the body (no servos, nothing fixed), so its translation and rotation are free and it has "
            "no static equilibrium; add [inertia] or hold it"
        )


def check_sets(scene: "Scene") -> None:
    """Raise SceneError if sets are described wrongly."""
    names = [table.name for table in scene.set]
    for i, table in enumerate(scene.set):
        if not table.name or table.name == "all" or table.name in names[:i]:
            raise SceneError(
                f"set.{i}.name is {shown(table.name)}; it must be a name of its own, other than 'all', the set of all "
                "nodes"
            )
        _check_box(f"set.{i}", table.low, table.high)
        places = [name for name in ("at", "beyond", "below") if getattr(table, name) is not None]
        if (table.along is None) != (not places):
            raise SceneError(f"set.{i}: along goes with at, beyond or below, and these with along")
        if table.axis is not None and table.radius is None:
            raise SceneError(f"set.{i}: axis goes with radius: the nodes within it of the axis")
        for name in ("axis", "along"):
            if (direction := getattr(table, name)) is not None and not any(direction):
                raise SceneError(f"set.{i}.{name} is {direction}; a direction is not zero")


def check_held(scene: "Scene") -> None:
    """Raise SceneError if fixed regions or prescribed motions are described wrongly."""
    for i, fixed in enumerate(scene.fixed):
        box = fixed.low is not None and fixed.high is not None
        if (fixed.low is not None or fixed.high is not None) if fixed.set else not box:
            raise SceneError(f"fixed.{i}: give either set or low and high, the corners of a box")
        _check_box(f"fixed.{i}", fixed.low, fixed.high)
        _check_axes(f"fixed.{i}", fixed.axes)
    for i, moved in enumerate(scene.prescribed):
        _check_axes(f"prescribed.{i}", moved.axes)
        if not (moved.move or moved.turn):
            raise SceneError(f"prescribed.{i}: give move or turn; what never moves is [[fixed]]")
        for name, unit in (("move", "m"), ("turn", "rad")):
            if text := getattr(moved, name):
                line = parse_timeline(text, 3, f"prescribed.{i}.{name}", unit)
                if line.at(0.0).any():
                    raise SceneError(
                        f"prescribed.{i}.{name} is {line.at(0.0).tolist()} at 0 s; the body starts undeformed: begin "
                        "with '0: 0,0,0;'"
                    )


def check_servo(scene: "Scene") -> None:
    """Raise SceneError if the servos that have tables are others than those that the scene has."""
    if not scene.servo:
        return
    if not scene.servos or scene.servos.count != len(scene.servo):
        has = f"servos.count is {scene.servos.count}" if scene.servos else "there is no [servos]"
        raise SceneError(f"there are {len(scene.servo)} [[servo]], but {has}; the two must agree")
    for i, servo in enumerate(scene.servo):
        for name in ("axis", "inward"):
            if (direction := getattr(servo, name)) is not None and not any(direction):
                raise SceneError(f"servo.{i}.{name} is {direction}; a direction is not zero")


def check_platform(scene: "Scene") -> None:
    """Raise SceneError if platforms are described wrongly, or are with what knows nothing of them."""
    explicit = scene.inertia is not None and scene.inertia.scheme in EXPLICIT
    beside = {"contact": scene.contact, "ball": scene.ball, "an explicit inertia.scheme": explicit}
    for i, platform in enumerate(scene.platform):
        if not platform.hold:
            raise SceneError(
                f"platform.{i}.hold is empty; it must name a set for each place at which it holds one"
            )
        if not any(body.mesh for body in soft_bodies(scene)):
            raise SceneError("platform needs a solid (mesh and material): it holds sets of its nodes")
        for name, there in beside.items():
            if there:
                raise SceneError(f"platform and {name} exclude each other: leave one out")


def check_loads(scene: "Scene") -> None:
    """Raise SceneError if loads are described wrongly."""
    for i, load in enumerate(scene.load):
        given = [name for name in ("force", "pressure", "mass") if getattr(load, name) is not None]
        if len(given) != 1:
            raise SceneError(
                f"load.{i} has {' and '.join(given) or 'none of them'}; give one of force, pressure, mass"
            )
        if load.mass is not None and not (scene.gravity or scene.inertia):
            raise SceneError(f"load.{i}.mass needs gravity or inertia: without them it does nothing")


def _check_box(where: str, low: "Vector | None", high: "Vector | None") -> None:
    if low is not None and high is not None and not all(a <= b for a, b in zip(low, high, strict=True)):
        raise SceneError(f"{where}: low {low} must not exceed high {high} [m]")


def _check_axes(where: str, axes: str) -> None:
    if not axes or sorted(set(axes) & set("xyz")) != sorted(axes):
        raise SceneError(f"{where}.axes is {shown(axes)}; allowed: one or more of x, y, z")


def check_solid(scene: "Scene") -> None:
    """Raise SceneError if what only solids have is asked of springs or rigid bodies, or with what it cannot go with."""
    for name in ("prescribed", "load"):
        if getattr(scene, name) and (springs_alone(scene) or not soft_bodies(scene)):
            raise SceneError(f"{name} needs a solid (mesh and material)")
    single = [f"fixed.{i}" for i, fixed in enumerate(scene.fixed) if len(fixed.axes) < len("xyz")]
    if single and springs_alone(scene):
        raise SceneError(f"{single[0]}.axes: springs are held along all axes; leave it out")
    for name in ("set", "initial_velocity", "marker"):
        if getattr(scene, name) and not soft_bodies(scene):
            raise SceneError(
                f"{name} needs a soft body (mesh and material, or springs): rigid bodies have no nodes"
            )


def check_rigid(scene: "Scene") -> None:
    """Raise SceneError if rigid bodies or obstacles are described wrongly, or lack what they need."""
    for i, body in enumerate(scene.rigid):
        named = "." in body.source
        if body.shape == "surface" and not named:
            raise SceneError(
                f"rigid.{i}.source is {shown(body.source)}; for shape 'surface' allowed: the path of an OBJ or STL file"
            )
        if body.shape != "surface" and body.source:
            raise SceneError(
                f"rigid.{i}.source is {shown(body.source)}, but rigid.{i}.shape is {body.shape!r}; leave it out, or "
                "choose shape 'surface'"
            )
    turned = [("rigid", i, body.orientation) for i, body in enumerate(scene.rigid)]
    turned += [("obstacles", i, obstacle.orientation) for i, obstacle in enumerate(scene.obstacles)]
    turned += [("body", i, body.orientation) for i, body in enumerate(scene.body)]
    for name, i, orientation in turned:
        size = sum(c * c for c in orientation) ** 0.5
        if not abs(size - 1) <= 0.01:
            raise SceneError(
                f"{name}.{i}.orientation is {orientation}, of norm {size:.4g}; it must be a unit quaternion x, y, z, "
                "w; divide it by its norm"
            )
    if scene.rigid and not scene.contact:
        raise SceneError("rigid needs contact: without it nothing touches the bodies; add [contact]")
    if soft_bodies(scene):
        return
    for name in ("damping", "fixed", "servos", "effector"):
        if getattr(scene, name):
            raise SceneError(
                f"{name} needs a soft body (mesh and material, or springs): rigid bodies have none"
            )


def check_contact(scene: "Scene") -> None:
    """Raise SceneError if contact lacks what it needs."""
    contact = scene.contact
    if not contact:
        if scene.obstacles:
            raise SceneError("obstacles need contact: without it nothing touches them; add [contact]")
        return
    if scene.inertia and scene.inertia.scheme in EXPLICIT:
        raise SceneError(
            f"inertia.scheme is {scene.inertia.scheme!r}, whose steps solve nothing, while contact forces follow from "
            "where a step ends; allowed with contact: implicit_euler, bdf2, tr_bdf2"
        )
    bodies = rigids_of(scene)
    if bodies and not scene.inertia:
        raise SceneError(
            f"{'rigid' if scene.rigid else 'ball beside contact'} needs inertia: nothing holds the bodies but what "
            "they happen to lie on, so where they rest is not determined; add [inertia], or make "
            "what stands still one of the [[obstacles]]"
        )
    soft = len(soft_bodies(scene))
    if contact.self_contact and not soft:
        raise SceneError("contact.self_contact needs a soft body: a rigid one does not touch itself")
    if not (scene.obstacles or contact.self_contact or len(bodies) + soft > 1):
        raise SceneError(
            "contact has nothing to touch: add [[obstacles]], [[rigid]] or contact.self_contact = true"
        )
    if not contact.alarm_distance > contact.contact_distance:
        raise SceneError(
            f"contact.alarm_distance is {contact.alarm_distance:g} m; it must be above contact.contact_distance, "
            f"{contact.contact_distance:g} m"
        )


def halves(scene: "Scene") -> bool:
    """Return whether steps of half the length tell the error of the time steps (see `integrators.doubling`)."""
    explicit = scene.inertia is not None and scene.inertia.scheme in EXPLICIT
    return explicit or scene.contact is not None or scene.strain_limit is not None


def by_way(scene: "Scene") -> bool:
    """Return whether steps are chosen by what they err over their way (see `integrators.way_steps`)."""
    wanted = scene.time_error
    if not (wanted and scene.inertia and wanted.steps == "auto"):
        return False
    return wanted.accuracy > 0 or (halves(scene) and scene.inertia.scheme not in EXPLICIT)


def carried(scene: "Scene") -> "TimeError | None":
    """Return what a scene asks of the error of the time steps where the scheme itself carries that along."""
    return None if halves(scene) or by_way(scene) else scene.time_error


def check_time_error(scene: "Scene") -> None:
    """Raise SceneError if the estimate of the error of the time steps lacks what it needs."""
    wanted = scene.time_error
    if not wanted:
        return
    chosen = wanted.steps == "auto" and scene.inertia is not None and scene.inertia.scheme == "auto"
    if wanted.accuracy and wanted.steps == "fixed":
        raise SceneError(
            f"time_error.accuracy is {wanted.accuracy:g}, but steps of a fixed dt do not follow it; set dt = "
            "'auto', or leave it out"
        )
    explicit = springs_alone(scene) and chosen and not (halves(scene) or by_way(scene))
    if wanted.estimate == "local" and wanted.steps == "fixed":
        raise SceneError(
            "time_error.estimate is 'local', but steps of a fixed dt are not chosen by it; set dt = 'auto', or "
            "time_error.estimate to auto or global"
        )
    if explicit and wanted.estimate == "global":
        raise SceneError(
            "time_error.estimate is 'global', but the explicit steps of springs that dt = 'auto' takes by itself carry "
            "no error along; name an implicit inertia.scheme, such as tr_bdf2, or set time_error.estimate to auto"
        )
    if halves(scene) and wanted.steps == "auto" and wanted.estimate == "global":
        raise SceneError(
            "time_error.estimate is 'global', but with contact, strain_limit or an explicit scheme dt = 'auto' carries "
            "none along; "
            "name a dt, or set time_error.estimate to auto"
        )
    if wanted.steps == "auto" and wanted.shortest > scene.dt:
        raise SceneError(
            f"time_error.shortest is {wanted.shortest:g} s; it must be at most dt, {scene.dt:g} s, which it divides"
        )


SLIP = 2.4e-3
"""Least length sqrt(G / clamp.stiffness) over which a strip slips in its clamp for the error of the mesh to be told
[m], about half the thickness of the Tripod's sheet: at 2.5 mm 95 % of poses are told right, at 1.2 mm 73 %."""


def check_mesh_error(scene: "Scene") -> None:
    """Raise SceneError if the error of the mesh is asked for where nothing tells it."""
    if not scene.mesh_error:
        return
    bodies, discs = soft_bodies(scene), discs_of(scene)
    if not bodies[0].material or discs[0][2].name != bodies[0].name:
        raise SceneError(
            f"mesh_error is that of the first body, whose strips the clamp beds; the effector is {discs[0][0]}: let "
            "that body be the first"
        )
    if scene.platform:
        raise SceneError(
            "mesh_error and platform exclude each other: bodies that a platform joins err together, so that what one "
            "of them gets wrong says nothing of the platform"
        )
    if scene.clamp:
        material, stiffness = bodies[0].material, scene.clamp.stiffness
        shear = material.young / (2 + 2 * material.poisson)
        if stiffness > shear / SLIP**2:
            raise SceneError(
                f"mesh_error: clamp.stiffness is {stiffness:g} N/m⁴, by which strips of this material slip over "
                f"{1e3 * (shear / stiffness) ** 0.5:.2g} mm; below {1e3 * SLIP:g} mm fine meshes crease at the edge, "
                f"so that none tells the error: set it to at most {shear / SLIP**2:.2g}"
            )


def check_start(scene: "Scene") -> None:
    """Raise SceneError if the servos start out of their limits."""
    tables = servo_tables(scene)
    for field, s, body in tables:
        if len(s.angles) != s.count:
            raise SceneError(
                f"{field}.angles has {len(s.angles)} values; it needs {s.count}, one for each servo"
            )
        for i, angle in enumerate(s.angles):
            if not s.angle_min <= angle <= s.angle_max:
                raise SceneError(
                    f"{field}.angles.{i} is {angle} rad; allowed is {s.angle_min} to {s.angle_max} rad"
                )
        if not 0 <= s.slide <= s.slide_max:
            raise SceneError(f"{field}.slide is {s.slide} m; allowed is 0 to {s.slide_max} m")
        if s.slide != tables[0][1].slide:
            raise SceneError(
                f"{field}.slide is {s.slide} m, {tables[0][0]}.slide {tables[0][1].slide} m; all servo bodies slide by "
                "the same"
            )
        if scene.clamp and body.name != soft_bodies(scene)[0].name:
            raise SceneError(f"clamp is of the first body: {field} need ideal clamps; leave clamp out")


CHECKS = (
    check_body,
    check_needs,
    check_holds,
    check_sets,
    check_held,
    check_loads,
    check_servo,
    check_platform,
    check_solid,
    check_start,
    check_rigid,
    check_contact,
    check_time_error,
    check_mesh_error,
)
"""In the order in which they are made."""
