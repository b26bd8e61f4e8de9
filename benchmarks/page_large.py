"""Large bodies on the pages: the node of the live page at 25,000 vertices, and the player at 300,000.

A browser without a screen takes the pictures of the live page; the node's share of a processor is that of its process.
In the player, a real Chromium is timed until it shows the film, and for the work of a picture without the drawing,
which is that of the graphics card. Run it on a quiet machine.
"""

import argparse
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

import numpy as np
from playwright.sync_api import sync_playwright

from tests.view.fake_browser import FakeBrowser
from tests.view.fake_simulator import grid
from tripod_graph.loopback import keep_local
from tripod_view.player.film import Deforming, Field, Film
from tripod_view.player.html import write_html

SIMULATOR = """
import sys
from tests.view.fake_simulator import FakeSimulator, run_node
run_node("fake_sim", lambda: FakeSimulator(int(sys.argv[1]), rate=30.0), [])
"""
FLAGS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
SETTLED, LOOKED_AT, PATIENCE = 3.0, 15.0, 120.0  # [s]
PICTURES = 40
TIMED = """
window.times = [];
const ask = window.requestAnimationFrame.bind(window);
window.requestAnimationFrame = (paint) => ask((now) => {
  const before = performance.now();
  paint(now);
  window.times.push(performance.now() - before);
});
"""
PLAYED = """async (count) => {
  times.length = 0;
  const slider = document.querySelector("#time");
  for (let i = 0; i < count; i++) {
    slider.value = 0.001 + 0.009 * (i % 10);
    slider.dispatchEvent(new Event("input"));
    await new Promise((done) => requestAnimationFrame(done)); // after that of the page
  }
  return times.filter((_, i) => i % 2 === 0); // the others are those that wait
}"""


def processor_time(process: int) -> float:
    """Return what a process has used [s]."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return sum(int(f) for f in fields[11:13]) / os.sysconf("SC_CLK_TCK")


def live(side: int) -> str:
    """Return what the node of the live page needs for a body of `side` squared vertices."""
    root, words = Path(__file__).resolve().parents[1], [sys.executable, "-m", "tripod_view.node"]
    sim = subprocess.Popen([sys.executable, "-c", SIMULATOR, str(side)], cwd=root)
    view = subprocess.Popen(
        [*words, "--ros-args", "-p", "port:=0"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        cwd=root,
    )
    try:
        url = next(line.split()[1] for line in view.stdout if line.startswith("page "))
        with FakeBrowser(url) as browser:
            browser.wait(lambda: browser.pictures() > 3)
            time.sleep(SETTLED)
            before, pictures, since = processor_time(view.pid), browser.pictures(), time.time()
            time.sleep(LOOKED_AT)
            seconds = time.time() - since
            share = (processor_time(view.pid) - before) / seconds
            return f"{(browser.pictures() - pictures) / seconds:.0f} pictures/s, {100 * share:.0f} % of a processor"
    finally:
        for process in (view, sim):
            process.terminate()
        for process in (view, sim):
            process.wait(30)


def played(side: int, folder: Path) -> str:
    """Return how long the player needs for a body of `side` squared vertices."""
    nodes, triangles = grid(side)
    times, far = np.arange(4) / 30, np.hypot(nodes[:, 0], nodes[:, 1])
    z = np.array([0.004 * np.sin(60 * far - 40 * t) for t in times])
    positions = np.stack([np.broadcast_to(nodes[:, 0], z.shape), np.broadcast_to(nodes[:, 1], z.shape), z], 2)
    fields = (Field("heat", "K", np.abs(z)),)
    body = Deforming("sheet", triangles.astype(np.int64), positions, (240, 190, 140), fields=fields)
    path = folder / "film.html"
    write_html(Film("large", times, bodies=(body,)), path)
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=list(FLAGS))
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        page.set_default_timeout(1e3 * PATIENCE)
        page.add_init_script(TIMED)
        since = time.time()
        page.goto(f"{path.as_uri()}#t=0.05")
        page.wait_for_function("() => document.querySelector('#clock').textContent.startsWith('0.05')")
        loaded = time.time() - since
        page.evaluate("View.prototype.render = () => {}")
        found = []
        for field, name in (
            ("", "plain"),
            ("heat", "with a field"),
            ("moved since the first picture", "moved"),
        ):
            page.locator("#colour").select_option(field)
            found.append(f"{name} {np.median(page.evaluate(PLAYED, PICTURES)):.0f} ms")
        browser.close()
    return f"shown after {loaded:.1f} s, work of a picture without drawing: {', '.join(found)}"


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--live", type=int, default=158, help="vertices of a side on the live page")
    parser.add_argument("--player", type=int, default=548, help="vertices of a side in the player")
    options = parser.parse_args()
    os.environ["ROS_DOMAIN_ID"] = str(random.SystemRandom().randint(1, 100))
    keep_local()
    print(f"live page, {options.live**2} vertices: {live(options.live)}")
    with tempfile.TemporaryDirectory() as folder:
        print(f"player, {options.player**2} vertices: {played(options.player, Path(folder))}")


if __name__ == "__main__":
    main()
