"""Each control of the player in a real browser, from a file without a network."""

import csv
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("playwright")

from matplotlib.image import imread
from playwright.sync_api import sync_playwright

from tests import messages
from tests.view.test_player import EVENT, coloured
from tripod_view.player.colour_maps import MAPS
from tripod_view.player.film import Arrows, Curve, Film
from tripod_view.player.html import write_html
from tripod_view.player.packing import stage

CHROMIUM = next((p for n in ("chromium", "chromium-browser", "google-chrome") if (p := shutil.which(n))), "")
FLAGS = (
    "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic",
    "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
DEADLINE = 60e3  # [ms]
PNG = b"\x89PNG"

pytestmark = pytest.mark.skipif(not CHROMIUM, reason="no Chromium; to install: sudo apt-get install chromium")


def shown_film() -> Film:
    """A sheet that waves, with a field and a force at its middle, beside a ball that rolls."""
    film = coloured(np.linspace(0.0, 35.0, 36) * np.array([[1.0], [2.0], [1.0], [1.0]]))
    force = Arrows(
        "load", "N", (0, 90, 0), np.ones(4, int), np.zeros((4, 3)), np.tile([0.0, 0.0, 2.5], (4, 1))
    )
    return replace(film, title="toy", arrows=(force,), colouring=None)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        yield opened
        opened.close()


def same(one: np.ndarray, other: np.ndarray) -> bool:
    """Return whether two pictures are the same, but for how the browser rounds the background."""
    return bool((np.abs(one - other) < 0.01).all())


class Player:
    """The player of a film in a browser, at rest at a time; `errors` keeps what its console complains of."""

    def __init__(self, browser: Any, path: Path) -> None:
        self.page = browser.new_page(viewport={"width": 1000, "height": 700}, offline=True)
        self.page.set_default_timeout(DEADLINE)
        self.errors: list[str] = []
        self.page.on("console", lambda m: self.errors.append(m.text) if m.type == "error" else None)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        own = ("file:", "data:", "blob:")
        self.page.on("request", lambda r: None if r.url.startswith(own) else self.errors.append(r.url))
        self.page.goto(f"{path.as_uri()}#t=0.5")
        self.clock("0.50")

    def wait(self, condition: str) -> None:
        """Wait until a JavaScript expression is true."""
        self.page.wait_for_function(f"() => {condition}", polling=50)

    def clock(self, time: str) -> None:
        """Wait until the clock shows a time [s]."""
        self.wait(f"document.querySelector('#clock').textContent.startsWith('{time} of')")

    @property
    def time(self) -> float:
        return self.page.evaluate("Number(document.querySelector('#time').value)")

    def pixels(self) -> np.ndarray:
        """Return the picture, once it is drawn, without what lies over it, shape (rows, columns, 3), 0 to 1."""
        self.page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        return imread(BytesIO(self.page.locator("#picture").screenshot()))[110:450, :, :3]

    def changes(self, act: Any) -> bool:
        """Return whether something changes the picture."""
        before = self.pixels()
        act()
        return not same(self.pixels(), before)

    def download(self, act: Any) -> tuple[str, bytes]:
        """Return name and content of the file that something saves."""
        with self.page.expect_download() as saved:
            act()
        return saved.value.suggested_filename, Path(saved.value.path()).read_bytes()

    def plots(self) -> list[str]:
        """Return the headings of the plots."""
        return self.page.evaluate(
            "[...document.querySelectorAll('.plot h2')].map((e) => e.firstChild.textContent)"
        )


@pytest.fixture
def player(browser: Any, tmp_path: Path) -> Iterator[Player]:
    path = tmp_path / "film.html"
    write_html(shown_film(), path)
    opened = Player(browser, path)
    yield opened
    opened.page.close()
    assert opened.errors == []


def test_it_plays_as_fast_as_told_and_goes_to_any_time(player: Player) -> None:
    page = player.page
    page.locator("#play").click()
    player.wait("document.querySelector('#time').value > 0.5")
    page.locator("#speed").select_option("10")
    player.clock("1.50")
    player.wait("document.querySelector('#play').textContent === '▶'")
    page.locator("#speed").select_option("0.02")
    page.locator("#picture").focus()
    page.keyboard.press("Home")
    player.clock("0.00")
    page.keyboard.press(" ")
    shares = page.evaluate(
        """async () => {
            const moment = () => new Promise((done) => requestAnimationFrame((now) =>
                setTimeout(() => done([now / 1000, Number(document.querySelector("#time").value)]))));
            const [t, a] = await moment(), [u, b] = [await moment(), await moment(), await moment()].at(-1);
            return [(b - a) / (u - t), b - a];
        }"""
    )
    assert shares[1] > 0
    assert shares[0] < 0.021
    page.keyboard.press(" ")
    for key, time in (("ArrowRight", "0.50"), ("ArrowRight", "1.00"), ("ArrowLeft", "0.50"), ("End", "1.50")):
        page.keyboard.press(key)
        player.clock(time)
    page.locator("#time").evaluate("(e) => { e.value = 0.25; e.dispatchEvent(new Event('input')) }")
    player.clock("0.25")
    page.get_by_text(EVENT).click()
    player.clock("0.50")


def test_the_camera_goes_where_it_is_told(player: Player) -> None:
    page, first, seen = player.page, player.pixels(), []
    for name, key in (("home", "r"), ("top", "t"), ("front", "w"), ("side", "s"), ("fit", "f")):
        page.locator(f"#{name}").click()
        seen.append(player.pixels())
        page.locator("#home").click()
        page.keyboard.press(key)
        assert same(player.pixels(), seen[-1]), name
        if name != "fit":
            page.locator("#home").click()
    assert same(seen[0], first)
    for i in range(4):
        assert not any(same(seen[i], other) for other in seen[:i])
    page.locator("#home").click()
    box = page.locator("#picture").bounding_box()
    x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]

    def drag() -> None:
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x, y - 400, steps=4)
        page.mouse.up()

    def wheel() -> None:
        page.mouse.move(x, y)
        page.mouse.wheel(0, -300)

    assert player.changes(wheel)
    page.locator("#home").click()
    drag()
    above = player.pixels()
    page.locator("#home").click()
    page.keyboard.press("b")
    assert page.locator("#below").get_attribute("aria-pressed") == "true"
    drag()
    assert not same(player.pixels(), above)


def test_the_camera_follows_what_it_is_told(player: Player) -> None:
    page = player.page
    assert page.locator("#follow option").all_text_contents() == [
        "stand still",
        "follow bodies",
        "follow ball",
    ]

    def column() -> float:
        """Return the column of the ball."""
        image = player.pixels()
        red = (image[..., 0] > image[..., 1] + 0.3) & (image[..., 2] < 0.35)
        return float(np.nonzero(red)[1].mean())

    page.locator("#follow").select_option(label="follow ball")
    before = column()
    page.keyboard.press("End")
    player.clock("1.50")
    assert column() == pytest.approx(before, abs=2)
    page.locator("#follow").select_option(label="stand still")
    assert abs(column() - before) > 20


def count(image: np.ndarray, colour: tuple[int, int, int]) -> int:
    """Return how many pixels have about that colour."""
    return int((np.abs(image - np.array(colour) / 255).max(axis=2) < 0.12).sum())


def test_mesh_path_and_forces_are_switched_on_and_off(player: Player) -> None:
    page, plain = player.page, player.pixels()
    for name, key in (("lines", "l"), ("path", "c")):
        assert player.changes(page.locator(f"#{name}").click)
        assert page.locator(f"#{name}").get_attribute("aria-pressed") == "true"
        page.keyboard.press(key)
        assert same(player.pixels(), plain)
    page.keyboard.press("End")
    page.locator("#path").click()
    assert count(player.pixels(), (194, 24, 91)) > 20
    page.locator("#path").click()
    assert player.changes(page.locator("#arrow-0").check)
    player.wait("document.querySelector('#arrows').textContent.includes('2.5')")
    messages.assert_names(page.locator("#arrows label").inner_text(), "load", "2.5 N")
    drawn = re.search(r"([\d.]+) mm = ([\d.]+) N", page.locator("#arrows label").inner_text())
    assert drawn
    longest = 0.4 * stage(shown_film())["camera"]["radius"]  # [m]
    assert float(drawn[1]) / float(drawn[2]) == pytest.approx(1e3 * longest / 2.5, rel=0.05)
    page.locator("#arrow-0").uncheck()


def test_the_surface_is_coloured_in_a_range_that_one_fixes(player: Player) -> None:
    page = player.page
    assert not page.locator("#legend").is_visible()
    assert player.changes(lambda: page.locator("#colour").select_option("heat"))
    assert page.locator("#legend-title").inner_text() == "heat [K]"

    def ends() -> list[float]:
        return [float(page.locator(f"#legend-{end}").input_value()) for end in ("low", "high")]

    assert ends() == pytest.approx([0, 70], abs=0.3)
    page.keyboard.press("End")
    player.clock("1.50")
    assert ends() == pytest.approx([0, 70], abs=0.3), "the range of the whole film"
    assert page.locator("#legend-fixed").get_attribute("aria-pressed") == "true"
    page.locator("#legend-fixed").click()
    player.wait("Number(document.querySelector('#legend-high').value) < 36")
    assert ends() == pytest.approx([0, 35], abs=0.3)
    page.locator("#legend-fixed").click()
    player.wait("Number(document.querySelector('#legend-high').value) > 69")
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("ArrowLeft")
    player.clock("0.50")

    def type_high() -> None:
        page.locator("#legend-high").fill("700")
        page.locator("#legend-high").press("Enter")

    assert player.changes(type_high)
    page.locator("#legend-fixed").click()
    page.locator("#legend-fixed").click()
    player.wait("Math.abs(Number(document.querySelector('#legend-high').value) - 70) < 1")
    page.locator("#colour").select_option("")
    assert not page.locator("#legend").is_visible()


def test_the_largest_value_is_told_marked_and_looked_at(player: Player) -> None:
    page = player.page
    page.locator("#colour").select_option("heat")
    text = page.locator("#legend-largest")
    player.wait("!document.querySelector('#legend-largest').hidden")
    assert re.fullmatch(r"largest (69\.\d|70) K", text.inner_text())
    page.keyboard.press("End")
    player.clock("1.50")
    player.wait("document.querySelector('#legend-largest').textContent.includes(' 3')")

    def ring() -> np.ndarray:
        """Return the middle of what the ring changes in the picture [px]."""
        with_it = player.pixels()
        page.evaluate("""() => {
            View.prototype.placeRing = function () { this.ring.visible = false; };
            dispatchEvent(new Event("resize"));
        }""")
        changed = np.argwhere((np.abs(player.pixels() - with_it) > 0.05).any(axis=2))
        page.evaluate("""() => {
            View.prototype.placeRing = window.ringPlaced;
            dispatchEvent(new Event("resize"));
        }""")
        assert 40 < len(changed) < 600
        assert np.ptp(changed, axis=0).max() < 30
        return changed.mean(axis=0)

    page.evaluate("() => { window.ringPlaced = View.prototype.placeRing }")
    before = ring()
    text.click()
    box = page.locator("#picture").bounding_box()
    middle = np.array([0.5 * box["height"] - 110, 0.5 * box["width"]])
    assert np.abs(ring() - middle).max() < 4
    assert np.abs(before - middle).max() > 40
    page.locator("#colour").select_option("")
    plain = player.pixels()
    page.evaluate("""() => {
        View.prototype.placeRing = function () { this.ring.visible = false; };
        dispatchEvent(new Event("resize"));
    }""")
    assert same(player.pixels(), plain), "nothing is marked without a colour"


def test_how_far_nodes_moved_is_a_colour(player: Player) -> None:
    positions = shown_film().bodies[0].positions
    player.page.locator("#colour").select_option("moved since the first picture")
    player.page.keyboard.press("End")
    player.clock("1.50")
    if player.page.locator("#legend-fixed").get_attribute("aria-pressed") == "true":
        player.page.locator("#legend-fixed").click()
    far = 1e3 * np.linalg.norm(positions[-1] - positions[0], axis=1).max()
    player.wait(f"Math.abs(Number(document.querySelector('#legend-high').value) - {far}) < {0.01 * far}")


def test_a_plot_shows_rounding_as_zero(browser: Any, tmp_path: Path) -> None:
    values = np.stack([np.linspace(1.0, 4.0, 4), np.full(4, -6e-15), np.full(4, 1e-6)], axis=1)
    curve = Curve("place", "mm", ("x", "y", "z"), values)
    write_html(replace(shown_film(), curves=(curve,)), tmp_path / "film.html")
    player = Player(browser, tmp_path / "film.html")
    shown = player.page.locator(".plot .legend").inner_text().split()
    assert shown[0] == "x"
    assert 1.0 <= float(shown[1]) <= 4.0
    assert shown[2:] == ["y", "0", "z", "0.000001"]
    player.page.close()
    assert player.errors == []


def test_a_click_on_a_body_tells_the_node_and_plots_it(player: Player) -> None:
    page, box = player.page, player.page.locator("#picture").bounding_box()
    page.locator("#colour").select_option("heat")
    page.locator("#top").click()
    middle = {"x": 0.5 * box["width"], "y": 0.5 * box["height"] + 30}
    page.locator("#picture").click(position=middle)
    player.wait("document.querySelector('#picked').textContent")
    told = page.locator("#picked").inner_text()
    found = re.fullmatch(r"sheet, node (\d+) at (.*) mm; heat ([\d.]+) K", told)
    assert found, told
    node, values = int(found[1]), [1e-3 * float(v.split()[1]) for v in found[2].split(",")]
    np.testing.assert_allclose(values, shown_film().bodies[0].positions[1, node], atol=6e-4)
    assert float(found[3]) == pytest.approx(2 * node, abs=0.3)
    page.locator("#plot-picked").click()
    assert player.plots() == ["height [mm]", f"sheet, node {node} [mm]"]
    name, content = player.download(page.locator("[aria-label^='save the numbers: sheet']").click)
    assert name == f"sheet-node-{node}.csv"
    head, *rows = content.decode().splitlines()
    assert next(csv.reader([head])) == ["time [s]", "x [mm]", "y [mm]", "z [mm]"]
    table = np.array([row.split(",") for row in rows], float)
    np.testing.assert_allclose(table[:, 1:], 1e3 * shown_film().bodies[0].positions[:, node], atol=0.01)
    page.locator("#picture").click(position={"x": 30, "y": box["height"] - 120})
    player.wait("!document.querySelector('#plot-picked').checkVisibility()")


def test_forces_that_are_rounding_are_told_but_not_drawn(browser: Any, tmp_path: Path) -> None:
    (load,) = shown_film().arrows
    path = tmp_path / "rounding.html"
    tiny = replace(load, name="friction", vectors=1e-7 * load.vectors)
    write_html(replace(shown_film(), arrows=(load, tiny)), path)
    player = Player(browser, path)
    before = player.pixels()[40:]  # below the boxes
    player.page.locator("#arrow-1").check()
    assert same(player.pixels()[40:], before)
    messages.assert_names(player.page.locator("#arrows label").nth(1).inner_text(), "friction", "2.5e-7 N")
    player.page.locator("#arrow-0").check()
    assert not same(player.pixels()[40:], before)
    player.page.close()
    assert player.errors == []


def test_the_ball_is_clicked_and_plotted_with_its_contact_force(browser: Any, tmp_path: Path) -> None:
    names = ("normal force on ball by plate", "friction on ball by plate", "friction on plate by ball")
    forces = tuple(
        Arrows(name, "N", (0, 90, 0), np.ones(4, int), np.zeros((4, 3)), np.tile(vector, (4, 1)))
        for name, vector in zip(names, ([0.0, 0.0, 0.4], [0.3, 0.0, 0.0], [-0.3, 0.0, 0.0]), strict=True)
    )
    path = tmp_path / "ball.html"
    write_html(replace(shown_film(), arrows=forces), path)
    player = Player(browser, path)
    page, box = player.page, player.page.locator("#picture").bounding_box()
    page.locator("#follow").select_option(label="follow ball")
    page.locator("#top").click()
    page.locator("#picture").click(position={"x": 0.5 * box["width"], "y": 0.5 * box["height"]})
    player.wait(
        r"/^ball at x 50[.0]*, y 0[.0]*, z 60[.0]* mm/.test(document.querySelector('#picked').textContent)"
    )
    told = page.locator("#picked").inner_text()
    messages.assert_names(told, "speed 100 mm/s", "contact force 0.5 N")  # 0.1 m/s; 0.4 N and 0.3 N
    page.locator("#plot-picked").click()
    assert player.plots()[1:] == ["ball [mm]", "ball, speed [mm/s]", "ball, contact force [N]"]
    _, content = player.download(page.locator("[aria-label='save the numbers: ball, speed']").click)
    assert [float(row.split(",")[1]) for row in content.decode().splitlines()[1:]] == pytest.approx(
        [100] * 4, rel=1e-3
    )
    page.close()
    assert player.errors == []


def test_nodes_that_nobody_sees_are_not_told_as_grey(browser: Any, tmp_path: Path) -> None:
    made = shown_film()
    body, *others = made.bodies
    count, (field, *rest) = body.positions.shape[1], body.fields
    values = np.concatenate([field.values, np.full((len(field.values), 2), np.nan)], axis=1)
    values[:, 3] = np.nan
    body = replace(
        body,
        positions=np.concatenate([body.positions, body.positions[:, :2]], axis=1),
        fields=(replace(field, values=values), *(replace(f, values=values) for f in rest)),
    )
    path = tmp_path / "inner.html"
    write_html(replace(made, bodies=(body, *others)), path)
    player = Player(browser, path)
    player.page.locator("#colour").select_option(field.name)
    player.wait("document.querySelector('#legend-note').textContent")
    messages.assert_names(player.page.locator("#legend-note").inner_text(), f"1 of {count}", "rigid")
    player.page.close()
    assert player.errors == []


def test_plots_are_added_shared_removed_and_saved(player: Player) -> None:
    page = player.page
    assert player.plots() == ["height [mm]"]
    name, content = player.download(page.locator("[aria-label='save the numbers: height']").click)
    assert name == "height.csv"
    head, *rows = content.decode().splitlines()
    assert next(csv.reader([head])) == ["time [s]", "a [mm]", "b [mm]"]
    assert rows == [
        "0,0,",
        "0.5,0.5,",
        "1,1,",
        "1.5,1.5,",
    ]
    name, content = player.download(page.locator("[aria-label='save the plot: height']").click)
    assert (name, content[:4]) == ("height.png", PNG)
    page.locator("#more").select_option(label="height: a")
    assert player.plots() == ["height [mm]", "height: a [mm]"]
    page.locator("#more").select_option("1|height: b")
    player.wait("document.querySelectorAll('.plot .legend')[1].querySelectorAll('b').length === 2")
    page.locator("[aria-label='remove the plot: height']").click()
    assert player.plots() == ["height: a [mm]"]
    canvas = page.locator(".plot canvas")
    width = canvas.bounding_box()["width"]
    canvas.click(position={"x": width - 7, "y": 40})
    player.wait("Number(document.querySelector('#time').value) > 1.4")


def test_a_picture_is_saved_and_the_plots_are_hidden_and_resized(player: Player) -> None:
    page = player.page
    page.locator("#colour").select_option("heat")
    name, content = player.download(page.locator("#shot").click)
    assert name == "toy.png"
    picture = imread(BytesIO(content))[..., :3]
    assert count(picture, (0x33, 0x33, 0x33)) > 30  # words
    corner = picture[int(0.8 * len(picture)) :, : len(picture) // 2]
    assert all(count(corner, shade) > 2 for shade in (MAPS["plain"][0], MAPS["plain"][-1]))  # the legend
    wide = page.locator("#stage").bounding_box()["width"]
    page.locator("#panel").click()
    assert not page.locator("#panels").is_visible()
    assert page.locator("#stage").bounding_box()["width"] > wide + 200
    page.keyboard.press("h")
    bar = page.locator("#split").bounding_box()
    page.mouse.move(bar["x"] + 3, bar["y"] + 100)
    page.mouse.down()
    page.mouse.move(bar["x"] - 97, bar["y"] + 100, steps=3)
    page.mouse.up()
    assert page.locator("#stage").bounding_box()["width"] == pytest.approx(wide - 100, abs=8)
    for opens in (page.locator("#help").click, lambda: page.keyboard.press("?")):
        opens()
        assert page.locator("#sheet").is_visible()
        page.locator("#sheet button").click()
        assert not page.locator("#sheet").is_visible()
