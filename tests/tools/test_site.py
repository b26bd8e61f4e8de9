"""The site of the documentation: it builds without a warning, every page is in its menu, and it asks no network."""

import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
import yaml

from tests.tools.site import ROOT, build_site

FETCHED = re.compile(r"url\(\s*['\"]?(https?:)?//|@import\s+['\"]?(url\()?https?:")
"""What a style sheet would load from a network."""

LOADS = {"script": "src", "img": "src", "iframe": "src", "link": "href", "source": "src", "video": "src"}


class Found(HTMLParser):
    """What a page loads, links to, and can be linked at."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []
        self.places: set[str] = set()
        self.menu: list[str] = []
        self._in_menu = 0
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.places |= {given[name] for name in ("id", "name") if name in given}
        if tag in LOADS and given.get(LOADS[tag]) and given.get("rel") != "canonical":
            self.loads.append(given[LOADS[tag]])
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
            if "md-nav__link" in given.get("class", "") or "md-tabs__link" in given.get("class", ""):
                self.menu.append(given["href"])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> dict[Path, Found]:
    """Every page of the site, just built, by its path."""
    folder = tmp_path_factory.mktemp("site")
    build_site(folder)
    own = {folder / "maze_game.html", folder / "404.html"}
    return {path: Found(path) for path in folder.rglob("*.html") if path not in own}


def menu_of(entries: object) -> list[str]:
    """Return the pages of a menu as mkdocs.yml writes it."""
    if isinstance(entries, str):
        return [entries]
    parts = entries.values() if isinstance(entries, dict) else entries
    assert not isinstance(parts, str)
    return [page for part in parts for page in menu_of(part)]


def test_every_document_is_in_the_menu() -> None:
    settings = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    pages = menu_of(settings["nav"])
    assert set(settings["extra"]["keywords"]) <= set(pages)
    assert len(pages) == len(set(pages))
    assert {path.name for path in (ROOT / "docs").glob("*.md")} <= set(pages)


def test_every_page_is_reached_from_the_menu_of_every_page(site: dict[Path, Found]) -> None:
    assert len(site) > 30
    for path, page in site.items():
        reached = {(path.parent / unquote(urlsplit(link).path)).resolve() for link in page.menu}
        assert set(site) - reached <= {path}, path.name  # in its own menu a page may be a mark, not a link


def test_the_pages_load_nothing_from_a_network(site: dict[Path, Found]) -> None:
    loads = [load for page in site.values() for load in page.loads]
    assert len(loads) > len(site)
    assert [load for load in loads if urlsplit(load).netloc] == []
    styles = list((ROOT / "docs").glob("*.css"))
    assert styles
    for style in styles:
        assert not FETCHED.search(style.read_text("utf-8"))


def test_what_the_pages_load_and_link_to_is_there(site: dict[Path, Found]) -> None:
    missing = []
    for path, page in site.items():
        for link in [*page.loads, *page.links]:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.exists() or (
                parts.fragment and target in site and unquote(parts.fragment) not in site[target].places
            ):
                missing.append(f"{path.name}: {link}")
    assert missing == []
