"""Take pictures of the live page of scenes for the documentation: `python docs/page_pictures.py`.

With names of pictures only those are taken. Each runs `tripod up` for a while, then opens the page. The browser opens
late because without a graphics card its drawing slows the simulation down. The figures on the page are those of this
machine: run it on one that does nothing else. Needs Chromium; `own_2` needs bridge.vtk and bridge.toml of
docs/own_robot.md in the working directory.
"""

import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

IMAGES = Path(__file__).parent / "images"
FLAGS = (
    "--no-sandbox",
    "--use-gl=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
)
PATIENCE, SETTLED, DRAWN = 600.0, 10.0, 2.0  # [s]
QUALITY, MOST_BYTES = 80, 60_000
"""Quality of the WebP; largest file."""

BALL_PLACES = ((0, 0), (6, 0), (-6, 0), (0, 6), (0, -6), (12, 0), (-12, 0), (0, 12), (0, -12))
"""Where the followed ball may be, from the middle of the picture [px]."""

RUNS = "document.body.classList.contains('has-known') && document.querySelector('#run').textContent"
"""Condition in a page: the simulator runs."""

Step = Callable[[Page], None]


def press(selector: str) -> Step:
    """Return a step that clicks an element, also one that is out of sight."""
    return lambda page: page.locator(selector).dispatch_event("click")


def choose(selector: str, value: str) -> Step:
    """Return a step that selects an option."""
    return lambda page: (
        page.wait_for_selector(f"{selector} option[value='{value}']", state="attached")
        and (page.locator(selector).select_option(value))
    )


def fill(label: str, text: str) -> Step:
    """Return a step that types into the field of that label."""
    return lambda page: page.get_by_label(label).fill(text)


def colour(field: str) -> Step:
    """Return a step that colours bodies by a field and waits for its values."""

    def choose_field(page: Page) -> None:
        choose("#colour", field)(page)
        page.locator("#legend-largest").wait_for(state="visible")

    return choose_field


def wait(seconds: float) -> Step:
    """Return a step that waits [s]."""
    return lambda page: page.wait_for_timeout(1e3 * seconds)


def place(page: Page, across: float, down: float) -> tuple[float, float]:
    """Return a place [px], given as shares of width and height of the 3-D picture."""
    box = page.locator("#picture").bounding_box()
    if box is None:
        raise SystemExit("the page shows no 3-D picture: Chromium needs WebGL 2")
    return box["x"] + across * box["width"], box["y"] + down * box["height"]


def click(across: float, down: float) -> Step:
    """Return a step that clicks on a place of the 3-D picture, given as shares of its width and height."""
    return lambda page: page.mouse.click(*place(page, across, down))


def zoom(notches: int, across: float = 0.5, down: float = 0.5) -> Step:
    """Return a step that turns the mouse wheel towards a place of the 3-D picture."""

    def turn(page: Page) -> None:
        page.mouse.move(*place(page, across, down))
        for _ in range(abs(notches)):
            page.mouse.wheel(0, -120 if notches > 0 else 120)
            page.wait_for_timeout(50)
        page.mouse.move(*place(page, 0.02, 0.5))  # away from the handle, which it would highlight

    return turn


def drag(start: tuple[float, float], end: tuple[float, float]) -> Step:
    """Return a step that drags with the mouse and holds its button."""

    def hold(page: Page) -> None:
        page.mouse.move(*place(page, *start))
        page.mouse.down()
        page.mouse.move(*place(page, *end), steps=5)
        page.wait_for_timeout(1e3 * DRAWN)

    return hold


def click_ball(page: Page) -> None:
    """Click on the ball, which the camera follows. Raises SystemExit if it is not hit."""
    x, y = place(page, 0.5, 0.5)
    for dx, dy in BALL_PLACES:
        page.mouse.click(x + dx, y + dy)
        page.wait_for_timeout(300)
        if (page.locator("#picked").text_content() or "").startswith("ball"):
            return
    raise SystemExit("the ball was not hit: it is outside the middle of the picture; zoom in further")


@dataclass(frozen=True)
class Shot:
    """A picture of a page.

    Attributes:
        words: Words of `tripod up`.
        steps: What is done on the page before the picture.
        card: The open card of the panel.
        size: Of the window [px].
        width: Of the picture [px].
    """

    words: tuple[str, ...]
    steps: tuple[Step, ...] = ()
    card: str = ""
    size: tuple[int, int] = (1400, 900)
    width: int = 900


WORKING_POSE = (
    *("--servo", "0:0,0,0; 2:-1.25,-1.6,-1.65; 900:-1.25,-1.6,-1.65"),
    *("--slide", "0:0; 2:0.035; 900:0.035"),
)

SHOTS = {
    "page": Shot(("tripod", *WORKING_POSE), (zoom(6),), card="joints", size=(1400, 800), width=1000),
    "page_phone": Shot(
        ("tripod", *WORKING_POSE),
        (zoom(3), colour("von_mises")),
        card="joints",
        size=(420, 800),
        width=420,
    ),
    "page_hands": Shot(
        ("tripod", *WORKING_POSE),
        (
            zoom(6),
            choose("#speed", "0.1"),
            wait(3.0),
            click(0.4, 0.5),
            fill("load along z (N)", "-0.2"),
            press("#load"),
            press("#pull"),
            drag((0.6, 0.5), (0.7, 0.35)),
        ),
        card="hands",
    ),
    "page_maze": Shot(
        ("maze", "--demo", "--duration", "600"),
        (
            choose("#follow", "/ball"),
            press("#top"),
            zoom(4),
            press("#path"),
            click_ball,
            press("#plot-picked"),
            press("[aria-label^='remove the plot: real-time factor']"),
            wait(12.0),
            lambda page: page.locator("#more").scroll_into_view_if_needed(),
        ),
        card="plots",
    ),
    "page_drape": Shot(
        ("drape",),
        (press("#aside"), zoom(6), press("#lines"), colour("stretch"), press("#forces"), wait(5.0)),
        size=(1100, 700),
        width=800,
    ),
    "own_2": Shot(
        (
            "bridge.toml",
            "--servo",
            "0:0,0; 2:-1.35,-1.6; 900:-1.35,-1.6",
            "--slide",
            "0:0; 2:0.035; 900:0.035",
        ),
        (zoom(6),),
        card="joints",
        size=(1400, 800),
    ),
}
"""Pictures by name; those of the same words share a robot, in this order: a load stays."""


def address(log: Path, chain: subprocess.Popen[bytes]) -> str:
    """Return the address of the page that `tripod up` prints there. Raises SystemExit."""
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until and chain.poll() is None:
        if found := re.search(r"http://\S+", log.read_text()):
            return found[0]
        time.sleep(0.5)
    raise SystemExit(f"no page; `tripod up` printed:\n{log.read_text()}")


def take(browser: Browser, shot: Shot, url: str, out: Path) -> None:
    """Open a page, do the steps and write the picture. Raises SystemExit if the file is too large."""
    width, height = shot.size
    page = browser.new_page(viewport={"width": width, "height": height})
    page.set_default_timeout(1e3 * PATIENCE)
    page.goto(url, wait_until="commit")
    page.wait_for_function(f"() => {RUNS}", polling=100)
    page.get_by_text("Just watch").click()
    page.locator("#panel details.card").evaluate_all(
        "(cards, name) => cards.forEach((c) => (c.open = c.id === name))", shot.card
    )
    if shot.card:
        page.locator(f"#{shot.card}").evaluate("(card) => card.scrollIntoView()")
    page.wait_for_timeout(1e3 * DRAWN)
    for step in shot.steps:
        step(page)
    page.wait_for_timeout(1e3 * DRAWN)
    page.screenshot(path=out.with_suffix(".png"))
    page.close()
    with Image.open(out.with_suffix(".png")) as large:
        scaled = round(large.height * shot.width / large.width)
        large.convert("RGB").resize((shot.width, scaled), Image.Resampling.LANCZOS).save(
            out, quality=QUALITY, method=6
        )
    if out.stat().st_size > MOST_BYTES:
        raise SystemExit(f"{out.name} has {out.stat().st_size} bytes; at most {MOST_BYTES}: make it smaller")


def main(names: list[str]) -> None:
    """Take the pictures `names`, without names all."""
    with sync_playwright() as driver, tempfile.TemporaryDirectory() as folder:
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=list(FLAGS))
        chains = defaultdict[tuple[str, ...], list[str]](list)
        for name in names or SHOTS:
            chains[SHOTS[name].words].append(name)
        for words, shown in chains.items():
            log = Path(folder) / "log"
            program = [sys.executable, "-c", "from tripod_bringup.cli import main; main()", "up", *words]
            with log.open("w") as file:
                chain = subprocess.Popen([*program, "--record", folder], stdout=file, stderr=file)
            try:
                url = address(log, chain)
                time.sleep(SETTLED)
                for name in shown:
                    take(browser, SHOTS[name], url, Path(folder) / f"{name}.webp")
            finally:
                chain.send_signal(signal.SIGINT)
                chain.wait(PATIENCE)
            for name in shown:
                shutil.copyfile(Path(folder) / f"{name}.webp", IMAGES / f"{name}.webp")
        browser.close()


if __name__ == "__main__":
    main(sys.argv[1:])
