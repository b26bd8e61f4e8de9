"""Promises of `time_error.accuracy` on random scenes of solids and springs (see benchmarks/time_error_scenes.py)."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import time_error_scenes as scenes
from benchmarks.time_promise import KNOWN
from tests.tiers import sampled
from tripod_sim import load_scene

EVERY = [(kind, touching) for kind in scenes.KINDS for touching in (False, True)]


def kept(kind: str, touching: bool, seed: int, folder: Path) -> list[bool]:
    """Return whether a scene keeps each accuracy that it promises and that its reference judges."""
    case = scenes.drawn(kind, touching, seed)
    exact, own = scenes.refined(case, folder)
    runs = [(a, scenes.automatic(case, a, exact, folder)) for a in scenes.ACCURACIES]
    assert all(run["promised"] for _, run in runs) or (touching and kind not in ("springs", "slack"))
    return [run["error"] <= a for a, run in runs if own <= KNOWN * a and run["promised"]]


@pytest.mark.parametrize("kind", sampled(scenes.KINDS, "solids", "slack", "sag"))
def test_what_touches_nothing_keeps_every_promise(kind: str, tmp_path: Path) -> None:
    assert all(kept(kind, False, 1, tmp_path))


@pytest.mark.slow
def test_most_promises_of_what_touches_are_kept(tmp_path: Path) -> None:
    """At least 90 % of about 30 runs."""
    runs = [ok for kind in scenes.KINDS for seed in (1, 2, 3) for ok in kept(kind, True, seed, tmp_path)]
    assert len(runs) > 20
    assert np.mean(runs) >= 0.9


@pytest.mark.parametrize(("kind", "touching"), EVERY)
def test_every_kind_draws_scenes_that_load_and_touch_as_told(
    kind: str, touching: bool, tmp_path: Path
) -> None:
    for seed in (1, 2):
        (tmp_path / "drawn.toml").write_text(scenes.drawn(kind, touching, seed).text)
        scene = load_scene(tmp_path / "drawn.toml")
        assert (scene.contact is not None) == bool(scene.obstacles) == touching


def test_a_reference_that_was_found_is_found_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    case = scenes.drawn("slack", False, 1)
    exact, own = scenes.refined(case, tmp_path)
    monkeypatch.setattr(scenes, "reference", lambda *_: pytest.fail("measured twice"))
    again = scenes.refined(case, tmp_path)
    assert np.array_equal(exact, again[0])
    assert own == again[1]


def row(kind: str, touching: bool, **more: Any) -> dict[str, Any]:
    """Return a row whose runs keep 10 % and 5 %, in half of the time of the best fixed step."""
    run = {"error": 0.03, "told": 0.02, "promised": True, "seconds": 1.0}
    fixed = [{"error": 0.02, "seconds": 2.0}, {"error": 0.2, "seconds": 0.1}]
    auto = {str(a): run for a in scenes.ACCURACIES}
    return {"kind": kind, "touching": touching, "own": 1e-3, "auto": auto, "fixed": fixed} | more


def test_the_table_counts_promises_that_are_judged() -> None:
    silent = {a: run | {"promised": False} for a, run in row("sag", True)["auto"].items()}
    rows = [row("sag", False), row("sag", False, own=0.004), row("sag", True, auto=silent)]
    chaotic = {"kind": "sag", "touching": True, "own": 0.5}
    cells = [c.strip() for c in scenes.table([*rows, chaotic])[-1].strip("|").split("|")]
    assert cells == ["all", "12", "1", "33", "7", "57.1", "3, 3 (not promised)", "0.50", "0.50"]


def test_scenes_are_measured_until_there_are_enough() -> None:
    rows = [row(kind, touching) for kind, touching in EVERY]
    assert scenes.missing(rows, 2) is None
    assert scenes.missing(rows[:-1], 2) == ("sag", True, 0)
    chaotic = {"kind": "sag", "touching": True, "own": 0.5}
    assert scenes.missing([*rows[:-1], chaotic], 2) == ("sag", True, 1)
