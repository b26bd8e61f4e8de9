"""A weight that is put on the disc of a running robot is told by how far it sags."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from tests.ik.plant import SpringRobot
from tests.messages import raises_naming
from tests.scenes import SHARP
from tripod_ik.errors import IkError
from tripod_ik.feedback import ModelError
from tripod_ik.load import Load, LoadObserver
from tripod_ik.model import StaticModel
from tripod_ik.settings import PARAMETERS, load_observer
from tripod_sim import load_scene
from tripod_sim.simulation import Simulation
from tripod_sim.tables.sets import Load as SceneLoad
from tripod_sim.tables.sets import NodeSet

DT, DELAY, NOISE = 0.01, 0.03, (5e-5, 1e-3)  # [s], [m, rad] of each measurement
WEIGHT, PLACED = 0.02, 1.0  # [kg], [s]
SCENE = ["mesh.level=1", "mesh.element=h8_modes", "clamp=off"]
DISC = NodeSet("disc", axis=(0.0, 0.0, 1.0), radius=0.0075)
ON_IT = SceneLoad("disc", mass=WEIGHT, share="even")
OFF = np.radians([1.0, -1.0, 0.5])  # of the servos: the tare takes it


class Running:
    """A Tripod that moves in time, its servos a little to and fro; from `PLACED` on it has a weight on its disc."""

    def __init__(
        self, angles: np.ndarray, off: np.ndarray, load: SceneLoad = ON_IT, disc: NodeSet = DISC
    ) -> None:
        scene = load_scene(SHARP, SCENE)
        loaded = replace(scene, set=(disc,), load=(load,))
        model = StaticModel(scene, 0.035, angles)  # 4 % stiffer than the robot
        self.rows = []
        rng, robot = np.random.default_rng(7), Simulation(scene)
        robot_at = np.append(angles + off, 0.035)
        for part in np.linspace(0, 1, 200)[1:]:
            robot.step(robot.command + part * (robot_at - robot.command))
        for _ in range(100):
            robot.step(robot_at)
        for k in range(round(1.6 / DT)):
            if k == round(PLACED / DT):
                before, robot = robot.state, Simulation(loaded)
                robot.step(robot_at)
                before.copy_to(robot.state)
            goal = robot_at.copy()
            goal[:3] += 0.02 * np.sin(2 * np.pi * 0.5 * k * DT)
            for _ in range(round(DT / scene.dt)):
                robot.step(goal)
            pose, here = robot.effector, model.move(goal[:3] - off)
            place = pose.position + NOISE[0] * rng.standard_normal(3)
            normal = robot.state.rotations[0][:, 2] + NOISE[1] * rng.standard_normal(3)
            self.rows.append((k * DT, here, place, normal / np.linalg.norm(normal)))

    def loads(self, *, imu: bool = False) -> dict[float, Load]:
        """What is told at each time [s]."""
        observer, found = LoadObserver(DELAY), {}
        late = round(DELAY / DT)
        for k, (now, state, _, _) in enumerate(self.rows):
            observer.predict(state, now)
            if k >= late:
                _, _, place, normal = self.rows[k - late]
                observer.measure(None if imu else place, normal, now)
            found[round(now, 3)] = observer.load
        return found


@pytest.fixture(scope="module")
def working() -> Running:
    return Running(np.full(3, -1.4965), OFF)


@pytest.fixture(scope="module")
def tipped() -> Running:
    return Running(np.array([-1.2, -1.4, -0.9]), np.zeros(3))


@pytest.mark.parametrize(
    ("pose", "imu", "within"), [("working", False, 0.05), ("tipped", False, 0.05), ("tipped", True, 0.1)]
)
def test_a_weight_is_told_within_half_a_second(
    pose: str, imu: bool, within: float, request: pytest.FixtureRequest
) -> None:
    loads = request.getfixturevalue(pose).loads(imu=imu)
    assert np.isnan(loads[0.3].force), "no tare yet"
    before, after = loads[0.99], loads[round(PLACED + 0.5 + DELAY, 3)]
    assert abs(before.force) < 0.05 * WEIGHT * 9.81
    assert after.force == pytest.approx(WEIGHT * 9.81, rel=within)
    assert 0 < after.half < 0.1 * WEIGHT * 9.81


def test_a_level_disc_tells_an_imu_nothing_of_a_weight_in_its_middle(working: Running) -> None:
    last = working.loads(imu=True)[1.59]
    assert np.isnan(last.force) or last.half > WEIGHT * 9.81


def test_a_push_from_below_is_a_negative_load() -> None:
    push = SceneLoad("disc", force=(0.0, 0.0, 0.1), share="even")
    last = Running(np.full(3, -1.4965), OFF, push).loads()[1.59]
    assert last.force == pytest.approx(-0.1, rel=0.05)
    assert last.sure == pytest.approx(last.force, rel=0.02)


@pytest.mark.parametrize("pose", [[-1.4965, -1.4965, -1.4965], [-1.2, -1.4, -0.9]], ids=["working", "tipped"])
def test_a_push_from_the_side_is_told_as_one_and_not_borne(pose: list[float]) -> None:
    force = (0.12, -0.05, 0.02)
    push = SceneLoad("disc", force=force, share="even")
    loads = Running(np.array(pose), np.zeros(3), push).loads()
    last = loads[round(PLACED + 0.5 + DELAY, 3)]
    closely = 3 * NOISE[0] * np.sqrt(2 / 40) / 0.83e-3  # what errors of 40 places, and of the tare, make [N]
    assert (*last.push, -last.force) == pytest.approx(force, abs=closely)
    assert last.sure == 0.0
    assert not any(any(load.push) for now, load in loads.items() if now < PLACED)


def test_a_weight_beside_the_middle_is_no_push(tipped: Running, working: Running) -> None:
    for running in (tipped, working):
        assert not any(any(load.push) for load in running.loads().values())
    edge = NodeSet("disc", axis=(0.0, 0.0, 1.0), radius=0.0075, beyond=0.004, along=(0.0, 1.0, 0.0))
    heavy = SceneLoad("disc", mass=0.06, share="even")
    last = Running(np.array([-1.2, -1.4, -0.9]), np.zeros(3), heavy, edge).loads()[1.59]
    assert last.push == (0.0, 0.0)
    assert last.force == pytest.approx(0.06 * 9.81, rel=0.25), "it is off the middle"


@pytest.mark.parametrize(("sideways", "contact"), [(0.25, False), (0.35, True)])
def test_a_force_is_no_weight_from_three_tenths_sideways_on(sideways: float, contact: bool) -> None:
    state, observer = SpringRobot(slide=0.035).state(np.array([-1.2, -1.4, -0.9])), LoadObserver(0.0)
    force = np.array([0.0, sideways, -np.sqrt(1 - sideways**2)])
    moved = (state.W[:3, :3] - state.jacobian[:3] @ state.W[6:, :3]) @ force
    rng = np.random.default_rng(1)
    for k in range(160):
        observer.predict(state, k * DT)
        place = state.equilibrium + moved * (k >= 80) + 1e-7 * rng.standard_normal(3)
        observer.measure(place, state.equilibrium_rotation[:, 2], k * DT)
    assert observer.load.push == pytest.approx((0.0, sideways * contact), abs=1e-3)
    if contact:
        assert observer.load.force == pytest.approx(-force[2], rel=1e-3)


def test_what_may_be_nothing_counts_as_nothing() -> None:
    assert Load(0.01, 0.02).sure == Load(-0.01, 0.02).sure == Load(0.02, 0.02).sure == 0.0
    assert Load(-0.2, 0.02).sure == pytest.approx(-0.198)


def test_the_loaded_model_rests_where_a_heavier_robot_does_and_its_servos_bear_as_much() -> None:
    angles, mass = np.array([-1.2, -1.4, -0.9]), 0.002
    plain, heavy = SpringRobot(slide=0.035), SpringRobot(slide=0.035, m=SpringRobot().m + mass)
    observer = Told(mass * 9.81)
    before, real = plain.state(angles), heavy.state(angles)
    found = observer.loaded(before)
    for name in ("equilibrium", "efforts"):
        change = getattr(real, name) - getattr(before, name)
        assert getattr(found, name) - getattr(before, name) == pytest.approx(
            change, abs=0.03 * np.linalg.norm(change)
        )


class Told(LoadObserver):
    """An observer that has been told the load."""

    def __init__(self, force: float) -> None:
        super().__init__()
        self.known = Load(force, 0.0)

    @property
    def load(self) -> Load:
        return self.known


def test_a_load_moves_nothing_when_it_is_told_and_is_there_already_in_another_pose() -> None:
    mass, first, then = 0.01, np.full(3, -1.4), np.array([-0.9, -1.3, -1.1])
    model, robot = SpringRobot(slide=0.035), SpringRobot(slide=0.035, m=SpringRobot().m + mass)
    up = np.array([0.0, 0.0, 1.0])

    def left(*, used: bool) -> float:
        """Return how wrong the corrected model is just after the robot has moved [m]."""
        observer, correction = Told(0.0), ModelError(time=0.1, delay=0.0)
        for k in range(200):
            if k == 100:
                before = observer.loaded(model.state(first), correction).equilibrium + correction.shift
                observer.known = Load(used * mass * 9.81, 0.0)
            state = observer.loaded(model.state(first), correction)
            if k == 100:
                assert state.equilibrium + correction.shift == pytest.approx(before, abs=1e-12)
            correction.predict(state.equilibrium, up, 0.01 * k)
            correction.measure(robot.rest(first), up, 0.01 * k)
        there = observer.loaded(model.state(then), correction).equilibrium + correction.shift
        return float(np.linalg.norm(there - robot.rest(then)))

    assert left(used=True) < 0.3 * left(used=False)


def test_nothing_is_loaded_where_nobody_asks() -> None:
    code = (
        "import sys, tripod_ik.node\n"
        "from tripod_ik.settings import PARAMETERS, load_observer\n"
        "from tripod_sim import load_scene\n"
        "assert load_observer({p.name: p.default for p in PARAMETERS}, load_scene('tripod')) is None\n"
        "assert 'tripod_ik.load' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_it_needs_a_measurement_and_a_delay_in_range() -> None:
    values = {p.name: p.default for p in PARAMETERS} | {"observe_load": True}
    with raises_naming(IkError, "'observe_load'", "--set feedback=pose", "feedback=imu"):
        load_observer(values, load_scene(SHARP))
    assert load_observer(values | {"feedback": "imu"}, load_scene(SHARP)).delay == values["feedback_delay"]
    with raises_naming(IkError, "delay", "1.0 s", "0 to 0.5 s"):
        LoadObserver(1.0)
    with raises_naming(IkError, "'observe_load'", "servos", "left, right"):
        load_observer(values | {"feedback": "pose"}, load_scene("finger_cable"))
    observer = LoadObserver()
    observer.measure(np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.0)  # no model yet: nothing to compare with
    assert np.isnan(observer.load.force)
    with raises_naming(IkError, "measured position[1]", "nan"):
        observer.measure(np.array([0.0, np.nan, 0.0]), np.array([0.0, 0.0, 1.0]), 0.0)
