"""Take pictures of the pages that `tripod run ... --view` opens, for the tutorials: `python docs/player_pictures.py`.

With names of pictures only those are taken. Each is made from the file that `--html` writes for the same command. Needs
Chromium. own_1 needs bridge.vtk and bridge.toml of docs/own_robot.md in the working directory. The pictures of the
live page: docs/page_pictures.py.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

IMAGES = Path(__file__).parent / "images"
SIZE, FINER, DRAWN = (960, 560), 2, 2.0
"""Size of a picture, pixels of a side averaged to one, and time for drawing [s]."""
FLAGS = ("--no-sandbox", "--use-gl=swiftshader", "--enable-unsafe-swiftshader", "--no-first-run")
SHOWN = {
    "first_1": (["tripod"], 1.0),
    "first_2": (["tripod", "--servo", "0:0,0,0; 1:-0.8,0,0"], 1.5),
    "first_3": (["tripod", "--set", "material.young=50kPa"], 1.75),
    "first_4": (["tripod", "--servo", "0:0,0,0; 1:-1.640,-1.174,-1.174", "--slide", "35mm"], 2.0),
    "first_5": (["tripod_ball"], 0.6),
    "film_colours": (["finger_pneumatic", "--colour", "von_mises"], 1.0),
    "film_forces": (["tripod", "--forces"], 1.0),
    "own_1": (["bridge.toml"], 1.4),
}
"""Words of `tripod run`, and the time that is shown [s], by the name of the picture."""

LARGE = (1400, 816)
"""Window of the pictures of films [px]: legend and list of forces need room beside the bodies."""


def take(page: Page, words: list[str], when: float, out: Path) -> None:
    """Run a scene, open its page at time `when` and write the picture."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.html"
        program = [sys.executable, "-c", "from tripod_bringup.cli import main; main()", "run"]
        subprocess.run([*program, *words, "--html", str(path)], check=True, stdout=subprocess.DEVNULL)
        large = out.stem.startswith("film_")
        page.set_viewport_size(dict(zip(("width", "height"), LARGE if large else SIZE, strict=True)))
        page.goto(f"{path.as_uri()}#t={when}")
        page.wait_for_function("() => document.querySelector('#clock').textContent")
        for box in page.locator("#arrows label:not([hidden]) input").all():
            box.check()
        page.wait_for_timeout(1e3 * DRAWN)
        page.screenshot(path=f"{folder}/page.png")
        with Image.open(f"{folder}/page.png") as taken:
            taken.convert("RGB").resize(SIZE, Image.Resampling.LANCZOS).save(out, quality=80, method=6)


def main(names: list[str]) -> None:
    """Take the pictures `names`, without names all."""
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=list(FLAGS))
        page = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]}, device_scale_factor=FINER)
        for name in names or SHOWN:
            words, when = SHOWN[name]
            take(page, words, when, IMAGES / f"{name}.webp")
            page.goto("about:blank")
        browser.close()


if __name__ == "__main__":
    main(sys.argv[1:])
