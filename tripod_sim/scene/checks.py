"""What the bodies of a scene must be, and what its tables must agree on; each effect checks its own beside that.

Each check raises SceneError with one line.
"""

from tripod_sim.effect import Effect
from tripod_sim.effects import has
from tripod_sim.errors import SceneError, shown
from tripod_sim.tables.bodies import Body, Material
from tripod_sim.tables.fields import Described, check_box, check_unit
from tripod_sim.tables.materials import check
from tripod_sim.tables.short_forms import field_of, rigids_of, servo_tables, soft_bodies


def check_bodies(scene: Described) -> None:
    """Raise SceneError if a body is neither a solid nor of springs, or if one lacks a name of its own."""
    bodies = soft_bodies(scene)
    if not (bodies or rigids_of(scene)):
        raise SceneError(
            "field mesh is missing: a scene needs [mesh] and [material], or [springs], [[body]] or [[rigid]]"
        )
    names = [body.name for body in bodies]
    for k, body in enumerate(bodies):
        field = field_of(scene, k)
        if field and (not body.name or body.name == "all" or body.name in names[:k]):
            raise SceneError(
                f"{field}name is {shown(body.name)}; it must differ from 'all' and from the names of the "
                "other bodies"
            )
        if (like := getattr(body, "like", "")) and (
            like not in names[:k] or not bodies[names.index(like)].mesh
        ):
            solids = ", ".join(shown(other.name) for other in bodies[:k] if other.mesh)
            raise SceneError(
                f"{field}like is {shown(like)}; it must be the name of a solid that comes before: "
                f"{solids or 'there is none'}"
            )
        if like and (scene.body[k - len(bodies)].mesh or scene.body[k - len(bodies)].material):
            raise SceneError(
                f"{field}like and {field}mesh, {field}material exclude each other: leave one out"
            )
        _check_kind(body, field)
        _check_materials(body, field)
    if scene.region and not scene.mesh:
        raise SceneError(
            "region needs mesh: a region is a part of a solid; add [mesh] and [material], or leave it out"
        )
    if scene.tie and len(bodies) < 2:
        raise SceneError("tie needs two soft bodies, whose nodes it joins; add a [[body]], or leave it out")
    for name in ("servos", "effector"):
        if getattr(scene, name) and bodies and not bodies[0].mesh:
            raise SceneError(
                f"{name} needs a solid as the first body; hold springs with springs.fixed_nodes, "
                "springs.fixed_corners or [[fixed]]"
            )
        if getattr(scene, name) and bodies and getattr(bodies[0], name):
            raise SceneError(
                f"{name} and {field_of(scene, 0)}{name} both belong to the first body; leave one out"
            )


def _check_kind(body: Body, field: str) -> None:
    """Raise SceneError if a body is not either a solid or of springs; `field` is what its fields begin with."""
    for name, other in (("mesh", "material"), ("material", "mesh")):
        if getattr(body, other) and not getattr(body, name):
            raise SceneError(f"field {field}{name} is missing: a solid has mesh and material")
    if not (body.mesh or body.springs):
        raise SceneError(f"field {field}mesh is missing: a body has mesh and material, or springs")
    if body.mesh and body.springs:
        raise SceneError(
            f"{field}mesh and {field}springs exclude each other in one body; leave one out or make two "
            "[[body]]"
        )
    for name in ("region", "servos", "effector"):
        if getattr(body, name) and not body.mesh:
            raise SceneError(
                f"{field}{name} needs {field}mesh, as only a solid has it; add a mesh or leave it out"
            )


def _check_materials(body: Body, field: str) -> None:
    """Raise SceneError if a material or region gives what its law does not take, or lacks what it does."""
    for name, table in (
        ("material", body.material),
        *((f"region.{i}", r) for i, r in enumerate(body.region)),
    ):
        if table and (table.parameters or table.law != Material.law):
            check(table, f"{field}{name}")


def check_needs(scene: Described, name: str, effect: Effect) -> None:
    """Raise SceneError if an effect lacks another that it needs."""
    for other, why in effect.needs:
        if not has(scene, other):
            raise SceneError(f"{name} needs {other}: {why}")


def check_held(scene: Described) -> None:
    """Raise SceneError if nothing holds a body at rest."""
    nets = any(body.springs and body.springs.holds for body in soft_bodies(scene))
    held = servo_tables(scene) or scene.fixed or scene.prescribed or nets
    if not (scene.inertia or held):
        raise SceneError(
            "nothing holds the body (no servos, nothing fixed), so it can move as a whole and has no "
            "static equilibrium; add [inertia], or hold it with [[fixed]] or [servos]"
        )


def _check_sets(scene: Described) -> None:
    """Raise SceneError if sets are described wrongly."""
    for i, table in enumerate(scene.set):
        check_box(f"set.{i}", table.low, table.high)
        places = [name for name in ("at", "beyond", "below") if getattr(table, name) is not None]
        if (table.along is None) != (not places):
            raise SceneError(
                f"set.{i}: along needs at, beyond or below, and each of these needs along; add what is missing"
            )
        for name in ("axis", "centre"):
            if getattr(table, name) is not None and table.radius is None:
                raise SceneError(
                    f"set.{i}: {name} needs radius: the set is the nodes within that distance of the {name}; add "
                    "radius"
                )
        for name in ("axis", "along"):
            if (direction := getattr(table, name)) is not None and not any(direction):
                raise SceneError(
                    f"set.{i}.{name} is {direction}; a direction cannot be zero, give one such as [0, 0, 1]"
                )


def _check_servo(scene: Described) -> None:
    """Raise SceneError if the servos that have tables are others than those that the scene has."""
    if not scene.servo:
        return
    if not scene.servos or scene.servos.count != len(scene.servo):
        has = f"servos.count is {scene.servos.count}" if scene.servos else "there is no [servos]"
        raise SceneError(
            f"there are {len(scene.servo)} [[servo]], but {has}; set servos.count to the number of "
            "[[servo]] tables"
        )
    for i, servo in enumerate(scene.servo):
        for name in ("axis", "inward"):
            if (direction := getattr(servo, name)) is not None and not any(direction):
                raise SceneError(
                    f"servo.{i}.{name} is {direction}; a direction cannot be zero, give one such as [0, 1, 0]"
                )


def _check_platform(scene: Described) -> None:
    """Raise SceneError if platforms are described wrongly, or are with what knows nothing of them."""
    explicit = scene.inertia is not None and scene.inertia.explicit
    beside = {"contact": scene.contact, "ball": scene.ball, "an explicit inertia.scheme": explicit}
    for i, platform in enumerate(scene.platform):
        if not platform.hold:
            raise SceneError(
                f"platform.{i}.hold is empty; name a set of nodes for each place where the platform holds a "
                "body"
            )
        if not any(body.mesh for body in soft_bodies(scene)):
            raise SceneError(
                "platform needs a solid (mesh and material), whose nodes it holds; add one, or leave "
                "platform out"
            )
        for name, there in beside.items():
            if there:
                raise SceneError(f"platform and {name} cannot be combined; leave one out")


def check_tables(scene: Described) -> None:
    """Raise SceneError if sets, servos or platforms are described wrongly, or soft bodies are missing."""
    _check_sets(scene)
    _check_servo(scene)
    _check_platform(scene)
    for i, body in enumerate(scene.body):
        check_unit(f"body.{i}.orientation", body.orientation)
    if soft_bodies(scene):
        return
    tables = [name for name in ("set", "marker") if getattr(scene, name)]
    for name in (*(name for name, effect in scene.effects.items() if not effect.rigid), *tables):
        raise SceneError(
            f"{name} needs a soft body: [mesh] and [material], or [springs]; the scene has only rigid bodies"
        )
