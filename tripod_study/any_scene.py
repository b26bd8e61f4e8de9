"""Any scene as it is described: its schemes, steps, elements and refined meshes against the finest that time allows.

The reference is the scene on its mesh refined as often as the budget allows, by the scheme of the highest order that it
takes, in steps of 1/32 of its dt. The mesh of a part is made again, finer or coarser, instead of refined. What the
reference itself may err is told by the same with edges and steps twice as long: where it is large, as in a motion that
no step can follow, the study says so and promises little.
"""

import hashlib
import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

from tripod_sim.errors import SceneError
from tripod_sim.integrators.scheme import ExplicitScheme
from tripod_sim.integrators.schemes import SCHEMES, bdf2, implicit_euler, tr_bdf2
from tripod_sim.mesh.described import described_mesh, element_of
from tripod_sim.mesh.file_format import PARTS, checked_format
from tripod_sim.mesh.part.part import mean_edge
from tripod_sim.scene import Scene
from tripod_sim.scene.file import load_scene, value_of
from tripod_sim.scene.script import script_of
from tripod_sim.simulation import Simulation
from tripod_sim.tables.bodies import Mesh
from tripod_sim.tables.short_forms import contact_of, effector_of, joints_of
from tripod_study import watch
from tripod_study.accuracy.studied import studied
from tripod_study.motion import scene_of
from tripod_study.plan import Plan, Point, Quantity, Settings, Value, always, grid, points_of
from tripod_study.watch import is_soft

LOOKS = 20
"""Instants at which a motion is looked at."""

LONGEST = 1e4
"""Of a motion [s]."""

STEPS, QUICK_STEPS = (2.0, 1.0, 0.5, 0.25, 0.125), (1.0, 0.5)
"""Steps of the points over the scene's dt."""

SHORTEST = 20
"""Steps of the scene that a quick study shortens a motion to, at least."""

FINEST, QUICK_FINEST = 32, 8
"""The scene's dt over the step of the reference; half of it is the other rung."""

BUDGET, QUICK_BUDGET = 600.0, 30.0
"""CPU time that the finest rung may take, as roughly estimated [s]."""

LIMIT = 2400.0
"""Wall time after which a point is given up, on a machine with other things to do, too [s]."""

MESHES = "A finer mesh would take too long: these figures are of the time steps alone, without the error of the mesh."
BODIES = "Meshes of [[body]] are not refined: these figures are of the time steps alone, without the error of the mesh."

LEFT_OUT = "time steps alone, without the error of the mesh: "
"""What errors are of, then: whoever picks a setting by them reads that first."""

SOLVE, GROWTH, TOUCHING, REUSED = 1.2e-6, 1.35, 10.0, 0.2
"""About the time of a step with TR-BDF2 and Newton's method [s]: SOLVE times the unknowns to this power; with contact
TOUCHING times as long; of solids whose Hessian serves many steps REUSED of it."""

FINER, COARSER = (4.0, 2.83, 2.0), (2.0, 1.41)
"""Edges of the mesh of a part over those of finer meshes, and of coarser meshes over those of the part's own mesh."""

FEWER = 0.8
"""Share of the elements that a coarser mesh of a part has at most: small features need as many whatever the size."""

FINE = 1e-7
"""Unbalanced force that the reference is solved to, unless the scene asks for less [N]: rounding is not far below."""

MOST = 60_000
"""Unknowns of the reference: beyond, factors may take more memory than a machine has."""

ELEMENTS = {"h8_modes": ("h20", "h8_mean"), "h8_mean": ("h8_modes",), "h8": ("h8_modes",), "t4": ("t10",)}
"""What is tried instead of an element: those whose corners are its nodes."""

UNSAFE = re.compile(r"[^A-Za-z0-9_-]+")
"""Characters of a scene's name that its study's files do not have."""


@dataclass(frozen=True)
class Subject:
    """A scene to be studied, as a user names it.

    Attributes:
        scene: Name of a shipped scene or path of a scene file.
        overrides: Words `dotted.path=value`.
        servo, slide: As `timeline.joint_timelines` reads them; None: the scene's own motion.
        duration: Of the motion [s]; None: until the servos have moved, else as the scene says.
    """

    scene: str
    overrides: Sequence[str] = ()
    servo: str | None = None
    slide: str | None = None
    duration: float | None = None


def plan(subject: Subject, *, quick: bool) -> Plan:
    """Return the study of a scene; `quick`: few points, against a coarser reference.

    Raises:
        SceneError: anything wrong with the scene, or nothing in it moves.
    """
    shipped = load_scene(subject.scene, subject.overrides)
    script_of(shipped, subject.servo, subject.slide)
    base = dict(map(_given, subject.overrides))
    if subject.servo is not None or subject.slide is not None:
        base["motion.servo"] = subject.servo or _held(shipped)
        if subject.slide is not None or shipped.motion:
            base["motion.slide"] = subject.slide or ""
    if shipped.time_error:
        base |= {"time_error": "off", "dt": shipped.dt}
    made = scene_of(subject.scene, base)
    script = script_of(made)
    _check_moves(made, moved=bool(script))
    duration = subject.duration
    if duration is None:
        duration = script.end if script.end > 0 else made.duration
    if not made.dt <= duration <= LONGEST:
        raise SceneError(
            f"the duration is {duration:g} s; allowed: {made.dt:g} s (one step) to {LONGEST:g} s"
        )
    default = _default(made)
    base = {field: value for field, value in base.items() if field not in default}
    tries = _Tries(subject.scene, {**base, "duration": duration}, made)
    whole = duration
    if quick and subject.duration is None and made.inertia:
        while duration > SHORTEST * made.dt and not _affordable(tries, default, duration):
            duration /= 2
    widest = STEPS[0] * made.dt
    interval = widest * max(1, round(duration / LOOKS / widest))
    samples = max(1, round(duration / interval))
    base["duration"] = interval * samples
    rungs = _rungs(tries, default, interval * samples, quick=quick)
    left_out = _left_out(made, default, rungs[-1])
    quantities = _quantities(made, interval * samples, LEFT_OUT if left_out else "")
    shorter = (
        f"Only the first {interval * samples:.2g} s of the motion ({whole:.3g} s) are studied; leave out --quick for "
        "all of it."
    )
    note = " ".join(filter(None, (shorter if duration < whole else "", left_out)))
    return Plan(
        name=UNSAFE.sub("_", made.name)[:60] + ("" if len(base) == 1 else f"_{_digest(base)}"),
        title=f"{made.name}: {made.description or 'a scene of its own'}",
        scene=made.name,
        module=watch.__name__,
        version=1,
        base=base,
        default=default,
        points=_points(tries, default, rungs[-1], quick=quick),
        quantities=quantities,
        references=(always(rungs),),
        group="inertia.scheme" if "inertia.scheme" in default else next(iter(default)),
        quick=quick,
        order_knob="dt" if made.inertia and not quick else "",
        order_quantity=quantities[0].name,
        limit=LIMIT,
        note=note,
        given=watch.given(
            _place(subject.scene),
            {q.name: [q.name, "with_start"] for q in quantities},  # of one static step, too, how far it goes
            duration=interval * samples,
            interval=interval,
            state=_state(subject.scene),
            size=_part_size(made),
        ),
        studied=studied(load_scene(subject.scene), default),
    )  # fmt: skip


# what is looked at ----------------------------------------------------------------------------------------------------


def _quantities(scene: Scene, duration: float, left_out: str = "") -> tuple[Quantity, ...]:
    """Return what is compared, what matters most first.

    Args:
        scene: As it is.
        duration: Of the motion [s]: of a longer one the errors, which may grow, are not known.
        left_out: Words on errors of the soft body.
    """
    worst = f"the worst instant of {duration:g} s"
    found = [
        Quantity(f"marker {m.set}", "m", f"{left_out}mean position of the set {m.set!r}, {worst}")
        for m in scene.marker
    ]
    if effector_of(scene):
        found.append(Quantity("effector", "m", f"{left_out}position of the effector, {worst}"))
    if scene.ball:
        found.append(Quantity("ball", "m", f"{left_out}position of the ball, {worst}"))
    if is_soft(scene):
        what = f"{left_out}positions of the body's nodes, root mean square, {worst}"
        found.append(Quantity("body", "m", what, measure="rms"))
    if scene.rigid:
        what = f"positions of the rigid bodies, root mean square, {worst}"
        found.append(Quantity("rigid", "m", what, measure="rms"))
    return tuple(found)


def _left_out(scene: Scene, default: Settings, finest: Settings) -> str:
    """Return why what meshes err is not in the figures; empty where it is."""
    if any(body.mesh for body in scene.body):
        return BODIES
    return (
        MESHES if scene.mesh and all(finest[field] == default[field] for field in _mesh_of(default)) else ""
    )


# what is run ----------------------------------------------------------------------------------------------------------


class _Tries:
    """Which settings a scene takes, and about what a step costs with them.

    Attributes:
        made: The scene.
        tolerance: Unbalanced force to which it is solved [N].
        size: Edge length that the scene asks for [m], if the mesh is that of a part; else None.
        edge: Mean edge length of that mesh [m]; else 0.
    """

    def __init__(self, source: str, base: Settings, made: Scene) -> None:
        self._source, self._base, self.made = source, base, made
        simulation = Simulation(made)
        self._unknowns, self.tolerance = simulation.unknowns, simulation.solver.tolerance
        reused = bool(made.mesh) and not (simulation._system.elastic.has_modes or contact_of(made))
        self.size = _part_size(made)
        self.edge = _edge(made.mesh) if made.mesh and self.size else 0.0
        self._share = REUSED if reused else TOUCHING if contact_of(made) else 1.0

    def takes(self, settings: Settings) -> bool:
        """Return whether the scene can be described so."""
        try:
            scene_of(self._source, {**self._base, **settings})
        except SceneError:
            return False
        return True

    def unknowns(self, settings: Settings) -> int:
        """Return about how many there are."""
        if self.size:
            size = settings.get("mesh.size", self.size)
            return (
                self._unknowns
                if size == self.size
                else round(self._unknowns * (self.edge / float(size)) ** 3)
            )
        first = self.made.mesh.refine if self.made.mesh else 0
        return self._unknowns * 8 ** (int(settings.get("mesh.refine", first)) - first)

    def meshes(self) -> list[tuple[Settings, Settings]]:
        """Return settings of ever coarser meshes, down to that of the scene, each with those of twice its edges."""
        mesh = self.made.mesh
        if not mesh:
            return [({}, {})]
        if self.size:
            finer = [(self.edge / f, 2 * self.edge / f if f > 2 else self.size) for f in FINER]
            return [
                ({"mesh.size": _rounded(fine)}, {"mesh.size": _rounded(coarse)})
                for fine, coarse in (*finer, (self.size, self.size))
            ]
        return [
            ({"mesh.refine": k}, {"mesh.refine": max(mesh.refine, k - 1)})
            for k in range(3, mesh.refine - 1, -1)
        ]

    def coarser(self) -> list[Settings]:
        """Return settings of meshes that are coarser than that of the scene: of a part those that have fewer elements.

        It makes these meshes.
        """
        sizes = [_rounded(self.size * factor) for factor in COARSER] if self.size else []
        return [
            {"mesh.size": size} for size in sizes if self._elements(size) < FEWER * self._elements(self.size)
        ]

    def _elements(self, size: float | None) -> float:
        """Return the number of elements of a part with edges of `size` [m], before they are refined."""
        assert self.made.mesh
        try:
            return described_mesh(replace(self.made.mesh, size=size, refine=0)).count
        except SceneError:
            return math.inf

    def cost(self, settings: Settings) -> float:
        """Return about what a step costs [s]. It is not measured: a study that is resumed must be the same one."""
        return float(SOLVE * self.unknowns(settings) ** GROWTH * self._share)


def _part_size(scene: Scene) -> float | None:
    """Return the length of an edge [m] of the mesh that fills a part; None where the mesh is no part's."""
    mesh = scene.mesh
    if not (mesh and mesh.size and "." in mesh.source):
        return None
    return mesh.size if checked_format(Path(mesh.source), "mesh.source") in PARTS else None


def _mesh_of(settings: Settings) -> dict[str, Value]:
    """Return the setting that says how fine the mesh is."""
    return {field: settings[field] for field in ("mesh.refine", "mesh.size") if field in settings}


def _edge(mesh: Mesh) -> float:
    """Return the mean edge [m] of the mesh of a part, before it is refined, at most its size."""
    assert mesh.size
    return min(mesh.size, mean_edge(described_mesh(replace(mesh, refine=0))))


def _rounded(size: float) -> float:
    """Return a size with four digits: enough to be found again by, and short."""
    return float(f"{size:.4g}")


def _default(scene: Scene) -> dict[str, Value]:
    """Return the values of the knobs in the scene."""
    found: dict[str, Value] = {}
    if scene.mesh:
        size = _part_size(scene)
        found |= {"mesh.element": element_of(scene.mesh)}
        found |= {"mesh.size": size} if size else {"mesh.refine": scene.mesh.refine}
    if scene.inertia:
        scheme = scene.inertia.integrator
        found["inertia.scheme"] = (implicit_euler.SCHEME if scheme.is_automatic else scheme).name
    found["dt"] = scene.dt
    if is_soft(scene):
        found["solver.mode"] = scene.solver.mode
    return found


def _affordable(tries: _Tries, default: Settings, duration: float) -> bool:
    """Return whether a quick study can have a reference for so much of the motion [s]."""
    try:
        _rungs(tries, default, duration, quick=True)
    except SceneError:
        return False
    return True


def _rungs(tries: _Tries, default: Settings, duration: float, *, quick: bool) -> tuple[Settings, ...]:
    """Return the settings that converge, coarse to fine."""
    made, budget = tries.made, QUICK_BUDGET if quick else BUDGET
    tolerance = min(tries.tolerance, max(tries.tolerance / 100, FINE))
    fine: dict[str, Value] = {**default, "solver.tolerance": tolerance}
    if "solver.mode" in default:
        fine["solver.mode"] = "newton"
    if made.inertia:
        schemes = (*(s.SCHEME.name for s in (tr_bdf2, bdf2, implicit_euler)), made.inertia.scheme)
        fine["inertia.scheme"] = next(s for s in schemes if tries.takes({**fine, "inertia.scheme": s}))
    most = QUICK_FINEST if quick else FINEST
    for parts in dict.fromkeys((most, 8)):
        steps = duration / made.dt * (parts if made.inertia else 1)
        for mesh, coarser in tries.meshes():
            dt = made.dt / (parts if made.inertia else 1)
            rung = {**fine, "dt": dt, **mesh}
            if steps * tries.cost(rung) > budget or tries.unknowns(rung) > MOST:
                continue
            coarse = {**rung, "dt": 2 * dt if made.inertia else dt, **coarser}
            if coarse == rung:  # statics on the only mesh: what is left is the tolerance
                coarse["solver.tolerance"] = 10 * tolerance
            return (coarse, rung)
    seconds = duration / made.dt * 8 * tries.cost(fine)
    raise SceneError(
        f"a reference of {made.name!r} would take {seconds:.0f} s; at most {budget:g} s are spent on it: shorten the "
        "motion (--duration), coarsen the mesh" + (", or leave out --quick" if quick else "")
    )


def _points(tries: _Tries, default: Settings, finest: Settings, *, quick: bool) -> tuple[Point, ...]:
    """Return what is run: steps and schemes on the scene's mesh, some on finer ones, other elements."""
    made = tries.made
    steps = [made.dt * share for share in (QUICK_STEPS if quick else STEPS)]
    schemes: list[str] = []
    if made.inertia:
        few, more = (implicit_euler, tr_bdf2), (implicit_euler, bdf2, tr_bdf2)
        schemes = [s.SCHEME.name for s in (few if quick else more)]
        if not (made.mesh or quick):
            schemes += [s.name for s in SCHEMES.values() if isinstance(s, ExplicitScheme) and s.is_stable]
        schemes = list(dict.fromkeys([str(default["inertia.scheme"]), *schemes]))
    best = {**default} | ({"inertia.scheme": finest["inertia.scheme"]} if made.inertia else {})
    points = grid(default, **({"inertia__scheme": schemes, "dt": steps} if made.inertia else {"dt": steps}))
    if "solver.mode" in default:
        points += grid(default, solver__mode=("newton", "one_solve"))
    if made.mesh and _mesh_of(finest) != _mesh_of(default):  # else the reference has the error of the mesh
        least, most = tries.unknowns(default), tries.unknowns(finest)
        meshes = [mesh for mesh, _ in reversed(tries.meshes()) if least < tries.unknowns(mesh) < most]
        meshes += tries.coarser()
        for one, mesh in product((default, best), meshes):
            points += grid({**one, **mesh}, dt=steps[:2])
        if not quick:
            points += grid(best, mesh__element=ELEMENTS.get(str(default["mesh.element"]), ()), dt=steps[1:3])
    kept = [p for p in points if tries.takes(p.settings)]
    return points_of(default, kept, "the scene as it is")


def _check_moves(scene: Scene, *, moved: bool) -> None:
    """Raise SceneError if nothing in a scene moves, so that there is nothing to compare."""
    if moved or scene.prescribed or scene.load:
        return
    if not scene.inertia:
        raise SceneError(
            f"scene {scene.name!r} is static and no servo moves, so there is nothing to study; give a "
            "motion with --servo, or [motion] in the scene"
        )
    if joints_of(scene) and not (scene.ball or scene.rigid):
        raise SceneError(
            f"scene {scene.name!r} starts at rest and no servo moves, so there is nothing to study; give "
            "a motion with --servo, or [motion] in the scene"
        )


# names ----------------------------------------------------------------------------------------------------------------


def _held(scene: Scene) -> str:
    """Return the servo script that leaves the angles of the scene."""
    joints = joints_of(scene)
    if not joints:
        raise SceneError(f"--slide: scene {scene.name!r} has no servos; leave it out")
    return "0: " + ", ".join(f"{arm.angle!r}" for arm in joints.arms)


def _given(word: str) -> tuple[str, Value]:
    """Return field and value of an override; of what is no number or word its text."""
    field, _, text = (part.strip() for part in word.partition("="))
    value = value_of(text)
    return field, value if isinstance(value, str | float | int) else text


def _place(source: str) -> str:
    """Return the source so that a process elsewhere finds it."""
    return str(Path(source).absolute()) if source.endswith(".toml") else source


def _state(source: str) -> str:
    """Return a digest of the scene and of the files it names."""
    scene = load_scene(source)
    return hashlib.sha256((repr(scene) + studied(scene, ())).encode()).hexdigest()[:16]


def _digest(base: Settings) -> str:
    return hashlib.sha256(json.dumps(dict(base), sort_keys=True).encode()).hexdigest()[:6]
