"""The page in a real browser: every control of every shipped scene, on a screen and on a phone.

The simulator's side of the page is played by a node that publishes what the real one would of each scene: its mesh, its
picture, its figures; `FakeSimulator` moves the joints. So the page is driven as it is, and no scene is simulated.
"""

import shutil
from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")
pytest.importorskip("viser")
pytest.importorskip("playwright")

from playwright.sync_api import sync_playwright
from std_msgs.msg import String
from tripod_msgs.msg import ControlMode

from tests.domains import own_domain
from tests.view.shown_scene import show
from tests.view.stage import DEADLINE, Stage
from tripod_graph import names
from tripod_sim.scene_file import scene_names

NAMES = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM = next((path for name in NAMES if (path := shutil.which(name))), "")
FLAGS = (
    "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
SIZES = {"screen": (1400, 900), "phone": (390, 844)}

pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(not CHROMIUM, reason="no Chromium is installed: apt-get install chromium"),
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
        self.page = browser.new_page(viewport={"width": width, "height": height}, has_touch=size == "phone")
        self.page.set_default_timeout(1e3 * DEADLINE)
        self.errors: list[str] = []
        self.page.on("console", lambda m: self.errors.append(m.text) if m.type == "error" else None)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        own = stage.url.rpartition("/")[0]
        self.page.on(
            "request", lambda r: r.url.startswith((own, "data:", "blob:")) or self.errors.append(r.url)
        )
        self.page.goto(stage.url)

    def __enter__(self) -> "Opened":
        return self

    def __exit__(self, *_: object) -> None:
        self.page.close()

    def wait(self, condition: str) -> None:
        """Wait until a JavaScript expression is true."""
        self.page.wait_for_function(f"() => {condition}")

    def text(self, selector: str, words: str) -> None:
        """Wait until an element shows words."""
        self.page.wait_for_function(
            "([s, w]) => document.querySelector(s)?.textContent.includes(w)", arg=[selector, words]
        )

    def box(self, selector: str) -> dict[str, float]:
        return self.page.locator(selector).bounding_box()


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("scene", scene_names())
def test_every_control_of_every_scene_does_what_it_says(
    stage: Stage, browser: Any, scene: str, size: str
) -> None:
    shown = show(stage.sim, scene)
    asked: list[str] = []
    requests = stage.sim.create_subscription(String, names.SIM_REQUEST, lambda m: asked.append(m.data), 10)
    with Opened(browser, stage, size) as opened:
        page = opened.page
        opened.text("#panel h1", scene)
        assert page.title() == f"{scene} - Tripod"
        opened.wait("document.querySelector('#simulated').offsetParent !== null")
        opened.wait("[...document.querySelectorAll('#root canvas')].some((c) => c.width > 100)")
        check_layout(opened, size)
        label = page.locator("#begin").inner_text()
        assert ("Move" in label or "Play" in label) == (shown["servos"] is not None)
        page.locator("#begin").click()
        assert page.locator("#start").count() == 0
        for card in page.locator("#panel details").all():
            card.evaluate("e => e.open = true")
        assert page.locator("#servos").is_visible() == (shown["servos"] is not None)
        assert page.locator("#target").is_visible() == (shown["effector"] is not None)
        assert page.get_by_text("Drop the ball").is_visible() == (shown["ball"] is not None)
        press_everything(opened, stage, asked)
        if shown["servos"]:
            drive(opened, stage)
        assert len(page.locator("#on .chip").all()) == sum(e["on"] for e in shown["effects"])
        assert len(page.locator("#off .chip").all()) == sum(not e["on"] for e in shown["effects"])
        assert page.locator("#offers tr").count() == (6 if shown["accuracy"]["study"] else 0)
        opened.text("#stable", "energy balance")
        assert opened.errors == []
    stage.sim.destroy_subscription(requests)
    stage.wait(lambda: stage.watchers() == 0)


def check_layout(opened: Opened, size: str) -> None:
    """STOP and the 3-D view are both in sight, and nothing is wider than the screen."""
    width, height = SIZES[size]
    stop, root, panel = (opened.box(s) for s in ("#stop", "#root", "#panel"))
    assert stop["height"] >= 44
    for box in (stop, root):
        assert box["x"] >= 0
        assert box["y"] >= 0
        assert box["x"] + box["width"] <= width
        assert box["y"] + box["height"] <= height
        assert box["width"] * box["height"] > 0
    assert root["height"] >= 0.4 * height
    assert root["y"] + root["height"] <= panel["y"] or root["x"] + root["width"] <= panel["x"]
    assert opened.page.locator("#panel").evaluate("e => e.scrollWidth - e.clientWidth") <= 0


def press_everything(opened: Opened, stage: Stage, asked: list[str]) -> None:
    """Press what every scene has, and see it arrive."""
    page = opened.page
    for label, request in (
        ("Reset", "reset"),
        ("Pause", "pause"),
        ("Step", "step"),
        ("Drop the ball", "drop"),
    ):
        button = page.get_by_role("button", name=label, exact=True)
        if button.is_visible():
            button.click()
            stage.wait(lambda wanted=f'{{"do": "{request}"}}': wanted in asked)
    for label in ("Fit view", "Mesh lines", "Mesh lines", "Replay", "Now"):
        page.get_by_role("button", name=label, exact=True).click()
    page.locator("#replay input").focus()
    page.keyboard.press("ArrowLeft")
    opened.wait("document.body.classList.contains('past')")
    page.get_by_role("button", name="Now", exact=True).click()
    opened.wait("!document.body.classList.contains('past')")
    page.locator("#off .chip").first.click()
    stage.wait(lambda: any('"on": true' in request for request in asked))
    page.locator("#on .chip").first.click()
    stage.wait(lambda: any('"on": false' in request for request in asked))
    for offer in page.locator("#offers button:enabled").all():
        offer.click()
    if page.locator("#offers button:enabled").count():
        stage.wait(lambda: any("accuracy" in request for request in asked))
    page.locator("body").press("Escape")
    stage.wait(lambda: stage.mode() and stage.mode()[0] == ControlMode.STOP)


def drive(opened: Opened, stage: Stage) -> None:
    """Take control, move servos by slider, by typing and by keys, and stop in each way that there is."""
    page, sim = opened.page, stage.sim
    page.locator("#drive").click()
    stage.wait(lambda: stage.mode()[0] == ControlMode.TELEOP)
    opened.wait("!document.querySelector('.servo input').disabled")

    def asks(servo: int) -> float:
        return sim.commands[-1].points[-1].positions[servo] if sim.commands else float("nan")

    slider = page.locator(".servo:not(.slide) input[type=range]").nth(1)
    slider.evaluate("e => { e.value = -30; e.dispatchEvent(new Event('input')) }")
    stage.wait(lambda: abs(asks(1) + 0.5236) < 1e-3)
    number = page.locator(".servo:not(.slide) input[type=number]").first
    number.fill("-400")
    number.press("Enter")
    opened.text("#notice", "servo 0: -400.0 degrees is beyond")
    stage.wait(lambda: abs(asks(0) + 2.1) < 1e-3)
    page.locator(".servo.slide input").first.evaluate(
        "e => { e.value = 10; e.dispatchEvent(new Event('input')) }"
    )
    stage.wait(lambda: len(sim.commands[-1].joint_names) == 4 and abs(asks(3) - 0.01) < 1e-6)
    page.locator("#stop").focus()
    before = asks(2)
    page.keyboard.down("+")
    stage.wait(lambda: asks(2) > before + 0.02)
    page.keyboard.up("+")
    page.keyboard.press(" ")
    stage.wait(lambda: stage.mode()[0] == ControlMode.STOP)
    for key, mode in (("t", ControlMode.TELEOP), ("i", ControlMode.IK)):
        page.keyboard.press(key)
        stage.wait(lambda wanted=mode: stage.mode()[0] == wanted)
    page.get_by_role("button", name="Bring target to effector").click()
    for label in ("Working pose", "Park"):
        page.get_by_role("button", name=label, exact=True).click()
        opened.text("#notice", f"to the {label.lower()}")
    page.locator("#stop").click()
    stage.wait(lambda: stage.mode()[0] == ControlMode.STOP)


def test_a_goal_and_a_lost_ball_are_told(stage: Stage, browser: Any) -> None:
    show(stage.sim, "maze")
    with Opened(browser, stage, "screen") as opened:
        show(stage.sim, "maze", event="goal reached at 3.20 s")
        opened.text("#event.good", "goal reached at 3.20 s")
        show(stage.sim, "maze", event="ball fell through a hole at 4.00 s")
        opened.text("#event.bad", "ball fell through a hole")
        assert opened.errors == []


def test_a_page_that_lost_its_node_says_so_and_comes_back(stage: Stage, browser: Any) -> None:
    """Also: texts from the network stay texts."""
    show(stage.sim, "tripod", name="<img src=x onerror=alert(1)>")
    with Opened(browser, stage, "screen") as opened:
        opened.text("#panel h1", "<img src=x")
        assert opened.page.locator("#panel img").count() == 0
        opened.page.evaluate("WebSocket.prototype.send = function () { this.close() }")
        opened.page.locator("#stop").click()  # its channel is cut
        opened.wait("document.body.classList.contains('lost')")
        opened.wait("!document.body.classList.contains('lost')")
