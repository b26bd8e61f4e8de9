"""The search of the site, in a browser, on pages opened as files: questions of newcomers lead to the right page."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from tests.tools.site import build_site

CHROMIUM = next(
    (p for name in ("chromium", "chromium-browser", "google-chrome") if (p := shutil.which(name))), ""
)
FIELD = "input.md-search__input"
QUESTIONS = {
    "how do I add my own robot": "own_robot",
    "how can I record a video of a run": "seeing",
    "make a film of a run": "seeing",
    "is dt small enough": "choose_accuracy",
    "how large are the forces at a clamp": "sets",
    "how do I change the stiffness of the material": "materials",
    "how do I connect the board": "robot",
    "can I use the simulator without ROS": "versions",
    "steer the robot with the keyboard": "commands",
    "play a recorded bag again": "recording",
    "use my own mesh file": "file_formats",
    "how do I set the friction": "contact",
    "calibrate the servos": "robot",
    "compare methods": "accuracy",
    "get the results as CSV": "recording",
    "which servo angles give a pose": "inverse_kinematics",
    "several bodies in one scene": "bodies",
    "stop the robot in an emergency": "robot",
    "how large is the error of the mesh": "accuracy",
    "add a force of my own": "effects",
    "my machine is too slow": "choose_accuracy",
}
"""Questions, and the name of the page that answers each."""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not CHROMIUM, reason="no Chromium; to install: sudo apt-get install chromium"),
]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Any, str]]:
    """A page of a browser, and the address of the site."""
    playwright = pytest.importorskip("playwright.sync_api")
    folder = tmp_path_factory.mktemp("site")
    build_site(folder)
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        opened = browser.new_page()
        opened.set_default_timeout(60e3)
        yield opened, folder.as_uri()
        browser.close()


def first_page(page: tuple[Any, str], question: str) -> str:
    """Return the name of the page that Enter opens after a question was typed on the glossary."""
    opened, site = page
    opened.goto(f"{site}/glossary.html")
    opened.click(FIELD)
    opened.fill(FIELD, question)
    opened.press(FIELD, "End")
    opened.wait_for_selector(".md-search-result__item")
    opened.press(FIELD, "Enter")
    opened.wait_for_url(lambda address: "?h=" in address)
    return Path(urlsplit(opened.url).path).relative_to(urlsplit(site).path).with_suffix("").as_posix()


def test_questions_of_newcomers_lead_to_the_right_page(page: tuple[Any, str]) -> None:
    found = {question: first_page(page, question) for question in QUESTIONS}
    wrong = {question: name for question, name in found.items() if name != QUESTIONS[question]}
    assert len(wrong) <= 2, wrong


def test_pages_that_have_all_words_are_listed_alone(page: tuple[Any, str]) -> None:
    opened, site = page
    opened.goto(f"{site}/glossary.html")
    numbers = []
    for query in ("sleeping", "cloth", "sleeping cloth", "zzz cloth"):
        opened.fill(FIELD, "")
        opened.press(FIELD, "End")
        opened.wait_for_function("() => !document.querySelector('.md-search-result__item')")
        opened.fill(FIELD, query)
        opened.press(FIELD, "End")
        opened.wait_for_selector(".md-search-result__item")
        numbers.append(int(opened.inner_text(".md-search-result__meta").split()[0]))
    sleep, cloth, both, either = numbers
    assert 0 < both < min(sleep, cloth)
    assert either == cloth  # no page has both


def test_the_search_asks_no_network(page: tuple[Any, str]) -> None:
    opened, _ = page
    asked: list[str] = []
    opened.on("request", lambda request: asked.append(request.url))
    assert first_page(page, "glossary") == "glossary"
    assert asked
    assert [address for address in asked if not address.startswith(("file:", "data:"))] == []
