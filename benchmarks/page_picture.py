"""A picture of the page of a scene that runs, as a browser shows it, such as those of the documentation.

Plays `tripod up SCENE --demo` and waits until the circle is followed. The figures on the page are those of this machine
now: run it on a quiet one. Needs Chromium.
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

from playwright.sync_api import sync_playwright

FLAGS = (
    "--no-sandbox",
    "--use-gl=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
)
PATIENCE, SETTLED = 120.0, 15.0  # [s]


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
    parser.add_argument("--card", default="accuracy", help="card of the panel that is open")
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
            "--demo",
        ]
        with log.open("w") as file:
            chain = subprocess.Popen([*words, "--record", place], stdout=file, stderr=file)
        try:
            browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=list(FLAGS))
            page = browser.new_page(viewport={"width": width, "height": height})
            page.goto(address(log), wait_until="commit")
            page.wait_for_function("() => document.body.classList.contains('has-known')", polling=100)
            page.get_by_text("Just watch").click()
            page.evaluate(  # the browser's complaint that it has no graphics card
                "() => document.querySelectorAll('[class*=Notification]').forEach((e) => e.remove())"
            )
            page.wait_for_timeout(1e3 * SETTLED)
            page.locator("#panel details").evaluate_all(
                "(cards, name) => cards.forEach((c) => (c.open = c.id === name))", options.card
            )
            page.wait_for_timeout(1e3)
            page.screenshot(path=options.out)
            browser.close()
        finally:
            chain.send_signal(signal.SIGINT)
            chain.wait(PATIENCE)


if __name__ == "__main__":
    main()
