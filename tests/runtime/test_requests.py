"""Requests to a running simulator: read, refused, or carried out by the node, which restarts where it must."""

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from tests.messages import names, raises_naming
from tripod_runtime.requests import Request, changed, request_of
from tripod_sim.errors import SceneError, StepError
from tripod_study.accuracy.choice import choose

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("text", "request_"),
    [
        ('{"do": "reset"}', Request("reset")),
        ('{"do": "figures"}', Request("figures")),
        ('{"effect": "sleep", "on": true}', Request("effect", effect="sleep", on=True)),
        ('{"accuracy": "5%"}', Request("accuracy", accuracy="5%")),
        ('{"speed": 0.1}', Request("speed", speed=0.1)),
        ('{"do": "unload"}', Request("unload")),
        ('{"let_go": 7}', Request("let_go", who=7)),
        ('{"load": {"vertex": 3, "force": [0, 0, -1]}}', Request("load", vertex=3, vector=(0.0, 0.0, -1.0))),
        (
            '{"pull": {"who": 7, "vertex": 3, "from": [0, 0, 1], "to": [1, 2, 3], "stiffness": 50}}',
            Request("pull", who=7, vertex=3, hold=(0.0, 0.0, 1.0), vector=(1.0, 2.0, 3.0), stiffness=50.0),
        ),
    ],
)
def test_requests_are_read(text: str, request_: Request) -> None:
    assert request_of(text) == request_


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("reset", ("'reset'", "JSON")),
        ("[]", ("'[]'", "JSON object")),
        ('{"speed": 0}', ("speed", 0, "allowed: 0.1", 10)),
        ('{"speed": 11}', ("speed", 11)),
        ('{"speed": NaN}', ("speed", "finite")),
        ('{"speed": true}', ("speed", "finite")),
        ('{"pull": {"who": -1, "vertex": 3, "from": [0, 0, 0], "to": [1, 2, 3]}}', ("who", -1)),
        ('{"pull": {"who": 1, "vertex": 0.5, "from": [0, 0, 0], "to": [1, 2, 3]}}', ("vertex", 0.5)),
        ('{"pull": {"who": 1, "vertex": 3, "from": [0, 0, 0], "to": [1, 2]}}', ("to", "three")),
        ('{"load": {"vertex": 3, "force": [1, 2, Infinity]}}', ("force", "finite")),
        ('{"load": 3}', ("do", "None")),
        ('{"do": "explode"}', ("do", "'explode'", "allowed: reset")),
        ('{"effect": "magic", "on": true}', ("effect", "'magic'", "effects: gravity")),
        ('{"effect": "sleep", "on": 1}', ("on", 1, "true", "false")),
        ('{"accuracy": "200%"}', ("'200%'", "percentage")),
        ('{"do": "' + "x" * 2000 + '"}', ("at most 1000",)),
    ],
)
def test_what_is_no_request_is_refused(text: str, named: tuple[object, ...]) -> None:
    with raises_naming(SceneError, *named):
        request_of(text)


def test_an_effect_is_switched_on_with_its_defaults_and_off_again() -> None:
    on = changed(["dt=0.01"], Request("effect", effect="contact", on=True))
    assert on == ["dt=0.01", "contact={self_contact=true}"]
    assert changed(on, Request("effect", effect="contact", on=False)) == ["dt=0.01", "contact=off"]


class Ear:
    """Sends requests and keeps pictures and figures."""

    def __init__(self, node) -> None:
        from std_msgs.msg import String

        from tripod_graph import names
        from tripod_graph.qos import LATCHED, RELIABLE

        self.pictures: list[dict] = []
        self.figures: list[dict] = []
        self._kind = String
        self.requests = node.create_publisher(String, names.SIM_REQUEST, RELIABLE)
        node.create_subscription(
            String, names.SIM_PICTURE, lambda m: self.pictures.append(json.loads(m.data)), LATCHED
        )
        node.create_subscription(
            String, names.SIM_FIGURES, lambda m: self.figures.append(json.loads(m.data)), RELIABLE
        )

    def ask(self, **request: object) -> None:
        self.requests.publish(self._kind(data=json.dumps(request)))

    def notice(self) -> str:
        return self.figures[-1]["notice"] if self.figures else ""


@pytest.mark.ros
def test_the_node_does_what_is_asked_and_says_what_it_does_not(make) -> None:
    pytest.importorskip("rclpy")
    from tripod_msgs.msg import SimStatus

    graph = make(scene="tripod_ball").start()
    ear = Ear(graph.ear)
    graph.wait(ear.requests.get_subscription_count, "the simulator's subscription")
    graph.wait(lambda: ear.pictures and ear.figures, "picture and figures")
    assert ear.pictures[0]["name"] == "tripod_ball"
    assert {e["name"]: e["on"] for e in ear.pictures[0]["effects"]}["ball"]
    ear.ask(do="pause")
    first = graph.status(state=SimStatus.PAUSED).step
    ear.ask(do="step")
    graph.status(step=first + 1)
    ear.ask(do="reset")
    graph.status(step=0)
    start = graph.node._physics.latest.ball.position.copy()
    ear.ask(do="run")
    graph.wait(lambda: graph.node._physics.latest.ball.position[2] < start[2] - 0.004, "the ball's fall")
    ear.ask(do="pause")
    graph.status(state=SimStatus.PAUSED)
    ear.ask(do="drop")
    graph.wait(lambda: list(graph.node._physics.latest.ball.position) == list(start), "the ball at its start")
    ear.ask(do="explode")
    graph.wait(lambda: names(ear.notice(), "do", "'explode'"), "the refusal")
    ear.ask(effect="maze", on=True)  # the ball lies on the piece: its place is no maze's
    graph.wait(lambda: names(ear.notice(), "cannot continue", "maze={}: "), "why there is no such scene")
    ear.ask(effect="gravity", on=False)  # a ball needs gravity
    graph.wait(lambda: names(ear.notice(), "gravity"), "the refusal")
    ear.ask(effect="sleep", on=True)
    graph.wait(
        lambda: graph.node.replacement and graph.node.replacement.changes == ("sleep={}",),
        "the restart",
    )


@pytest.mark.ros
def test_hands_pull_and_load_and_time_passes_slower_until_a_robot_comes(make) -> None:
    pytest.importorskip("rclpy")
    from tripod_msgs.msg import RobotStatus

    from tripod_graph import names as topics
    from tripod_graph.qos import RELIABLE

    graph = make(set="mesh.level=1").start()
    ear = Ear(graph.ear)
    graph.wait(lambda: ear.requests.get_subscription_count() and ear.figures, "the simulator")
    physics = graph.node._physics
    applied: list = []
    graph.ear.create_subscription(
        graph.node._applied.msg_type, topics.APPLIED_FORCES, applied.append, RELIABLE
    )
    positions = physics.latest.positions.copy()
    vertex = int(abs(positions - [0.0, 0.0, 0.0025]).sum(axis=1).argmin())
    place = positions[vertex]
    goal = [place[0], place[1], place[2] + 0.02]
    pull = {"who": 1, "vertex": vertex, "from": place.tolist(), "to": goal}
    graph.wait(
        lambda: ear.ask(pull=pull) or physics.latest.positions[vertex, 2] > place[2] + 1e-3, "the pull"
    )
    graph.wait(lambda: ear.ask(pull=pull) or names(ear.figures[-1]["hands"], "pull", "N/m"), "what acts")
    assert ear.figures[-1]["stiffness"] > 0
    assert not ear.figures[-1]["energy"]["grew"]
    ear.ask(let_go=1)
    graph.wait(lambda: physics.latest.positions[vertex, 2] < place[2] + 5e-4, "its return")
    graph.wait(lambda: applied, "what was applied, for a recording")
    ear.ask(load={"vertex": vertex, "force": [0.0, 0.0, -0.2]})
    graph.wait(lambda: names(ear.figures[-1]["hands"], "load", "0.2 N"), "the load")
    ear.ask(do="unload")
    graph.wait(lambda: not ear.figures[-1]["hands"], "its end")
    ear.ask(load={"vertex": len(positions) + 9, "force": [0.0, 0.0, 1.0]})
    graph.wait(lambda: names(ear.notice(), "vertex"), "the refusal")
    ear.ask(speed=0.5)
    graph.wait(lambda: physics.rate == 0.5 and ear.figures[-1]["speed"] == 0.5, "the speed")
    robot = graph.ear.create_publisher(RobotStatus, topics.ROBOT_STATUS, RELIABLE)
    status = RobotStatus(port="/dev/ttyUSB0", state=RobotStatus.READY)
    graph.wait(lambda: robot.publish(status) or physics.rate == 1.0, "real time")
    ear.ask(speed=2.0)
    graph.wait(lambda: names(ear.notice(), "/dev/ttyUSB0", "real time"), "the refusal")
    assert physics.rate == 1.0
    graph.wait(lambda: ear.ask(speed=2.0) or physics.rate == 2.0, "the speed, once the driver is silent")
    for told in (
        RobotStatus(port="mock", state=RobotStatus.READY),
        RobotStatus(port="/dev/ttyUSB0", state=RobotStatus.DISCONNECTED),
    ):
        graph.node._robot_port = "unknown"
        graph.wait(lambda told=told: robot.publish(told) or not graph.node._robot_port, "no robot that moves")
        assert physics.rate == 2.0


@pytest.mark.ros
def test_all_goes_on_while_another_simulation_is_built_and_the_newest_wish_counts(
    make, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rclpy")
    from tripod_graph import names as topics
    from tripod_runtime import hot_swap

    may, built, simulation = threading.Event(), list[str](), hot_swap.Simulation

    def slow(scene):
        built.append(scene.name)
        assert may.wait(60)
        if not scene.gravity:
            raise StepError("no rest")
        return simulation(scene)

    monkeypatch.setattr(hot_swap, "Simulation", slow)
    graph = make(scene="pendulum", set="duration=1.0").start()
    ear = Ear(graph.ear)
    graph.wait(lambda: ear.requests.get_subscription_count() and ear.figures, "the simulator")
    ear.ask(effect="damping", on=True)
    building = ("building", "damping={}")
    graph.wait(lambda: names(ear.notice(), *building), "what it waits for")
    first = graph.next(topics.SIM_STATUS, lambda s: names(s.message, *building))
    graph.next(topics.SIM_STATUS, lambda s: names(s.message, *building) and s.step > first.step + 20)
    ear.ask(effect="gravity", on=False)
    graph.wait(lambda: names(ear.notice(), "building", "damping={}; gravity=off"), "the newest wish")
    may.set()
    refusal = ("cannot continue", "damping={}; gravity=off: no rest")
    graph.wait(lambda: names(ear.notice(), *refusal), "why not")
    assert len(built) == 2
    assert graph.node.replacement is None
    ear.ask(effect="damping", on=True)
    graph.wait(
        lambda: graph.node.replacement and graph.node.replacement.changes == ("damping={}",), "what is ready"
    )
    assert graph.node.replacement.simulation.scene.damping


@pytest.mark.ros
def test_an_accuracy_of_the_page_wins_over_what_was_set_at_the_start(make) -> None:
    """As after `tripod up --accuracy 1%`, whose setting stands in `set`."""
    pytest.importorskip("rclpy")
    graph = make(scene="pendulum", set="dt=0.02;springs.node_mass=0.02").start()
    ear = Ear(graph.ear)
    graph.wait(ear.requests.get_subscription_count, "the simulator's subscription")
    ear.ask(accuracy="reference")
    graph.wait(lambda: graph.node.replacement, "the setting")
    scene = graph.node.replacement.simulation.scene
    assert scene.dt == choose("pendulum", "reference").settings["dt"] != 0.02
    assert scene.springs.node_mass == 0.02


@pytest.mark.ros
def test_the_process_begins_anew_with_what_is_asked_and_goes_back_where_that_cannot_be_built(
    make, domain
) -> None:
    pytest.importorskip("rclpy")
    graph = make()  # no node of its own: the process is another
    ear = Ear(graph.ear)
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    words = [f"__ns:={graph.ear.get_namespace()}", "scene:=pendulum"]
    process = subprocess.Popen(
        [sys.executable, "-m", "tripod_runtime.node", *words], cwd=ROOT, env=environment
    )
    try:
        graph.wait(lambda: ear.pictures and ear.requests.get_subscription_count(), "the first picture")
        assert ear.pictures[-1]["changes"] == []
        ear.ask(effect="damping", on=True)
        graph.wait(lambda: ear.pictures[-1]["changes"], "the picture of the node that took its place")
        assert ear.pictures[-1]["changes"] == ["damping={}"]
        assert {e["name"]: e["on"] for e in ear.pictures[-1]["effects"]}["damping"]
        shipped = lambda: ear.pictures[-1]["changes"] == []  # noqa: E731
        graph.wait(
            lambda: shipped() or ear.ask(do="as_shipped"), "the scene as shipped"
        )  # it is just joining
        ear.figures.clear()  # what is told to stop while it builds a node does so by the signal
        graph.wait(lambda: ear.figures or ear.ask(do="figures"), "the answer of the last node")
        assert process.poll() is None
    finally:
        process.send_signal(signal.SIGTERM)
        code = process.wait(60)
    assert code == 0
