"""The page in a real browser: every control of every shipped scene, on a screen and on a phone.

The simulator's side of the page is played by a node that publishes what the real one would of each scene: its mesh, its
picture, its figures; `FakeSimulator` moves the joints. So the page is driven as it is, and no scene is simulated.
"""

import csv
import json
import re
import shutil
import time
import tomllib
from array import array
from collections.abc import Callable, Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")
pytest.importorskip("playwright")

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from matplotlib.image import imread
from playwright.sync_api import sync_playwright
from std_msgs.msg import String
from std_srvs.srv import Trigger
from tripod_msgs.msg import ControlMode, Field, Forces, SimStatus

from tests import messages
from tests.domains import own_domain
from tests.view.shown_scene import show, told
from tests.view.stage import DEADLINE, Stage
from tripod_graph import diagnostic_keys as keys
from tripod_graph import names
from tripod_graph.diagnostic_keys import Recording
from tripod_graph.diagnostics import Level, status_message
from tripod_graph.joint import SHOWN, Joint
from tripod_graph.qos import RELIABLE
from tripod_sim.scene.file import scene_names
from tripod_study.accuracy.choice import percent
from tripod_view.control import STALE

NAMES = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM = next((path for name in NAMES if (path := shutil.which(name))), "")
FLAGS = (
    "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
SIZES = {"screen": (1400, 900), "phone": (390, 844)}

pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(not CHROMIUM, reason="no Chromium; to install: sudo apt-get install chromium"),
]


@pytest.fixture(scope="module")
def stage() -> Iterator[Stage]:
    import rclpy

    with own_domain() as domain, pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        context = rclpy.Context()
        rclpy.init(context=context, domain_id=domain)
        made = Stage(context, "rate:=4.0")  # pictures are drawn by the processor here
        yield made
        code, errors = made.close()
        context.try_shutdown()
    assert (code, "Traceback" in errors) == (0, False)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        yield opened
        opened.close()


class Opened:
    """The page in a browser; `errors` keeps what its console complains of, and what it asks of other machines."""

    def __init__(self, browser: Any, stage: Stage, size: str) -> None:
        width, height = SIZES[size]
        self.page = browser.new_page(  # few pixels: the processor draws them
            viewport={"width": width, "height": height}, device_scale_factor=0.25, has_touch=size == "phone"
        )
        self.page.set_default_timeout(1e3 * DEADLINE)
        self.errors: list[str] = []
        self.page.on("console", lambda m: self.errors.append(m.text) if m.type == "error" else None)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        own = stage.url.rpartition("/")[0]
        self.page.on(
            "request", lambda r: r.url.startswith((own, "data:", "blob:")) or self.errors.append(r.url)
        )
        self.page.goto(stage.url, wait_until="commit")

    def __enter__(self) -> "Opened":
        return self

    def __exit__(self, *_: object) -> None:
        self.page.close()

    def wait(self, condition: str) -> None:
        """Wait until a JavaScript expression is true."""
        self.page.wait_for_function(f"() => {condition}", polling=100)

    def text(self, selector: str, *named: object) -> None:
        """Wait until an element names each of `named`."""
        end, shown = time.monotonic() + DEADLINE, ""
        while not messages.names(shown, *named):
            assert time.monotonic() < end, shown
            self.page.wait_for_timeout(50)
            shown = self.page.evaluate(
                """(selector) => {
                    const found = document.querySelector(selector), texts = [];
                    const walker = found && document.createTreeWalker(found, NodeFilter.SHOW_TEXT);
                    while (walker?.nextNode()) texts.push(walker.currentNode.data);
                    return texts.join(" ");
                }""",
                selector,
            )

    def press(self, *buttons: str) -> None:
        """Click on buttons by what stands on them, each as soon as it is in sight and enabled."""
        left, end = list(buttons), time.monotonic() + DEADLINE
        while left:
            assert time.monotonic() < end, left
            left = self.page.evaluate(
                """(names) => {
                    const pressed = (name) => {
                        const found = [...document.querySelectorAll("button")].find((b) => b.textContent === name);
                        const ready = found && found.offsetParent && !found.disabled;
                        if (ready) found.click();
                        return ready;
                    };
                    while (names.length && pressed(names[0])) names.shift();
                    return names;
                }""",
                left,
            )
            if left:
                self.page.wait_for_timeout(50)

    def move(self, selector: str, value: float, event: str = "input") -> None:
        """Put a slider, or a number, at a value."""
        self.page.locator(selector).evaluate(
            f"(e, v) => {{ e.value = v; e.dispatchEvent(new Event('{event}')) }}", value
        )

    def seen(self) -> dict[str, Any]:
        """Return where the main parts are, and what is in sight, in one question."""
        return self.page.evaluate(
            """() => {
                const box = (s) => { const b = document.querySelector(s).getBoundingClientRect();
                    return [b.left, b.top, b.right, b.bottom]; };
                const shown = (s) => Boolean(document.querySelector(s)?.checkVisibility());
                const count = (s) => document.querySelectorAll(s).length;
                document.querySelectorAll("#panel details").forEach((card) => (card.open = true));
                const panel = document.querySelector("#panel");
                return {
                    stop: box("#stop"), root: box("#stage"), start: box("#start"), panel: box("#panel"),
                    title: document.title,
                    too_wide: panel.scrollWidth - panel.clientWidth,
                    begin: document.querySelector("#begin").textContent,
                    joints: shown("#joints"), target: shown("#target"), ball: shown(".only-ball"),
                    simulated: shown("#simulated"), on: count("#on .chip"), off: count("#off .chip"),
                    barred: count("#barred p"),
                    offers: count("#offers tr"), enabled: count("#offers button:enabled"),
                    here: document.querySelector("#here").textContent,
                    bound: document.querySelector("#here").title,
                    costs: count(".chip span"),
                };
            }"""
        )


@pytest.mark.parametrize(
    ("size", "scenes"),
    [
        ("screen", ("tripod", "maze", "drape")),
        *(pytest.param(size, scene_names(), marks=pytest.mark.slow) for size in SIZES),
    ],
    ids=["few", *SIZES],
)
def test_every_control_of_every_scene_does_what_it_says(
    stage: Stage, browser: Any, size: str, scenes: Sequence[str]
) -> None:
    asked: list[str] = []
    requests = stage.sim.create_subscription(String, names.SIM_REQUEST, lambda m: asked.append(m.data), 100)
    show(stage.sim, "tripod")
    with Opened(browser, stage, size) as opened:
        stage.wait(requests.get_publisher_count)
        opened.wait("document.querySelector('#picture').width > 50")
        for scene in scenes:
            shown = show(stage.sim, scene)
            asked.clear()
            opened.text("#panel h1", scene)
            opened.text("#stable", "energy balance")
            check(opened.seen(), shown, size)
            press_everything(opened, stage, shown, asked)
            if shown["servos"]:
                drive(opened, stage)
                assert_every_plot_is_drawn(opened)
            elif shown["joints"]:
                drive_others(opened, stage)
                assert_every_plot_is_drawn(opened)
            assert opened.errors == [], scene
        opened.page.locator("#begin").click()
        assert opened.page.locator("#start").count() == 0
        opened.page.keyboard.press("Escape")  # who leaves in control leaves a notice behind
        stage.wait(lambda: stage.mode()[0] == ControlMode.STOP)
    stage.destroy(requests)
    stage.wait(lambda: stage.watchers() == 0)


def check(seen: dict[str, Any], shown: dict[str, Any], size: str) -> None:
    """The page has what the scene has; STOP and the 3-D view are in sight, and nothing is wider than the screen."""
    width, height = SIZES[size]
    for left, top, right, bottom in (seen["stop"], seen["root"]):
        assert (left >= 0, top >= 0, right <= width + 1, bottom <= height + 1) == (True,) * 4
    assert seen["stop"][3] - seen["stop"][1] >= 44
    assert seen["root"][3] - seen["root"][1] >= 0.4 * height
    assert seen["root"][3] <= seen["panel"][1] + 1 or seen["root"][2] <= seen["panel"][0] + 1
    assert seen["start"][3] <= seen["stop"][1] or size == "screen"
    assert seen["start"][1] >= seen["root"][3] or size == "screen"  # a small robot is not covered
    assert seen["too_wide"] <= 0
    assert seen["title"] == f"{shown['name']} - Tripod"
    assert seen["simulated"]
    assert seen["begin"].startswith(("Move", "Play")) == bool(shown["joints"])
    for part in ("joints", "ball"):
        assert seen[part] == bool(shown[part])
    assert seen["target"] == (shown["effector"] is not None)
    on, off = ([e for e in shown["effects"] if e["on"] == here] for here in (True, False))
    barred = sum(bool(effect["why_not"]) for effect in off)
    assert (seen["on"], seen["off"], seen["barred"]) == (len(on), len(off) - barred, barred)
    assert seen["costs"] == 0, "what an effect costs is measured by tripod explain"
    accuracy = shown["accuracy"]
    assert seen["offers"] == (6 if accuracy["study"] else 0)
    if accuracy["measured"] is None:
        messages.assert_names(seen["here"], "error not known")
        assert seen["bound"] == ""
    else:
        messages.assert_names(seen["here"], percent(accuracy["measured"]), "measured")
        assert not messages.names(seen["here"], percent(accuracy["bound"]))
        messages.assert_names(seen["bound"], percent(accuracy["bound"]))


def assert_every_plot_is_drawn(opened: Opened) -> None:
    """Each plot has a curve: something coloured, which the grid is not."""
    opened.page.evaluate("document.querySelector('#plots').open = true")
    opened.wait(
        """document.querySelectorAll("#plots canvas").length > 1
            && [...document.querySelectorAll("#plots canvas")].every((canvas) => {
            const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
            const spread = (k) => Math.max(...data.slice(k, k + 3)) - Math.min(...data.slice(k, k + 3));
            for (let k = 0; k < data.length; k += 4) if (data[k + 3] > 200 && spread(k) > 60) return true;
            return false;
        })"""
    )


def press_everything(opened: Opened, stage: Stage, shown: dict[str, Any], asked: list[str]) -> None:
    """Press what every scene has, and see it arrive."""
    drop = ["Drop the ball"] if shown["ball"] else []
    opened.press("Reset", "Pause")
    opened.wait("[...document.querySelectorAll('button')].find((b) => b.textContent === 'Step').disabled")
    stage.sim.state = SimStatus.PAUSED
    opened.press("Step")
    stage.sim.state = SimStatus.RUNNING
    opened.press(*drop, "Fit", "Mesh", "Mesh", "Replay")
    opened.move("#replay input", -0.1)
    opened.wait("document.body.classList.contains('past')")
    opened.press("Now")
    opened.wait("!document.body.classList.contains('past')")
    opened.page.evaluate(
        """() => { for (const s of ["#off .chip", "#on .chip", "#offers button:enabled"])
            document.querySelector(s)?.click() }"""
    )
    offered = any(not offer["why_not"] for offer in shown["accuracy"]["offers"])
    wanted = {'{"do": "reset"}', '{"do": "pause"}', '{"do": "step"}', *(['{"do": "drop"}'] if drop else [])}
    stage.wait(lambda: wanted <= set(asked), lambda: f"{wanted - set(asked)} did not arrive, but {asked}")
    for word in ('"on": true', '"on": false', *(["accuracy"] if offered else [])):
        stage.wait(lambda word=word: any(word in request for request in asked))
    opened.page.keyboard.press("Escape")
    stage.wait(lambda: stage.mode() and stage.mode()[0] == ControlMode.STOP)


def drive(opened: Opened, stage: Stage) -> None:
    """Take control, move servos by slider, by typing and by keys, and stop in each way that there is."""
    page, sim = opened.page, stage.sim
    button = page.locator("#drive")
    assert button.is_visible()
    assert button.is_enabled()
    button.dispatch_event("click")
    stage.wait(lambda: stage.mode()[0] == ControlMode.TELEOP)
    opened.wait("!document.querySelector('.servo input').disabled")
    if not page.evaluate("navigator.maxTouchPoints"):
        page.locator("#drive").hover()
        opened.wait(
            "getComputedStyle(document.querySelector('#drive:hover')).backgroundColor === 'rgb(28, 126, 214)'"
        )
    up = "new KeyboardEvent('keyup', { key: ' ', cancelable: true, bubbles: true })"
    assert not page.evaluate(f"document.querySelector('#drive').dispatchEvent({up})")
    sim.commands.clear()

    def asks(servo: int) -> float:
        positions = sim.commands[-1].points[-1].positions if sim.commands else ()
        return positions[servo] if servo < len(positions) else float("nan")

    opened.move("[aria-label='servo 1 (degrees)']", -30.0)
    stage.wait(lambda: abs(asks(1) + 0.5236) < 1e-3)
    # so that a key has room, however long it was down before
    opened.move("[aria-label='servo 2 (degrees)']", -45.0)
    stage.wait(lambda: abs(asks(2) + 0.7854) < 1e-3)
    opened.move("[aria-label='slide (mm)']", 10.0)
    stage.wait(lambda: abs(asks(sim.follower.limits.size) - 0.01) < 1e-6)  # the slide is the last
    opened.move("[aria-label='servo 0, typed (degrees)']", -400.0, "change")
    opened.text("#notice", "servo 0", "-400.0 degrees", "-120.3 to 34.4")
    stage.wait(lambda: abs(asks(0) + 2.1) < 1e-3)
    sim.commands.clear()
    typed = page.locator("[aria-label='servo 0, typed (degrees)']")
    typed.fill("")
    typed.press("Enter")  # nothing was typed: 0 degrees is somewhere else
    opened.wait("document.activeElement.tagName !== 'INPUT'")
    opened.wait("document.querySelector('[aria-label=\"servo 0, typed (degrees)\"]').value === '-120.3'")
    stage.wait(lambda: len(sim.commands) > 3)
    assert abs(asks(0) + 2.1) < 1e-3
    before = asks(2)
    page.keyboard.down("+")
    stage.wait(lambda: asks(2) > before + 0.02)
    page.keyboard.up("+")
    page.keyboard.press(" ")
    stage.wait(lambda: stage.mode()[0] == ControlMode.STOP)
    for key, mode in (("t", ControlMode.TELEOP), ("i", ControlMode.IK)):
        page.keyboard.press(key)
        stage.wait(lambda wanted=mode: stage.mode()[0] == wanted)
    for label in ("Working pose", "Park pose"):
        opened.press("Bring target to effector", label)
        opened.text("#notice", label)
    page.locator("#stop").dispatch_event("click")
    stage.wait(lambda: stage.mode()[0] == ControlMode.STOP)


def drive_others(opened: Opened, stage: Stage) -> None:
    """Take control and move each joint that is no servo by its slider, in the unit in which people read it."""
    limits = stage.sim.follower.limits
    assert opened.page.evaluate("document.querySelector('#joints summary').textContent") == "Actuators"
    opened.press("Drive by sliders and keys")
    stage.wait(lambda: stage.mode()[0] == ControlMode.TELEOP)
    opened.wait("!document.querySelector('.servo input').disabled")
    for i, joint in enumerate(limits.others):
        factor, unit = SHOWN[joint.unit]
        opened.move(f"[aria-label='{joint.name} ({unit})']", factor * joint.high)

        def is_asked(i: int = i, joint: Joint = joint) -> bool:
            point = stage.sim.commands[-1].points[-1] if stage.sim.commands else None
            values = () if point is None else point.effort if joint.is_effort else point.positions
            return len(values) == limits.size and abs(values[i] - joint.high) < 0.02 * joint.span

        stage.wait(is_asked, lambda name=joint.name: f"{name} was not commanded")
    opened.press("Park pose")
    opened.text("#notice", "Park pose")
    opened.page.keyboard.press(" ")
    stage.wait(lambda: stage.mode()[0] == ControlMode.STOP)


def test_a_goal_and_a_lost_ball_are_told(stage: Stage, browser: Any) -> None:
    show(stage.sim, "maze")
    with Opened(browser, stage, "screen") as opened:
        show(stage.sim, "maze", event="goal reached at 3.20 s")
        opened.text("#event.good", "goal reached", "3.20 s")
        show(stage.sim, "maze", event="ball fell through a hole at 4.00 s")
        opened.text("#event.bad", "ball fell", "4.00 s")
        assert opened.errors == []


def test_a_simulator_that_is_not_heard_is_told_over_its_last_picture(stage: Stage, browser: Any) -> None:
    show(stage.sim, "tripod")
    with Opened(browser, stage, "screen") as opened:
        opened.text("#run", "running")
        assert not opened.page.locator("#silent").is_visible()
        stage.sim.silent = True
        opened.wait("document.querySelector('#silent').checkVisibility()")
        opened.text("#run", "simulator", "not heard")
        opened.page.reload(wait_until="commit")
        opened.wait("document.querySelector('#silent')?.checkVisibility()")
        stage.sim.silent = False
        opened.wait("!document.querySelector('#silent').checkVisibility()")
        assert opened.errors == []


def test_notes_on_the_scene_stay_beside_what_is_told(stage: Stage, browser: Any) -> None:
    said = "time_error.accuracy = 0.05 is not promised here"
    with Opened(browser, stage, "screen") as opened:
        show(stage.sim, "tripod", notes=(said, "load.0.pressure is a dead pressure"))
        opened.text("#notes", "time_error.accuracy = 0.05", "not promised", "load.0.pressure")
        show(stage.sim, "tripod", notice="machine too slow (0.31 of real time)", notes=(said,))
        opened.text("#notice", "machine too slow")
        opened.text("#notes", "time_error.accuracy = 0.05", "not promised")
        opened.wait("!document.querySelector('#notes').textContent.includes('pressure')")
        assert opened.errors == []


@pytest.mark.parametrize("size", SIZES)
def test_messages_shift_nothing(stage: Stage, browser: Any, size: str) -> None:
    show(stage.sim, "maze")
    tops = "[...document.querySelectorAll('#panel .card')].map((card) => card.offsetTop).join()"
    with Opened(browser, stage, size) as opened:
        opened.text("#panel h1", "maze")
        opened.wait("document.querySelector('#mode').textContent")
        opened.press("Drive by sliders and keys")
        stage.wait(lambda: stage.mode() and stage.mode()[0] == ControlMode.TELEOP)
        opened.text("#mode", "sliders")
        opened.wait("document.querySelector('#run').textContent")
        before = opened.page.evaluate(tops)
        long = "slower than real time: " + 20 * "lower the speed, "
        show(stage.sim, "maze", event="goal reached at 3.20 s", notice=long, notes=(long, long))
        opened.text("#event.good", "3.20 s")
        opened.text("#notice", "lower")
        opened.page.keyboard.press("Escape")
        stage.wait(lambda: stage.mode() and stage.mode()[0] == ControlMode.STOP)
        opened.text("#mode", "off", "holds")
        assert opened.page.evaluate(tops) == before
        assert opened.errors == []


@pytest.mark.parametrize(("width", "height"), [(1400, 900), (1000, 700), (420, 800)])
def test_the_start_card_covers_no_legend(stage: Stage, browser: Any, width: int, height: int) -> None:
    show(stage.sim, "silicone")
    with Opened(browser, stage, "screen") as opened:
        opened.page.set_viewport_size({"width": width, "height": height})
        opened.wait("document.querySelector('#colour option[value=von_mises]')")
        opened.page.locator("#colour").select_option("von_mises")
        opened.wait("!document.querySelector('#legend').hidden")
        apart = """(aside) => {
            const start = document.querySelector("#start");
            const legend = document.querySelector("#legend").getBoundingClientRect();
            start.classList.toggle("aside", aside);
            const { left, top, right, bottom } = start.getBoundingClientRect();
            return right <= legend.left || left >= legend.right || bottom <= legend.top || top >= legend.bottom;
        }"""
        assert [opened.page.evaluate(apart, aside) for aside in (False, True)] == [True, True]
        assert opened.errors == []


def test_what_the_simulator_proposes_is_shown_as_long_as_it_says_so(stage: Stage, browser: Any) -> None:
    show(stage.sim, "tripod")
    with Opened(browser, stage, "screen") as opened:
        show(stage.sim, "tripod", notice="a simulated second takes 3.2 s; real-time takes dt=0.005")
        opened.text("#notice", "3.2 s", "real-time", "dt=0.005")
        show(stage.sim, "tripod")
        opened.wait("!document.querySelector('#notice').textContent")
        assert opened.errors == []


def test_bodies_that_fell_too_far_to_be_seen_are_told(stage: Stage, browser: Any) -> None:
    show(stage.sim, "silicone_free")
    with Opened(browser, stage, "screen") as opened:
        opened.text("#panel h1", "silicone_free")
        nodes, triangles = stage.sim.body
        stage.sim.body = nodes - [0, 0, 1e3], triangles
        opened.text("#notice", "out of sight", "1000 m", "Reset")
        stage.sim.body = nodes, triangles
        opened.wait("!document.querySelector('#notice').textContent")
        assert opened.errors == []


def test_a_recorder_is_started_and_stopped(stage: Stage, browser: Any) -> None:
    asked: list[str] = []

    def answer(what: str, text: str) -> Any:
        def on_call(_: Any, response: Any) -> Any:
            asked.append(what)
            response.success, response.message = True, text
            return response

        return stage.sim.create_service(Trigger, what, on_call)

    services = [
        answer(names.RECORD_START, "recording to here.mcap"),
        answer(names.RECORD_STOP, "here.mcap is closed"),
    ]
    with Opened(browser, stage, "screen") as opened:
        for button, wanted, told in (
            ("Record", names.RECORD_START, "recording to here.mcap"),
            ("Stop recording", names.RECORD_STOP, "here.mcap is closed"),
        ):
            opened.text("#record:enabled", button)
            opened.page.locator("#record").click()
            opened.text("#recording", told)
            assert asked[-1] == wanted
        health = stage.sim.create_publisher(DiagnosticArray, names.DIAGNOSTICS, RELIABLE)
        name = f"{stage.view.namespace}/record"
        values = {keys.STATE: Recording.ON, keys.PATH: "there.mcap"}
        health.publish(DiagnosticArray(status=[status_message(name, "", Level.OK, "recording", values)]))
        opened.text("#record:enabled", "Stop recording")  # which somebody else began
        opened.text("#recording", "recording", "there.mcap")
        ended = "recording ended: no space"
        values[keys.STATE] = Recording.ENDED
        health.publish(DiagnosticArray(status=[status_message(name, "", Level.ERROR, ended, values)]))
        opened.text("#recording", ended, "there.mcap")
        opened.wait("document.querySelector('#record').textContent === 'Record'")
        stage.destroy(health)
        assert opened.errors == []
    stage.destroy(*services)


def test_a_page_that_lost_its_node_says_so_and_comes_back(stage: Stage, browser: Any) -> None:
    """Also: texts from the network stay texts."""
    show(stage.sim, "tripod", name="<img src=x onerror=alert(1)>")
    with Opened(browser, stage, "screen") as opened:
        opened.text("#panel h1", "<img src=x")
        assert opened.page.locator("#panel img").count() == 0
        opened.page.evaluate("WebSocket.prototype.send = function () { this.close() }")
        opened.page.keyboard.press(" ")  # its channel is cut
        opened.wait("document.body.classList.contains('lost')")
        opened.wait("!document.body.classList.contains('lost')")


def place(opened: Opened, label: str) -> list[float]:
    """Return where a label is over the picture [px]."""
    opened.wait(
        f"[...document.querySelectorAll('#labels span')].some((e) => e.textContent === '{label}' && e.offsetParent)"
    )
    return opened.page.evaluate(
        """(text) => {
            const found = [...document.querySelectorAll("#labels span")].find((e) => e.textContent === text);
            const box = found.getBoundingClientRect();
            return [box.left, box.top];
        }""",
        label,
    )


def test_a_camera_that_somebody_moved_stays_where_bodies_leave_the_picture(
    stage: Stage, browser: Any
) -> None:
    show(stage.sim, "tripod")
    nodes, triangles = stage.sim.body
    with Opened(browser, stage, "screen") as opened:
        first = place(opened, "servo 0")
        opened.press("Top")
        stage.wait(lambda: place(opened, "servo 0") != first)
        top, axis = place(opened, "servo 0"), place(opened, "x")
        stage.sim.body = nodes - [0, 0, 0.4], triangles
        stage.wait(lambda: place(opened, "x") != axis)  # the axes are drawn again
        assert place(opened, "servo 0") == top
        opened.press("Reset view")
        stage.wait(lambda: place(opened, "servo 0") not in (first, top))
        far = place(opened, "servo 0")
        stage.sim.body = nodes - [0, 0, 0.8], triangles
        stage.wait(lambda: place(opened, "servo 0") != far)  # followed again
        show(stage.sim, "drape")  # the next scene has a camera of its own
        opened.text("#panel h1", "drape")
        assert opened.errors == []


def test_the_target_is_dragged_by_its_handle(stage: Stage, browser: Any) -> None:
    show(stage.sim, "tripod")
    nodes, triangles = stage.sim.body
    with Opened(browser, stage, "screen") as opened:
        opened.press("Just watch")
        resting = PoseStamped()
        resting.header.frame_id, resting.header.stamp = names.WORLD, stage.sim.get_clock().now().to_msg()
        stage.sim.target.publish(resting)  # it would ride on the effector
        page, box = opened.page, stage_box(opened)
        x, y = 0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3])

        def tip() -> int | None:
            """Return how far above the middle the tip of the handle is [px], once it rests."""
            found = [
                next((s for s in range(250, 40, -6) if is_handle(opened, x, y - s)), None) for _ in range(2)
            ]
            return found[0] if found[0] == found[1] else None

        up = stage.wait(tip)
        still = place(opened, "servo 0")
        stage.sim.targets.clear()
        page.mouse.move(x, y - up)
        page.mouse.down()
        page.mouse.move(x, y - up - 30, steps=5)
        stage.wait(lambda: any(t.pose.position.z > 0.003 for t in stage.sim.targets))
        page.mouse.up()
        last = stage.sim.targets[-1].pose.position
        assert (abs(last.x) < 1e-6, abs(last.y) < 1e-6) == (True, True)  # along its axis
        assert place(opened, "servo 0") == still  # the camera was not turned, and is not taken for moved:
        stage.sim.body = nodes - [0, 0, 0.4], triangles
        stage.wait(lambda: place(opened, "servo 0") != still)
        stage.sim.body = nodes, triangles
        assert opened.errors == []


def test_a_body_is_pulled_and_loaded(stage: Stage, browser: Any) -> None:
    asked: list[dict[str, Any]] = []
    requests = stage.sim.create_subscription(
        String, names.SIM_REQUEST, lambda m: asked.append(json.loads(m.data)), 100
    )
    show(stage.sim, "silicone")
    with Opened(browser, stage, "screen") as opened:
        opened.press("Just watch")
        stage.wait(requests.get_publisher_count)
        page, box = opened.page, stage_box(opened)
        opened.wait("document.querySelector('#hands')")
        page.evaluate("document.querySelector('#hands').open = true")
        x, y = stage.wait(lambda: on_body(opened, box))
        still = place(opened, "x")
        opened.press("Pull")
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 40, y - 30, steps=4)
        pulls = stage.wait(lambda: [a["pull"] for a in asked if "pull" in a][1:])
        first, last = next(a["pull"] for a in asked if "pull" in a), pulls[-1]
        assert (first["who"], first["vertex"]) == (last["who"], last["vertex"])
        assert first["from"] == last["from"]
        assert max(abs(a - b) for a, b in zip(last["from"], last["to"], strict=True)) > 1e-3
        page.mouse.up()
        stage.wait(lambda: {"let_go": first["who"]} in asked)
        assert place(opened, "x") == still, "the camera was not turned"
        page.keyboard.press("g")
        opened.text("#load-at", "node", first["vertex"])
        opened.press("Place load")
        opened.text("#load-at", "0 N", "force")
        stage.wait(lambda: [a for a in asked if "load" in a])
        asked.clear()
        page.locator("[aria-label='load along z (N)']").fill("-0.5")
        opened.press("Place load")
        loads = stage.wait(lambda: [a["load"] for a in asked if "load" in a])
        assert loads == [{"vertex": first["vertex"], "force": [0.0, 0.0, -0.5]}]
        page.locator("#speed").select_option("0.2")
        stage.wait(lambda: {"speed": 0.2} in asked)
        stage.sim.figures = {**stage.sim.figures, "speed": 0.2}
        opened.text("#run", "chosen", "0.2 x")
        count = len([a for a in asked if "pull" in a])
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 30, y, steps=3)
        page.mouse.up()
        stage.wait(lambda: place(opened, "x") != still)  # without Pull the camera turns
        assert len([a for a in asked if "pull" in a]) == count
        assert opened.errors == []
    stage.destroy(requests)


def test_torques_of_the_last_step_stay_while_paused(stage: Stage, browser: Any) -> None:
    show(stage.sim, "tripod")
    with Opened(browser, stage, "screen") as opened:
        opened.text(".servo .torque", "-0.010 of")
        stage.sim.tells_joints, stage.sim.state = False, SimStatus.PAUSED
        opened.text("#run", "paused")
        opened.page.wait_for_timeout(1e3 * (STALE + 0.5))
        opened.text(".servo .torque", "-0.010 of")
        stage.sim.state = SimStatus.RUNNING
        opened.text(".servo .torque", "not known")
        stage.sim.tells_joints = True
        opened.text(".servo .torque", "-0.010 of")
        assert opened.errors == []


def test_a_drag_on_what_cannot_be_pulled_says_so(stage: Stage, browser: Any) -> None:
    show(stage.sim, "tripod")
    with Opened(browser, stage, "screen") as opened:
        page, box = opened.page, stage_box(opened)
        opened.text("#panel h1", "tripod")
        opened.press("Just watch", "Pull")
        stage.wait(lambda: box[0] < place(opened, "servo 0")[0] < box[2])
        still = place(opened, "servo 0")

        def told() -> str:
            return page.locator("#hand-told").text_content() or ""

        def drag(x: float, y: float) -> bool:
            page.mouse.move(x, y)
            page.mouse.down()
            page.mouse.move(x + 40, y + 10, steps=3)
            page.mouse.up()
            page.wait_for_timeout(500)
            return place(opened, "servo 0") != still

        x, y = next(
            (x, y)
            for y in range(int(still[1]), int(still[1]) + 60, 6)
            for x in range(int(still[0]) - 30, int(still[0]) + 31, 6)
            if page.mouse.click(x, y) or told()
        )
        messages.assert_names(told(), "soft", "free")
        opened.press("Pull")
        assert told() == ""
        opened.press("Pull")
        assert not drag(x, y), "the camera was turned"
        messages.assert_names(told(), "soft", "free")
        assert drag(box[0] + 20, 0.5 * (box[1] + box[3])), "the background turns it"
        assert told() == ""
        still = place(opened, "servo 0")
        opened.press("Pull")
        assert drag(x, y), "without Pull it is turned anywhere"
        assert opened.errors == []


def on_body(opened: Opened, box: list[float]) -> tuple[float, float] | None:
    """Return a place of the picture where a body can be picked; a click tells its node in the panel."""
    for share in (0.5, 0.45, 0.55, 0.4, 0.6, 0.35, 0.65):
        for height in (0.5, 0.45, 0.55, 0.4, 0.6):
            x, y = box[0] + share * (box[2] - box[0]), box[1] + height * (box[3] - box[1])
            opened.page.mouse.click(x, y)
            if "node" in (opened.page.locator("#load-at").text_content() or ""):
                return x, y
    return None


def stage_box(opened: Opened) -> list[float]:
    """Return left, top, right and bottom of the picture [px]."""
    box = opened.page.locator("#stage").bounding_box()
    return [box["x"], box["y"], box["x"] + box["width"], box["y"] + box["height"]]


def is_handle(opened: Opened, x: float, y: float) -> bool:
    """Return whether the pointer over a place of the picture would take the handle."""
    opened.page.mouse.move(x, y)
    opened.page.wait_for_timeout(30)
    return bool(opened.page.evaluate("document.querySelector('#picture').style.cursor === 'move'"))


def test_the_panel_is_hidden_a_picture_saved_and_the_keys_told(stage: Stage, browser: Any) -> None:
    show(stage.sim, "maze")
    stage.sim.publish_game(True, 0.002)
    with Opened(browser, stage, "screen") as opened:
        page = opened.page
        opened.press("Just watch")
        wide = stage_box(opened)[2]
        page.keyboard.press("h")
        opened.wait(f"document.querySelector('#stage').getBoundingClientRect().right > {wide} + 100")
        assert not page.locator("#panel").is_visible()
        assert page.locator("#stop").is_visible()
        page.keyboard.press("h")
        opened.wait("document.querySelector('#panel').checkVisibility()")
        bar = page.locator("#split").bounding_box()
        page.mouse.move(bar["x"] + 3, bar["y"] + 100)
        page.mouse.down()
        page.mouse.move(bar["x"] - 97, bar["y"] + 100, steps=3)
        page.mouse.up()
        assert abs(stage_box(opened)[2] - (wide - 100)) < 5
        with page.expect_download() as download:
            opened.press("Save picture")
        assert download.value.suggested_filename == "maze.png"
        opened.text("#scale", "maze.png")
        opened.wait("document.querySelector('#scale').textContent.includes('mm')")
        page.keyboard.press("?")
        opened.wait("document.querySelector('#sheet').open")
        page.locator("#stop").click()  # works also now
        stage.wait(lambda: stage.mode() and stage.mode()[0] == ControlMode.STOP)
        assert_escape_closes_the_sheet_first(opened, stage)
        stage.wait(
            lambda: stage.sim.publish_ball(0.01, -0.02, 0.03) or page.locator("#follow option").count() == 3
        )
        page.locator("#follow").select_option(label="follow ball")
        before = place(opened, "servo 0")
        stage.sim.publish_ball(0.03, -0.02, 0.03)
        stage.wait(lambda: place(opened, "servo 0") != before)
        assert opened.errors == []
    stage.sim.publish_game(False)


def assert_escape_closes_the_sheet_first(opened: Opened, stage: Stage) -> None:
    """Escape closes the sheet of keys, and stops if none is open; Space always stops; `?` closes the sheet, too."""
    page, is_open = opened.page, "document.querySelector('#sheet').open"
    opened.wait(is_open)
    page.locator("#help").click()
    opened.wait(f"!{is_open}")
    for key, mode in (("Escape", ControlMode.TELEOP), (" ", ControlMode.STOP)):
        page.keyboard.press("t")
        stage.wait(lambda: stage.mode()[0] == ControlMode.TELEOP)
        page.locator("#help").click()
        opened.wait(is_open)
        page.keyboard.press(key)
        page.wait_for_timeout(1000)
        assert (page.evaluate(is_open), stage.mode()[0]) == (key == " ", mode)
        page.keyboard.press("Escape")
        opened.wait(f"!{is_open}")
    page.keyboard.press("t")
    stage.wait(lambda: stage.mode()[0] == ControlMode.TELEOP)
    page.keyboard.press("Escape")
    stage.wait(lambda: stage.mode()[0] == ControlMode.STOP)


def pick(opened: Opened) -> str:
    """Click near the middle of the picture, beside the target's handle; return the text about the node."""
    left, top, right, bottom = stage_box(opened)
    opened.page.mouse.click(0.5 * (left + right) + 60, 0.5 * (top + bottom) + 12)
    opened.wait("document.querySelector('#picked').textContent")
    return opened.page.locator("#picked").text_content() or ""


def test_a_click_on_a_body_tells_the_node_its_set_and_plots_it(stage: Stage, browser: Any) -> None:
    show(stage.sim, "drape")
    with Opened(browser, stage, "screen") as opened:
        opened.text("#panel h1", "drape")
        opened.press("Just watch", "Top")
        found = re.fullmatch(r"(.+), node (\d+) at (.+) mm; moved .+m", pick(opened))
        assert found
        node, part = int(found[2]), next(p for p in told("drape")[0]["parts"] if p["name"] == found[1])
        rest = told("drape")[2][part["first"] + node]
        place = [1e-3 * float(v.split()[1]) for v in found[3].split(",")]
        np.testing.assert_allclose(place[:2], rest[:2], atol=6e-4)  # it ripples along z
        opened.press("Set")
        lines = tomllib.loads(opened.page.locator("#set").text_content())["set"][0]
        np.testing.assert_allclose(lines["centre"], rest, atol=1e-5)
        nodes = told("drape")[2][part["first"] : part["first"] + part["count"]]
        assert (np.linalg.norm(nodes - lines["centre"], axis=1) < lines["radius"]).nonzero()[0].tolist() == [
            node
        ]
        before = len(stage.sim.modes)
        opened.page.keyboard.press("Escape")
        opened.wait("document.querySelector('#set').hidden")
        opened.press("Plot")
        opened.text("#plots", f"{found[1]}, node {node}")
        assert len(stage.sim.modes) == before, "Escape stopped"
        headings = "[...document.querySelectorAll('.plot h2')].map((e) => e.firstChild.textContent)"
        opened.wait(f"{headings}.includes('energies [mJ]')")
        assert not [text for text in opened.page.evaluate(headings) if "servo" in text], "it has none"
        assert opened.errors == []


def test_the_ball_is_clicked_and_plotted_with_its_contact_force(stage: Stage, browser: Any) -> None:
    show(stage.sim, "maze")
    stage.sim.publish_game(True, 0.03)  # large enough to be hit
    forces = stage.sim.create_publisher(Forces, names.FORCES, RELIABLE)
    names_of = ["normal force on ball by plate", "normal force on plate by ball", "friction on ball by plate"]
    told_forces = Forces(names=names_of, units=["N"] * 3, counts=[1, 1, 1], points=[0.0] * 9)
    told_forces.vectors = array("d", [0.0, 0.0, 0.4, 0.0, 0.0, -0.4, 0.3, 0.0, 0.0])
    began = time.monotonic()

    def roll() -> None:
        """Roll at 10 mm/s."""
        stage.sim.publish_ball(0.01 * (time.monotonic() - began) % 1e-1 - 0.05, 0.0, 0.05)
        forces.publish(told_forces)

    timer = stage.sim.create_timer(0.02, roll)
    try:
        with Opened(browser, stage, "screen") as opened:
            opened.text("#panel h1", "maze")
            opened.press("Just watch", "Top")
            opened.wait("document.querySelector('#follow option[value=\"/ball\"]')")
            opened.page.locator("#follow").select_option(label="follow ball")
            left, top, right, bottom = stage_box(opened)
            opened.page.wait_for_timeout(500)
            opened.page.mouse.click(0.5 * (left + right), 0.5 * (top + bottom))
            opened.wait("document.querySelector('#picked').textContent.startsWith('ball at')")
            opened.wait("document.querySelector('#picked').textContent.includes('speed')")
            speed = re.search(r"speed ([\d.]+) mm/s", opened.page.locator("#picked").text_content() or "")
            assert speed
            assert float(speed[1]) == pytest.approx(10, rel=0.6)
            opened.press("Plot")
            opened.text("#picked", "contact force", "0.5 N")
            opened.text("#plots", "ball, speed", "ball, contact force")
            assert opened.page.locator("#arrows").is_hidden()
            remove = opened.page.locator("[aria-label='remove the plot: ball, contact force']")
            remove.click()
            stage.wait(lambda: forces.get_subscription_count() == 0)
            opened.page.locator("#more").select_option("new|ball, contact force: contact force")
            opened.text(".plot:last-of-type .legend", "contact force", "0.5")
            assert forces.get_subscription_count() == 1
            opened.page.locator("#plots summary").click()
            stage.wait(lambda: forces.get_subscription_count() == 0)
            opened.page.locator("#plots summary").click()
            stage.wait(lambda: forces.get_subscription_count() == 1)
            opened.press("Forces")
            opened.text("#arrows", "ball by plate", "plate by ball")
            remove.click()
            opened.page.wait_for_timeout(500)
            assert forces.get_subscription_count() == 1
            assert opened.errors == []
    finally:
        stage.wait(lambda: timer.cancel() or True)
        stage.destroy(forces)
        stage.sim.publish_game(False)


def test_plots_are_chosen_saved_and_made_only_while_their_card_is_open(stage: Stage, browser: Any) -> None:
    show(stage.sim, "tripod")
    with Opened(browser, stage, "screen") as opened:
        page = opened.page
        opened.text("#panel h1", "tripod")
        assert page.locator(".plot").count() == 0
        page.locator("#plots summary").dispatch_event("click")
        opened.wait("document.querySelectorAll('.plot').length === 2")
        opened.wait("document.querySelectorAll('#more option').length > 10")
        for key in ("servo torques: servo 1", "effector: z"):
            page.locator("#more").select_option(f"new|{key}")
        groups = page.locator("#more optgroup").evaluate_all("(all) => all.map((one) => one.label)")
        assert {"joints", "effector", "energies", "timing", "errors"} <= set(groups)
        page.locator("#more optgroup[label$='effector: z'] option").filter(has_text="effector: x").wait_for(
            state="attached"
        )
        page.locator("#more").select_option("3|effector: x")
        opened.text(".plot:nth-child(4) .legend", "z", "x")
        opened.text(".plot:nth-child(3) .legend", "servo 1", "-0.02")
        page.locator("[aria-label='remove the plot: servo angles']").dispatch_event("click")
        opened.wait("document.querySelectorAll('.plot').length === 3")
        with page.expect_download() as download:
            page.locator("[aria-label='save the numbers: effector: z']").dispatch_event("click")
        assert download.value.suggested_filename == "effector-z.csv"
        page.locator("#more").select_option("new|energies: total")
        parts = [stage.sim.figures["energy"][part] for part in ("kinetic", "strain", "gravity")]
        opened.text(".plot:last-of-type .legend", "total", f"{1e3 * sum(parts):.4g}")
        before = time.monotonic()
        stage.sim.began, stage.sim.speed = before, 10.0  # a reset, then faster than real time

        def columns() -> np.ndarray:
            """Return simulated times and those of the page [s] of the numbers in the plot, shape (2, k)."""
            page.wait_for_timeout(2500)  # the browser refuses many downloads one after the other
            with page.expect_download() as download:
                page.locator("[aria-label='save the numbers: effector: z']").dispatch_event("click")
            head, *rows = Path(download.value.path()).read_text().splitlines()
            assert next(csv.reader([head])) == ["time [s]", "page time [s]", "z [mm]", "x [mm]"]
            return np.array([row.split(",")[:2] for row in rows], float).T

        def restarted() -> tuple[np.ndarray, np.ndarray] | None:
            times, pages = columns()
            return (times, pages) if times[0] < 0.5 * before and np.ptp(pages) > 2 else None

        times, pages = stage.wait(restarted)
        np.testing.assert_array_equal(times, times.round(6))
        assert (np.diff(times) > 0).all()
        assert np.ptp(times) / np.ptp(pages) == pytest.approx(10, rel=0.4)  # a few pictures a second
        stage.sim.began, stage.sim.speed = 0.0, 1.0
        with page.expect_download() as download:
            page.locator("[aria-label='save the plot: effector: z']").dispatch_event("click")
        assert Path(download.value.path()).read_bytes()[:4] == b"\x89PNG"
        page.evaluate("Plots.prototype.draw = () => { window.drawn = (window.drawn ?? 0) + 1; }")
        opened.wait("window.drawn > 1")
        page.locator("#plots summary").dispatch_event("click")
        opened.wait("!document.querySelector('#plots').open")
        page.wait_for_timeout(100)
        before = page.evaluate("window.drawn")
        page.wait_for_timeout(500)
        assert page.evaluate("window.drawn") == before
        assert opened.errors == []


def test_the_path_of_the_ball_is_drawn(stage: Stage, browser: Any) -> None:
    show(stage.sim, "maze")
    stage.sim.publish_game(True, 0.002)
    with Opened(browser, stage, "screen") as opened:
        opened.text("#panel h1", "maze")
        opened.press("Just watch", "Top")
        stage.wait(
            lambda: stage.sim.publish_ball(0.01, -0.02, 0.03) or opened.page.locator("#path").is_visible()
        )
        opened.press("Path")
        assert opened.page.locator("#path").get_attribute("aria-pressed") == "true"

        def is_drawn() -> bool:
            for x in (0.01, 0.05):
                stage.sim.publish_ball(x, -0.04, 0.03)
                opened.page.wait_for_timeout(300)
            picture = imread(BytesIO(opened.page.locator("#picture").screenshot(scale="css")))[..., :3]
            return (np.abs(picture - np.array([194, 24, 91]) / 255).max(axis=2) < 0.2).sum() > 30

        stage.wait(is_drawn)
        opened.press("Path")
        assert opened.page.locator("#path").get_attribute("aria-pressed") == "false"
        assert opened.errors == []
    stage.sim.publish_game(False)


def test_a_camera_that_follows_the_ball_waits_for_one_that_is_lost(stage: Stage, browser: Any) -> None:
    show(stage.sim, "maze")
    stage.sim.publish_game(True, 0.004)
    there = (0.0, 0.0, 0.04)
    with Opened(browser, stage, "screen") as opened:
        page = opened.page
        opened.text("#panel h1", "maze")
        opened.press("Just watch")
        stage.wait(
            lambda: stage.sim.publish_ball(*there) or page.locator("#follow option[value='/ball']").count()
        )
        page.locator("#follow").select_option("/ball")
        page.wait_for_timeout(1000)
        stage.sim.publish_ball(0.0, 0.0, -5.0)
        page.wait_for_timeout(1000)
        before, box = place(opened, "servo 0"), stage_box(opened)
        assert box[0] < before[0] < box[2]
        assert box[1] < before[1] < box[3]
        opened.press("Front")
        stage.wait(lambda: place(opened, "servo 0") != before)
        front = place(opened, "servo 0")
        opened.press("Reset view")
        stage.wait(lambda: place(opened, "servo 0") != front)
        page.locator("#picture").hover(position={"x": 200, "y": 500})
        page.mouse.wheel(0, -480)  # to where the pointer is, away from the middle
        page.wait_for_timeout(500)
        stage.sim.publish_ball(*there)

        def is_in_the_middle() -> bool:
            box = page.locator("#picture").bounding_box()
            page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
            page.wait_for_timeout(200)
            return page.locator("#picked").text_content().startswith("ball")

        stage.wait(is_in_the_middle)
        assert opened.errors == []
    stage.sim.publish_game(False)


def saved_words(opened: Opened) -> str:
    """Save a picture; return what is written in it."""
    opened.page.evaluate(
        """() => {
            window.written = " ";
            const { prototype } = CanvasRenderingContext2D, write = prototype.fillText;
            prototype.fillText = function (text, ...place) {
                if (!this.canvas.isConnected) window.written += `${text} `;
                write.call(this, text, ...place);
            };
        }"""
    )
    with opened.page.expect_download() as download:
        opened.press("Save picture")
    assert Path(download.value.path()).read_bytes()[:4] == b"\x89PNG"
    return opened.page.evaluate("window.written")


def assert_the_legend_of_a_picture_fits(opened: Opened, whole: str) -> None:
    """All that is written is inside a picture of a phone, on a ground; what does not fit is counted."""
    ends = opened.page.evaluate(
        """async () => {
            const { prototype } = CanvasRenderingContext2D, { fillText, fillRect } = prototype;
            const texts = [], grounds = [];
            prototype.fillText = function (text, x, y) {
                if (!this.canvas.isConnected && this.textAlign !== "center")
                    texts.push([text, x, x + this.measureText(text).width, y]);
                fillText.call(this, text, x, y);
            };
            prototype.fillRect = function (x, y, w, h) {
                if (!this.canvas.isConnected && this.fillStyle.startsWith("rgba")) grounds.push([x, x + w, y, y + h]);
                fillRect.call(this, x, y, w, h);
            };
            const groups = Array.from({ length: 12 }, (_, i) =>
                ({ text: `normal force on body ${i} by the plate of the maze: 10 mm = 0.53 N, now 0.025 N`,
                    colour: "#555555" }));
            const canvas = document.createElement("canvas"), drawn = Object.assign(canvas, { width: 420, height: 320 });
            const one = { render() {}, canvas: drawn, ratio: 1, captions: () => [] };
            await View.prototype.screenshot.call(one, "#edf1f4", ["tripod, 0.1 s"], null, groups);
            Object.assign(prototype, { fillText, fillRect });
            return { texts, grounds };
        }"""
    )
    ((left, right, top, bottom),) = ends["grounds"]
    assert left >= 0
    assert right <= 420
    assert bottom <= 320
    assert top >= 0.4 * 320, "the scene is seen"
    for text, start, end, y in ends["texts"]:
        assert (left <= start, end <= right, top <= y - 8, y <= bottom) == (True,) * 4, text
    told = " ".join(text for text, *_ in ends["texts"])
    bodies = len(set(re.findall(r"on body \d+", told)))
    assert bodies >= 3
    messages.assert_names(told, f"and {12 - bodies} more", "tripod")
    assert "more" not in whole


def assert_forces_are_those_of_now(
    opened: Opened, stage: Stage, publish: Callable[[], None], load: Forces
) -> None:
    """Forces have the size and the scale of now, those of before a reset are forgotten."""

    def squares() -> float:
        """Return force over length of an arrow as the legend tells it [N/mm]."""
        found = re.search(r"([\d.]+) mm = ([\d.e-]+) N", opened.page.locator("#arrows").inner_text())
        return float(found[2]) / float(found[1]) if found else float("nan")

    def told(force: float) -> bool:
        load.vectors = array("d", [0.0, 0.0, -force])
        publish()
        opened.page.wait_for_timeout(100)
        return f"now {force:g} N" in opened.page.locator("#arrows").inner_text()

    before = squares()
    stage.wait(lambda: told(2.0))
    assert squares() == before, "a scale that changes each time cannot be read"
    stage.wait(lambda: told(0.025))
    assert squares() == pytest.approx(0.01 * before, rel=0.1)
    stage.sim.state, stage.sim.began = SimStatus.PAUSED, time.monotonic()  # a reset
    opened.wait("document.querySelector('#arrows label').hidden")
    opened.wait("document.querySelector('#arrows').dataset.note.includes('next step')")
    stage.sim.state = SimStatus.RUNNING
    stage.wait(lambda: told(2.5))
    stage.sim.began = 0.0


def test_bodies_are_coloured_by_a_field_and_forces_are_drawn(stage: Stage, browser: Any) -> None:
    show(stage.sim, "silicone")
    topic = names.field_topic("von_mises")
    stress, forces = (
        stage.sim.create_publisher(kind, name, RELIABLE)
        for kind, name in ((Field, topic), (Forces, names.FORCES))
    )
    count, crc = len(stage.sim.body[0]), crc32(stage.sim.body[1].tobytes())
    field = Field(topology_id=crc, unit="Pa", values=array("f", np.linspace(100, 5e3, count).tolist()))
    field.values[7] = float("nan")
    load = Forces(names=["load"], units=["N"], counts=[1], points=[0.0] * 3, vectors=[0.0, 0.0, -2.5])
    limits = "['low', 'high'].map((end) => document.querySelector(`#legend-${end}`).value).join()"

    def until(opened: Opened, publish: Callable[[], None], condition: str) -> None:
        stage.wait(lambda: publish() or opened.page.evaluate(f"() => Boolean({condition})"))

    with Opened(browser, stage, "screen") as opened:
        page = opened.page
        opened.press("Just watch")
        opened.wait("document.querySelector('#colour option[value=von_mises]')")
        assert page.locator("#legend").is_hidden()
        page.locator("#colour").select_option("von_mises")
        until(opened, lambda: stress.publish(field), f"{limits} === '100,5000'")
        opened.text("#legend", "von Mises", "Pa", f"1 of {count}")
        opened.text("#legend-largest", "largest", "5 kPa")
        before = place(opened, "x")
        page.locator("#legend-largest").click()
        stage.wait(lambda: place(opened, "x") != before)
        page.locator("#legend-high").fill("4000")
        page.locator("#legend-high").press("Enter")
        opened.wait("document.querySelector('#legend-fixed').getAttribute('aria-pressed') === 'true'")
        field.values[-1] = 9e3
        stress.publish(field)
        assert page.evaluate(limits) == "100,4000"
        page.locator("#legend-fixed").click()
        until(opened, lambda: stress.publish(field), f"{limits} === '100,9000'")
        opened.press("Reset view")
        stage.wait(lambda: on_body(opened, stage_box(opened)))
        opened.wait("document.querySelector('#picked').textContent.includes('von Mises')")
        opened.press("Plot")
        until(
            opened,
            lambda: stress.publish(field),
            "[...document.querySelectorAll('.plot h2')].some((e) => e.textContent.includes('von Mises stress [Pa]'))",
        )
        assert page.locator("#arrows").is_hidden()
        opened.press("Forces")
        until(opened, lambda: forces.publish(load), "document.querySelector('#arrows input')")
        opened.text("#arrows", "load", "now 2.5 N")
        assert re.search(r"mm = [\d.]+ N", page.locator("#arrows").inner_text())
        assert page.locator("#arrows input").is_checked()
        assert_forces_are_those_of_now(opened, stage, lambda: forces.publish(load), load)
        written = saved_words(opened)
        messages.assert_names(
            written, "von Mises", "Pa", "100", "9 kPa", "load", "2.5 N", "silicone", "0.000 s"
        )
        assert " x " in written, "the labels over the picture"
        assert_the_legend_of_a_picture_fits(opened, written)
        page.locator("#arrows input").uncheck()
        assert "2.5 N" not in saved_words(opened)
        opened.press("Forces")
        stage.wait(lambda: forces.get_subscription_count() == 0)
        stage.sim.state = SimStatus.PAUSED
        opened.press("Forces")
        opened.wait(
            "getComputedStyle(document.querySelector('#arrows'), '::after').content.includes('next step')"
        )
        stage.sim.state = SimStatus.RUNNING
        opened.wait("document.querySelector('#arrows').hidden")
        opened.press("Forces")
        page.locator("#colour").select_option("")
        stage.wait(lambda: stress.get_subscription_count() == forces.get_subscription_count() == 0)
        opened.wait("document.querySelector('#legend').hidden && document.querySelector('#arrows').hidden")
        assert opened.errors == []
    stage.destroy(stress, forces)
