"""The study of the falling cloth, and the observer that tells whether anything passed through anything."""

import math

import numpy as np
import pytest

from tripod_sim.contact.contact_solver import ContactSolver
from tripod_sim.contact.crossings import Crossings
from tripod_sim.mesh.surfaces import Part
from tripod_sim.springs.generate import grid
from tripod_study.variations import drape

SHORT = {"nodes": 9, "duration": 0.6}


def watched() -> tuple[Crossings, np.ndarray]:
    """A cloth above a tetrahedron with its tip in the origin."""
    net = grid(5, 0.8)
    corners = np.array([[0.0, 0, 0], [0.2, 0, -0.2], [-0.1, 0.15, -0.2], [-0.1, -0.15, -0.2]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    cloth = Part(net.nodes + np.array([0.03, 0.02, 0.1]), net.triangles)
    return Crossings(cloth, [Part(corners, faces, fixed=True)]), cloth.vertices


def test_what_pierces_and_what_has_passed_in_one_step_is_seen() -> None:
    watch, x = watched()
    assert not watch.found(x - [0, 0, 0.09])
    assert watch.found(x - [0, 0, 0.15])  # the tip sticks through a triangle of the cloth
    watch, x = watched()
    x = x + np.array([0.07, 0, 0])  # now a node lies above the tetrahedron
    assert not watch.found(x)
    assert watch.found(x - [0, 0, 0.5])  # wholly above at first, wholly below at last
    assert not watch.found(x - [0, 0, 0.6])  # that was a step ago
    watch, x = watched()
    assert not watch.found(x - [0, 0, 0.5], straight=False)
    assert not watch.found(x - np.array([2, 0, 0.5]), straight=False)
    assert not watch.found(x + np.array([2, 0, 0.5]))  # beside it


@pytest.mark.parametrize("response", drape.RESPONSES)
def test_a_cloth_that_falls_is_stable_and_held(response: str) -> None:
    row = drape.measure(response=response, **drape.BASE, **SHORT)
    assert row["stable"]
    assert not row["tunnelled"]
    assert 0 <= row["penetration"] < drape.BASE["distance"]
    assert row["rest"] is None
    assert row["wall"] > 0
    assert row["parts"] >= 1
    assert -1.0 < row["drift"] < 0
    assert 0.1 < row["amplitude"] < 1.0
    assert 0.0 < row["stretch"] < 0.1


@pytest.mark.parametrize("response", drape.RESPONSES)
def test_the_time_to_rest_is_told_and_ends_the_run(response: str) -> None:
    row = drape.measure(response=response, **drape.BASE, nodes=7, overrides=("damping.mass=20",))
    assert row["stable"]
    assert 0.5 < row["rest"] < drape.LONGEST - 1


def test_without_contact_the_cloth_is_seen_to_tunnel(monkeypatch: pytest.MonkeyPatch) -> None:
    """The verdicts can fail: here steps go on as if nothing had any force."""
    monkeypatch.setattr(ContactSolver, "_respond", lambda self, u, *_, **__: self._ends_of(u) or 1.0)
    row = drape.measure(response="lagrange", **{**drape.BASE, "speed": 1.0}, **SHORT)
    assert row["tunnelled"]
    monkeypatch.setattr(drape, "SHARE", -math.inf)
    assert not drape.measure(response="lagrange", **drape.BASE, **SHORT)["stable"]


def test_every_value_of_the_report_is_varied() -> None:
    made = drape.report(full=False)
    assert len(made.cases) == len(drape.cases(full=False)) * len(drape.RESPONSES)
    assert len(drape.report(full=True).cases) == 27 * len(drape.RESPONSES)
    for name, values in drape.VARIED.items():
        assert {case[name] for case in drape.cases(full=False)} == set(values)


def test_rows_have_the_columns_of_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drape, "MOST_STEPS", 5)
    made = drape.report(full=False)
    row = made.row(made.cases[0])
    assert set(row) == {column.key for column in made.columns}
    assert row["rest"] is None
    cells = dict(
        zip((column.key for column in made.columns), (c.cell(row) for c in made.columns), strict=True)
    )
    assert cells["rest"] == "-"
    assert all(cells.values())


def test_what_a_row_sets_reaches_the_scene() -> None:
    """Each setting changes what the run shows."""
    short = {"nodes": 5, "duration": 0.3}
    base = drape.measure(response="lagrange", **drape.BASE, **short)
    changed = {"distance": 0.005, "mass": 2.2, "speed": 5.0, "dt": 0.02, "k": 0.1, "g": 1000.0, "limit": 1e-3}
    assert set(changed) == set(drape.BASE)
    for name, value in changed.items():
        row = drape.measure(response="lagrange", **{**drape.BASE, name: value}, **short)
        assert any(row[key] != base[key] for key in ("amplitude", "drift", "stretch", "penetration")), name
    assert (
        drape.measure(response="lagrange", **{**drape.BASE, "k": 0.1}, **short)["stretch"]
        > 10 * base["stretch"]
    )
    limited = drape.measure(response="lagrange", **{**drape.BASE, "k": 0.1, "limit": 0.02}, **short)
    assert 0.01 < limited["stretch"] <= 0.02
