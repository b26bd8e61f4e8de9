"""A scene pays only for what it names: no import, no array, no stage; adding and removing restores the same bits."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest

import tripod_sim
from tests.memory import kept
from tests.messages import assert_names
from tests.scenes import SHARP
from tests.sim.actuator_scenes import beam
from tripod_sim import Simulation, load_scene
from tripod_sim.effects import EFFECTS, absent, meaning, named, words

SOLID = ("silicone", "mesh.level=1")
HOLLOW = beam(Path(mkdtemp(prefix="tripod_hollow_")))
AIR = 'chamber=[{name="air", range=[-1e4, 1e4], start=2e3}]'
CABLE = 'cable=[{name="tendon", via=[{points=[[0.015, 0.0, 0.0], [0.035, 0.0, 0.0]]}], range=[-1.0, 1.0], start=2e-3}]'
ROBOT = (SHARP, "mesh.level=1")
CLOTH = (
    "drape",
    "springs.source=grid",
    "springs.nodes=4",
    "springs.size=0.1",
    "springs.position=[0.01, 0.005, 0.2045]",
    "sleep=off",
)

MOVED = (
    'set=[{name="end", along=[1.0, 0.0, 0.0], below=-0.02}]',
    'prescribed=[{set="end", move="0: 0,0,0; 0.1: 0,0,0.01", axes="xz"}]',
)

SCENES = {
    "bare solid": (*SOLID, "gravity=off", "inertia=off", "damping=off"),
    "free solid": ("silicone_free", "mesh.level=1", "gravity=off"),
    "robot": (*ROBOT, "servo_dynamics={}", "clamp={}", "maze={}", "ball={}"),
    "held solid": SOLID,
    "moved solid": (*SOLID, *MOVED, *words("load"), *words("initial_velocity")),
    "pushed solid": (*SOLID, *words("force")),
    "pulled solid": (*SOLID, *words("cable")),
    "blown beam": (HOLLOW, AIR),
    "bare springs": ("pendulum", "gravity=off", "inertia=off"),
    "limited springs": ("pendulum", "inertia.scheme=implicit_euler", "strain_limit={}"),
    "cloth on a sphere": CLOTH,
    "stack": ("stack",),
    "explicit solid": (*SOLID, "damping=off", "inertia.scheme=semi_implicit_euler"),
    "estimating springs": ("pendulum", "inertia.scheme=bdf2", 'time_error={steps="auto"}'),
    "choosing springs": ("pendulum", "dt=auto"),
    "sleeping solid": (*SOLID, "sleep={}"),
    "doubling springs": ("pendulum", "time_error={}"),
    "estimating robot": (*ROBOT, "mesh.element=h20", 'time_error={steps="auto"}'),
    "stack by its way": ("stack", "dt=auto", "time_error.accuracy=0.05"),
    "bounded robot": (*ROBOT, "clamp.stiffness=1.4e10", "mesh_error={}"),
    "cloth alone": (*CLOTH, "obstacles=off", "contact.self_contact=true"),
}
"""Each is built in an interpreter of its own."""


@dataclass(frozen=True)
class Row:
    """How one effect is shown to cost nothing.

    without, with_: Names of `SCENES`.
    count: Of `simulation`: nothing without the effect, something with it; empty: arrays of the effect's own modules.
    base: A scene without it; the effect changes its motion, or is `silent`.
    """

    without: tuple[str, ...]
    with_: str
    base: tuple[str, ...]
    count: str = ""
    add: tuple[str, ...] = ()
    silent: bool = False


STATIC = ("bare solid", "bare springs")
ROWS = {
    "gravity": Row(STATIC, "robot", (*SOLID, "gravity=off")),
    # springs find their rest by steps with inertia
    "inertia": Row(("bare solid",), "robot", (*SOLID, "inertia=off", "damping=off")),
    "damping": Row(
        ("bare solid", "free solid", "limited springs"), "robot", (*SOLID, "damping=off"),
        "getattr(getattr(simulation._system, 'elastic', None), 'remembers', 0)",
    ),
    "fixed": Row(
        ("free solid", "robot"), "held solid", ("silicone_free", "mesh.level=1"),
        "len(simulation._system.groups.fixed)", ("fixed=[{low=[0.045, -0.02, -0.01], high=[0.06, 0.02, 0.01]}]",),
    ),
    "prescribed": Row(("free solid", "robot"), "moved solid", (*SOLID, MOVED[0]), add=MOVED[1:]),
    "load": Row(("free solid", "robot"), "moved solid", SOLID,
        "sum((t.force[:, 0] > 0).sum() for t in simulation._system.terms if t.name == 'gravity')",  # dead loads too
    ),
    "cable": Row(("free solid", "robot"), "pulled solid", SOLID, add=(CABLE,)),
    "chamber": Row(("free solid", "robot"), "blown beam", (HOLLOW,), add=(AIR,)),
    "force": Row(
        ("free solid", "robot"), "pushed solid", SOLID, "len(simulation._system._actuated)",
        ('force=[{name="push", set="all", direction=[1.0, 0.0, 0.0], range=[-1.0, 1.0], start=0.05}]',),
    ),
    "initial_velocity": Row(("free solid", "robot"), "moved solid", SOLID, "simulation._parts.velocities is not None"),
    "servos": Row(
        ("bare solid", "free solid"), "robot", ("silicone_free", "mesh.level=1"),
        "sum(len(f.nodes) for f in simulation._system.groups.driven) + simulation._system.driven.size",
    ),
    "servo_dynamics": Row(("bare solid", "held solid"), "robot", ROBOT),
    "clamp": Row(("bare solid", "held solid"), "robot", (*ROBOT, "clamp=off"), add=("clamp.stiffness=1.4e10",)),
    "effector": Row(
        ("bare solid", "free solid"), "robot", (*ROBOT, "effector=off"),
        "sum(len(nodes) for nodes in simulation._system.groups.rigid) + simulation.state.centres.size",
    ),
    "strain_limit": Row(
        ("bare springs", "cloth on a sphere", "robot"), "limited springs",
        ("pendulum", "inertia.scheme=implicit_euler", "springs.stiffness=100.0"), add=("strain_limit={stretch=0.001}",),
    ),
    "maze": Row(("bare solid", "held solid", "free solid"), "robot", ROBOT),
    "ball": Row(("bare solid", "held solid", "free solid"), "robot", (*ROBOT, "maze={}")),
    "contact": Row(
        ("bare springs", "limited springs", "robot"), "cloth on a sphere", (*CLOTH, "obstacles=off", "contact=off"),
    ),
    "obstacles": Row(
        ("cloth alone",), "cloth on a sphere", (*CLOTH, "obstacles=off", "contact.self_contact=true"),
        "len(simulation._stepper.integrator.world.positions) - len(simulation.mesh.nodes)",
        ('obstacles=[{source="sphere.obj"}]',),
    ),
    "rigid": Row(
        ("cloth on a sphere", "robot", "bare springs"), "stack", CLOTH,
        add=('rigid=[{shape="ball", radius=0.02, mass=0.01, position=[0.0, 0.0, 0.2285], velocity=[0, 0, -0.5]}]',),
    ),
    "time_error": Row(
        ("robot", "bare solid", "cloth on a sphere"), "estimating robot", ROBOT,
        add=('time_error={steps="auto", tolerance=1e-6}',),
    ),
    "mesh_error": Row(
        ("robot", "bare solid", "estimating robot", "bare springs"), "bounded robot",
        (*ROBOT, "clamp.stiffness=1.4e10"), silent=True,
    ),
    "sleep": Row(
        ("robot", "held solid", "bare springs", "stack"),
        "sleeping solid",
        (*SOLID, "gravity=off"),
        add=("sleep={speed=10.0, time=0.01}",),
    ),
}  # fmt: skip
"""A row for every name of `EFFECTS`."""

LOOK = """
import json, sys
from tripod_sim import Simulation, load_scene
simulation = Simulation(load_scene({name!r}, {words!r}))
simulation.step()
loaded = [m for m in sys.modules if m.startswith("tripod_sim")]
import numpy as np
from tripod_study.explain.objects import walk
from tripod_study.explain.stages import time_stages
from tripod_study.explain.stopwatch import Stopwatch
arrays, objects = [], []
for value, owner in walk(simulation):
    (arrays if isinstance(value, np.ndarray) else objects).append(owner)
counts = {{}}
for name, text in {counts!r}.items():
    try:
        counts[name] = int(eval(text))
    except AttributeError:  # of another kind of body
        counts[name] = 0
watch = Stopwatch("other")
time_stages(simulation, watch)
for k in range(10):
    simulation.step(simulation.command - np.append(np.full(len(simulation.efforts), 0.01), 0.0))
stages = [name for name, calls in zip(watch.stages, watch.calls) if calls]
print(json.dumps(dict(loaded=loaded, arrays=arrays, objects=objects, counts=counts, stages=stages)))
"""


FORKS = """
import json, os, sys, traceback
import numba, numpy, scipy.sparse.linalg  # slow to import, and no effect's own
for code in json.load(sys.stdin):
    child = os.fork()  # as fresh as an interpreter that has imported these
    if not child:
        try:
            exec(code, {})
            sys.stdout.flush()
        except BaseException:
            traceback.print_exc()
            os._exit(1)
        os._exit(0)
    if os.waitpid(child, 0)[1]:
        sys.exit(1)
"""


@pytest.fixture(scope="module")
def looks() -> dict[str, dict]:
    """What a process that has imported nothing of the simulator finds in each of `SCENES` after one step."""
    counts = {name: row.count for name, row in ROWS.items() if row.count}
    codes = [LOOK.format(name=name, words=words, counts=counts) for name, *words in SCENES.values()]
    done = subprocess.run(
        [sys.executable, "-c", FORKS], check=False, input=json.dumps(codes), capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return dict(zip(SCENES, map(json.loads, done.stdout.splitlines()), strict=True))


def belongs(module: str, effect: str) -> bool:
    """Whether a module is one of an effect's own."""
    name = module.removeprefix("tripod_sim.")
    return any(name == m or name.startswith(m + ".") for m in EFFECTS[effect].modules)


def test_every_effect_has_a_row() -> None:
    """Whoever adds an effect says which modules and stages are its own, and shows that it costs nothing when absent."""
    assert set(EFFECTS)
    assert set(ROWS) == set(EFFECTS)


@pytest.mark.parametrize("effect", EFFECTS)
def test_an_absent_effect_is_not_imported_and_has_no_array_and_no_stage(effect: str, looks: dict) -> None:
    row, info = ROWS[effect], EFFECTS[effect]
    for name in row.without:
        assert effect not in named(load_scene(SCENES[name][0], SCENES[name][1:])), name
        look = looks[name]
        for kind in ("loaded", "arrays", "objects"):
            assert not [m for m in look[kind] if belongs(m, effect)], (name, kind)
        assert not [s for s in look["stages"] if s.startswith(info.steps)] or not info.steps, name
        assert look["counts"].get(effect, 0) == 0, name
    assert effect in named(load_scene(SCENES[row.with_][0], SCENES[row.with_][1:]))
    having = [n for n, scene in SCENES.items() if effect in named(load_scene(scene[0], scene[1:]))]
    loaded = {m.removeprefix("tripod_sim.") for n in having for m in looks[n]["loaded"]}
    for module in info.modules:
        assert module in loaded, f"{module} would not be missed"
    look = looks[row.with_]
    assert [s for s in look["stages"] if s.startswith(info.steps)] or not info.steps
    if row.count:
        assert look["counts"][effect] > 0
    else:
        assert [m for m in look["arrays"] if belongs(m, effect)], "no array would be missed"


def test_a_solid_loads_nothing_of_springs_and_has_no_stage_of_them(looks: dict) -> None:
    for name in ("bare solid", "free solid", "held solid", "robot"):
        for kind in ("loaded", "arrays", "objects"):
            assert not [m for m in looks[name][kind] if m.startswith("tripod_sim.springs")], name
        assert "compiled loop" not in looks[name]["stages"]
    assert [m for m in looks["bare springs"]["arrays"] if m.startswith("tripod_sim.springs")]
    assert "compiled loop" in looks["choosing springs"]["stages"]


def motion(source: str, overrides: tuple[str, ...]) -> bytes:
    """State after some steps from a kick, the servos turning if there are any."""
    simulation = Simulation(load_scene(source, overrides))
    state = simulation.state
    if simulation.scene.inertia:
        x = state.positions[:, 0]
        state.velocities[:, 2] = np.where(x < x.mean(), -0.3, 0.0)
        state.velocities[simulation._system.groups.fixed] = 0.0
    for k in range(12):
        joints = simulation.command
        joints[0] = -0.01 * k if len(joints) > 1 else joints[0]
        simulation.step(joints)
    nodes = len(simulation.mesh.nodes)
    return state.positions[:nodes].tobytes() + state.velocities[:nodes].tobytes() + state.joints.tobytes()


@pytest.mark.parametrize("effect", EFFECTS)
def test_adding_and_removing_an_effect_restores_the_same_bits(effect: str) -> None:
    row = ROWS[effect]
    source, base = row.base[0], row.base[1:]
    add = row.add or words(effect)
    undo = (f"{effect}=off",)
    without = motion(source, base)
    assert (motion(source, (*base, *add)) == without) == row.silent, "the effect shows, or is silent"
    assert load_scene(source, (*base, *add, *undo)) == load_scene(source, base)
    assert motion(source, (*base, *add, *undo)) == without


def test_what_effects_a_scene_names() -> None:
    scene = load_scene("tripod")
    assert named(scene) == ["gravity", "inertia", "damping", "servos", "clamp", "effector"]
    assert set(named(scene)) | set(absent(scene)) == set(EFFECTS)
    for effect in EFFECTS:
        assert meaning(effect).endswith("."), effect
    assert_names(meaning("effector"), "rigid disc")


def test_a_steady_step_allocates_no_growing_memory() -> None:
    simulation = Simulation(load_scene(SHARP, ["mesh.level=1"]))
    joints = [np.array([-0.001 * k, 0, 0, 0]) for k in range(60)]
    # a report and a few numbers, no array of the mesh (the smallest has 3,000 bytes a step)
    assert kept(simulation.step, joints) < 4_000


WIND = '''
"""Effect: a wind that pushes all nodes alike."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tripod_sim.effect import Effect, Need
from tripod_sim.forces.term import ForceTerm
from tripod_sim.tables.fields import number


@dataclass(frozen=True)
class Wind:
    """A steady wind.

    Attributes:
        force: On all nodes together [N].
    """

    force: tuple[float, float, float] = number((0.01, 0.0, 0.0), unit="N", low=-1.0, high=1.0)


class Push(ForceTerm):
    name, force = "wind", None

    def __init__(self, force, rest):
        self.force, self._rest = np.tile(np.array(force) / len(rest), (len(rest), 1)), rest

    def add_gradient(self, x, g):
        g -= self.force
        return -float(np.vdot(self.force, x - self._rest))


EFFECT = Effect(
    Wind,
    rank=65,
    needs=(Need("gravity", "air has weight"),),
    stages={"effects.wind.Push": {"add_gradient": "wind"}},
    steps=("wind",),
    act=lambda wind, draft: draft.terms.append(Push(wind.force, draft.rest)),
)
'''

BLOWN = """
import json, sys
import numpy as np
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.effects import absent, meaning, named
from tripod_study.explain.report import explain
def ends(*words):
    simulation = Simulation(load_scene("silicone", ["mesh.level=1", "solver.tolerance=1e-5", *words]))
    for _ in range(10):
        simulation.step()
    return simulation.state.positions.tolist()
def refusal(*words):
    try:
        Simulation(load_scene(words[0], words[1:]))
    except SceneError as error:
        return str(error)
pushed = 'load=[{set="all", force=[0.01, 0.0, 0.0], share="even"}]'
explicit = ("inertia.scheme=semi_implicit_euler", "dt=1e-4", "damping.stiffness=0")
print(json.dumps(dict(
    named=named(load_scene("silicone", ["wind={}"])), absent=absent(load_scene("silicone")), meaning=meaning("wind"),
    still=ends(), blown=ends("wind={}"), loaded=ends(pushed), back=ends("wind={}", "wind=off"),
    explicit=[ends(*explicit, "wind={}"), ends(*explicit, pushed)],
    springs=[type(Simulation(load_scene("pendulum", w))._stepper).__name__
             for w in ((), ("wind={}",))],
    stages=[s.name for s in explain("silicone", ["mesh.level=1", "wind={}"], at=0.0, costs=False).stages],
    refused=[refusal("silicone", "wind.force=[2.0, 0.0, 0.0]"), refusal("silicone", "gravity=off", "wind={}"),
             refusal("stack", "wind={}")],
)))
"""


def test_an_effect_is_one_file(tmp_path: Path) -> None:
    """A file beside the others is an effect of scenes, overrides, messages, schemes and `explain`; nothing lists it."""
    package = Path(tripod_sim.__file__).parent
    for folder, here in (
        (package, tmp_path / "tripod_sim"),
        (package / "effects", tmp_path / "tripod_sim" / "effects"),
    ):
        here.mkdir()
        for entry in folder.iterdir():
            if entry.name not in ("effects", "__pycache__") or (
                entry.name == "__pycache__" and folder == package
            ):
                (here / entry.name).symlink_to(entry)
    (tmp_path / "tripod_sim" / "effects" / "wind.py").write_text(WIND)
    path = os.pathsep.join([str(tmp_path), str(package.parent)])
    done = subprocess.run(
        [sys.executable, "-c", BLOWN],
        check=False,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert "wind" in found["named"] and "wind" in found["absent"]
    assert found["meaning"] == "A steady wind."
    still, blown = np.array(found["still"]), np.array(found["blown"])
    assert np.abs(blown - still).max() > 1e-5
    np.testing.assert_allclose(blown, found["loaded"], rtol=0, atol=1e-12)
    assert found["back"] == found["still"]
    np.testing.assert_allclose(*found["explicit"], rtol=0, atol=1e-12)
    assert found["springs"] == ["ExplicitSprings", "ExplicitSteps"]  # loops that do not know it are not taken
    assert "wind" in found["stages"]
    over, needs, rigid = found["refused"]
    assert_names(over, "wind.force is (2.0, 0.0, 0.0)", "at least -1 N", "at most 1 N")
    assert_names(needs, "wind needs gravity", "air has weight")
    assert_names(rigid, "wind", "soft body")
