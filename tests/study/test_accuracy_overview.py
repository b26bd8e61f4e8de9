"""What docs/accuracy.md begins with: what accuracies cost, by studies that are made up and by those shipped."""

from pathlib import Path
from typing import Any

import pytest

from benchmarks import accuracy_docs
from benchmarks.accuracy_overview import (
    LEVELS,
    Price,
    amount,
    draw,
    of_study,
    rows_of,
    table,
    unsure,
)
from benchmarks.doc_parts import cells
from tests.messages import assert_names
from tripod_bringup.study_plot import COLOURS
from tripod_sim.integrators.schemes import EXPLICIT


def point(
    error: float, cpu: float, *, pose: float = 0.0, scheme: str = "bdf2", label: str = ""
) -> dict[str, Any]:
    return {
        "settings": {"inertia.scheme": scheme}, "error": error, "bound": error + 0.004, "below": False, "cpu": cpu,
        "label": label, "errors": {"pose": {"relative": pose, "own": 0.001}},
    }  # fmt: skip


def study(*points: dict[str, Any]) -> dict[str, Any]:
    knobs = [{"name": "scheme", "field": "inertia.scheme", "values": ["bdf2", "rk4", "tr_bdf2"]}]
    return {
        "knobs": knobs, "default": {}, "group": "inertia.scheme", "study": "tripod_dynamic",
        "cpu": "s per simulated second", "reference": {"own_error": 0.004},
        "quantities": [{"name": "move"}, {"name": "pose", "promised": True}], "points": list(points),
    }  # fmt: skip


def test_an_accuracy_costs_what_the_cheapest_setting_does_that_keeps_all_that_is_promised() -> None:
    row = of_study(
        study(
            point(0.08, 0.1, scheme="implicit_euler", label="the default"),
            point(0.02, 0.05, pose=0.2),  # the pose is not within 10 %
            point(0.03, 0.3, pose=0.0495),  # within 5 %, but not together with what its reference may err
            point(0.03, 0.4),
            point(0.007, 2.0, scheme="tr_bdf2"),
        )
    )
    assert LEVELS == (10, 5, 2, 1, 0.1)
    assert row.prices == (
        Price(0.1, "implicit_euler", sure=True),
        Price(0.4, "bdf2", sure=True),
        Price(2.0, "tr_bdf2", sure=True),
        Price(2.0, "tr_bdf2", sure=False),  # 0.7 % and what the reference may err, 0.4 %
        None,
    )
    assert [p.setting for p in row.prices if p] == ["implicit_euler", "bdf2", "tr_bdf2", "tr_bdf2"]
    assert row.default == "8 %, 0.1 s"
    shown = ["Tripod in motion", "0.1 s", "0.4 s", "2 s", "(2 s)", "-", "8 %, 0.1 s"]
    assert shown in [cells(line) for line in table([row])]
    assert_names(unsure([row]), "brackets", "Tripod in motion 0.4 %")
    assert unsure([of_study(study(point(0.0001, 1.0)))]).count("Tripod in motion") == 1, (
        "0.1 % alone is not sure"
    )


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.000141, "0.14 ms"), (0.0931, "93 ms"), (0.1, "0.1 s"), (12.34, "12 s"), (3980.0, "4000 s")],
)
def test_amounts_have_two_digits(value: float, text: str) -> None:
    assert amount(value) == text


def test_every_scheme_has_one_colour_and_the_picture_is_drawn(tmp_path: Path) -> None:
    found = accuracy_docs.studies()
    schemes = {p["settings"].get("inertia.scheme", "bdf2") for r in found for p in r["points"]} | set(
        EXPLICIT
    )
    assert schemes <= set(COLOURS)
    assert len(set(COLOURS.values())) == len(COLOURS)
    draw(rows_of(found), tmp_path / "all.png")
    assert (tmp_path / "all.png").read_bytes().startswith(b"\x89PNG")


def with_default(*, on_front: bool) -> dict[str, Any]:
    """A study of three settings; the default costs less than the others where it is on the front."""
    exact = {**point(0.02, 0.2), "on_front": True}
    least = {**point(0.005, 0.5, scheme="tr_bdf2"), "on_front": True}
    default = point(0.05, 0.1 if on_front else 0.4, label="the default", scheme="rk4")
    points = [exact, least, {**default, "on_front": on_front}]
    return {**study(*points), "front": [2, 0, 1] if on_front else [0, 1]}


def test_the_price_of_a_default_is_told() -> None:
    behind = accuracy_docs.price(with_default(on_front=False))
    assert_names(behind, "default", "5, pose 0 %", "better", "0.5 of their time", "bdf2", "2, pose 0 %")
    ahead = accuracy_docs.price(with_default(on_front=True))
    assert_names(ahead, "default", "5, pose 0 %", "half", "2 times their time", "bdf2", "2, pose 0 %")
    alone = accuracy_docs.price({**with_default(on_front=True), "front": [2]})
    assert_names(alone, "default", "5, pose 0 %", "no setting", "half")
    assert accuracy_docs.price(study(point(0.1, 1.0))) == ""


def test_scene_files_tell_the_price_of_their_settings() -> None:
    files = accuracy_docs.scene_files(accuracy_docs.studies())
    robots = {"diamond", "finger_cable", "finger_pneumatic", "trunk"}
    assert {path.stem for path in files} == {
        "pendulum",
        "cloth",
        "drape",
        "silicone",
        "tripod",
        "maze",
        *robots,
    }
    for path, text in files.items():
        assert path.read_text(encoding="utf-8") == text, "run python benchmarks/evidence.py"
    again = accuracy_docs.marked(
        with_default(on_front=True), "name = 1\n# Accuracy: old\n# and on.\ndt = 3\nx = 4\n"
    )
    first, *comment, dt, last = again.splitlines()
    assert (first, dt, last) == ("name = 1", "dt = 3", "x = 4")
    assert_names(comment[0], "# Accuracy:", "study tripod_dynamic", "docs/accuracy.md", "default", 5)
    assert all(line.startswith("# ") and "old" not in line for line in comment)
