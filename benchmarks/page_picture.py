"""Take a picture of the live page of a scene, such as those of the documentation.

Runs `tripod up SCENE --demo`, or with `--servo`, for a while, then opens the page. The browser opens late because
without a graphics card its drawing slows the simulation down. The figures on the page are those of this machine: run it
on one that does nothing else. Needs Chromium.
"""

import argparse
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

FLAGS = (
    "--no-sandbox",
    "--use-gl=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
)
PATIENCE, SETTLED, DRAWN = 600.0, 15.0, 2.0  # [s]
FINER = 2
"""Pixels of a side that are averaged to one, so that edges are smooth."""


def address(log: Path) -> str:
    """Return the address of the page that `tripod up` prints there. Raises SystemExit."""
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        if found := re.search(r"http://\S+", log.read_text()):
            return found[0]
        time.sleep(0.5)
    raise SystemExit(f"no page after {PATIENCE:g} s:\n{log.read_text()}")


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scene", help="name or file of the scene")
    parser.add_argument("out", type=Path, help="the picture, *.png")
    parser.add_argument("--size", type=int, nargs=2, default=(1050, 675), help="of the window, in pixels")
    parser.add_argument("--card", nargs="+", default=["accuracy"], help="open cards of the panel")
    parser.add_argument("--zoom", type=int, default=0, help="notches of the mouse wheel towards the robot")
    parser.add_argument("--servo", help="servo angles over time in place of the circle, as for `tripod up`")
    parser.add_argument("--slide", default="0", help="with --servo: the slide over time")
    options = parser.parse_args()
    width, height = options.size
    with tempfile.TemporaryDirectory() as place, sync_playwright() as driver:
        log = Path(place) / "log"
        words = [
            sys.executable,
            "-c",
            "from tripod_bringup.cli import main; main()",
            "up",
            options.scene,
            *(["--servo", options.servo, "--slide", options.slide] if options.servo else ["--demo"]),
        ]
        with log.open("w") as file:
            chain = subprocess.Popen(
                [*words, "--record", place, "--duration", "90"], stdout=file, stderr=file
            )
        try:
            browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=list(FLAGS))
            page = browser.new_page(viewport={"width": width, "height": height}, device_scale_factor=FINER)
            url = address(log)
            time.sleep(SETTLED)
            page.goto(url, wait_until="commit")
            page.wait_for_function("() => document.body.classList.contains('has-known')", polling=100)
            page.get_by_text("Just watch").click()
            page.mouse.move(width / 3, height / 2)
            for _ in range(options.zoom):
                page.mouse.wheel(0, -120)
            page.locator("#panel details").evaluate_all(
                "(cards, names) => cards.forEach((c) => (c.open = names.includes(c.id)))", options.card
            )
            page.wait_for_timeout(1e3 * DRAWN)
            page.screenshot(path=options.out)
            browser.close()
        finally:
            chain.send_signal(signal.SIGINT)
            chain.wait(PATIENCE)
    Image.open(options.out).convert("RGB").resize((width, height), Image.Resampling.LANCZOS).save(
        options.out, optimize=True
    )


if __name__ == "__main__":
    main()
