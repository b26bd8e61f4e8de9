"""Forces of a run as arrows of its film: what is recorded, packed, painted, read again."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.messages import raises_naming
from tests.view.test_player import unpacked
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.acting_forces import CONTACT, UNITS
from tripod_study import recording as recording_module
from tripod_study.recording import Recording
from tripod_view.player.colour_maps import FORCES
from tripod_view.player.film import Arrows, Film, FilmError
from tripod_view.player.of_run import OBSTACLE, film_of
from tripod_view.player.packing import longest, reel, stage
from tripod_view.player.picture import ARROW, Painter
from tripod_view.player.run_file import read_run


def recorded(scene: str, steps: int, *words: str) -> tuple[Recording, list[Any]]:
    """Return the recording of a run with its forces, and these in each step."""
    simulation = Simulation(load_scene(scene, [*words]))
    recording, found = Recording(simulation, steps, forces=True), []
    for _ in range(steps):
        simulation.step()
        recording.add(simulation)
        found.append(simulation.forces())
    return recording, found


@pytest.fixture(scope="module")
def bounce() -> tuple[Recording, list[Any]]:
    """A ball on a plate: at first it touches nothing."""
    return recorded("bounce", 80, "rigid.0.position=[0,0,0.0505]", "contact.restitution=0")


def test_each_group_has_a_colour_of_its_own() -> None:
    assert list(FORCES) == list(UNITS)
    assert len({*FORCES.values(), OBSTACLE}) == len(FORCES) + 1


def test_the_arrows_of_a_picture_are_the_forces_of_its_step(bounce: tuple[Recording, list[Any]]) -> None:
    recording, forces = bounce
    steps = np.array([3, 50, 79])
    film = film_of(recording.arrays(), steps)
    assert [(a.name, a.unit) for a in film.arrows] == [
        *((f"{kind} on ball by obstacle", "N") for kind in CONTACT),
        ("weight", "N"),
    ]
    for g, arrows in enumerate(film.arrows):
        ends = np.cumsum(arrows.counts)
        for k, (step, end, count) in enumerate(zip(steps, ends, arrows.counts, strict=True)):
            group = forces[step][g]
            assert count == len(group.points), (k, group.name)
            np.testing.assert_array_equal(arrows.points[end - count : end], group.points)
            np.testing.assert_array_equal(arrows.vectors[end - count : end], group.vectors)
    counts = np.array([len(of[0].points) for of in forces])
    assert (counts == 0).any() and (counts > 0).any()
    late = film_of(recording.arrays(40), np.array([10, 39]))
    np.testing.assert_array_equal(late.arrows[2].points[-1], forces[79][2].points[-1])


def test_a_file_of_a_run_has_its_forces(bounce: tuple[Recording, list[Any]], tmp_path: Path) -> None:
    bounce[0].save(tmp_path / "run.npz")
    film, read = film_of(bounce[0].arrays()), film_of(read_run(tmp_path / "run.npz"))
    for one, other in zip(film.arrows, read.arrows, strict=True):
        np.testing.assert_array_equal(one.vectors, other.vectors)


def test_a_file_of_a_run_with_cables_is_shown(tmp_path: Path) -> None:
    recording, _ = recorded("finger_cable", 3)
    recording.save(tmp_path / "run.npz")
    film, read = film_of(recording.arrays()), film_of(read_run(tmp_path / "run.npz"))
    for one, other in zip(film.bodies, read.bodies, strict=True):
        np.testing.assert_array_equal(one.positions, other.positions)
    assert [c.title for c in read.curves] == [c.title for c in film.curves]
    assert "cable tension" in [a.name for a in read.arrows]


@pytest.mark.parametrize(
    "change",
    [
        {"force_counts": np.zeros((2, 3), int)},
        {"force_names": np.array(["weight"])},
        {"force_vectors": np.zeros((1, 3))},
        {"force_points": np.zeros((1, 3)), "force_vectors": np.zeros((1, 3))},
    ],
)
def test_arrays_of_forces_that_do_not_fit_are_named(
    bounce: tuple[Recording, list[Any]], change: dict[str, Any]
) -> None:
    with raises_naming(FilmError, "force_counts"):
        film_of(bounce[0].arrays() | change)


def test_a_recording_of_too_many_forces_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording_module, "MOST_BYTES", 2e5)
    with raises_naming(SceneError, "--forces", "--duration"):
        recorded("stack", 100)


def test_a_packed_film_tells_the_longest_of_each_group(bounce: tuple[Recording, list[Any]]) -> None:
    arrays = bounce[0].arrays()
    film = film_of(arrays)
    packed, size = stage(film), longest(film.arrows[0])
    assert [(a["name"], a["unit"]) for a in packed["arrows"]] == [(a.name, a.unit) for a in film.arrows]
    assert packed["arrows"][0]["longest"] == size == np.linalg.norm(film.arrows[0].vectors, axis=1).max()
    first = film_of(
        arrays, np.zeros(1, dtype=int)
    )  # of a run that goes on only the first step is known at first
    assert stage(first)["arrows"][0]["longest"] == 0.0
    reeled = reel(film)
    assert reeled["arrows"][0]["longest"] == size


def read_arrows(reeled: dict[str, Any], g: int) -> list[np.ndarray]:
    """Return points and vectors of each picture, shape (n, 6), as `film.js` reads them."""
    read, entry = unpacked(reeled), reeled["arrows"][g]
    low, high = read(entry["rows"]).astype(np.uint16).reshape(2, 6, -1)
    folded = low | (high << 8)
    rows = ((folded >> 1) ^ (0 - (folded & 1)).astype(np.uint16)).view(np.int16).T
    found, last, first = [], np.zeros((0, 6), np.int16), 0
    for count in read(entry["counts"]):
        last, before = rows[first : first + count].copy(), last
        both = min(len(before), count)
        last[:both] += before[:both]
        first += count
        points = read(entry["low"]) + read(entry["step"]) * last[:, :3]
        found.append(np.concatenate([points, entry["part"] * last[:, 3:]], axis=1))
    return found


def test_packed_arrows_are_right_as_far_as_one_sees_and_those_too_short_to_draw_are_left_out() -> None:
    rng = np.random.default_rng(2)
    counts = np.array([3, 0, 5, 2, 8])
    points, vectors = rng.uniform(-0.1, 0.3, (18, 3)), rng.normal(size=(18, 3))
    vectors[[4, 9]] *= 1e-4
    arrows = Arrows("a", "N", (0, 0, 0), counts, points, vectors)
    none = Arrows("b", "N", (0, 0, 0), 0 * counts, np.zeros((0, 3)), np.zeros((0, 3)))
    film = Film("film", np.arange(5.0), arrows=(arrows, none))
    reeled, ends = reel(film), np.cumsum(counts)
    assert [len(rows) for rows in read_arrows(reeled, 1)] == [0] * 5
    for rows, end, count in zip(read_arrows(reeled, 0), ends, counts, strict=True):
        own = np.arange(end - count, end)
        own = own[~np.isin(own, [4, 9])]
        np.testing.assert_allclose(rows[:, :3], points[own], atol=0.4 / 8190 + 1e-12)
        np.testing.assert_allclose(rows[:, 3:], vectors[own], atol=longest(arrows) / 2046 + 1e-12)


def one_arrow(vector: list[float]) -> Film:
    simulation = Simulation(load_scene("bounce"))
    recording = Recording(simulation, 1)
    simulation.step()
    recording.add(simulation)
    film = film_of(recording.arrays())
    arrows = Arrows(
        "a",
        "N",
        (255, 0, 255),
        np.array([1]),
        film.bodies[0].positions[0].mean(axis=0)[None],
        np.array([vector]),
    )
    return replace(film, arrows=(arrows,))


def purple(film: Film) -> np.ndarray:
    """Return rows and columns of what is drawn in the arrow's colour, shape (k, 2)."""
    image = Painter(film, (320, 240)).picture(0).astype(int)
    return np.argwhere((image[..., 0] > image[..., 1] + 60) & (image[..., 2] > image[..., 1] + 60))


def test_an_arrow_is_painted_in_front_of_all_and_as_long_as_it_should_be() -> None:
    up, double, aside = (purple(one_arrow(v)) for v in ([0, 0, 1.0], [0, 0, 2.0], [1.0, 0, 0]))
    assert len(up) > 50
    assert np.array_equal(up, double)  # the longest has one length
    tall, wide = np.ptp(up, axis=0), np.ptp(aside, axis=0)
    assert tall[0] > 4 * tall[1]
    assert wide[1] > wide[0]
    film = one_arrow([0, 0, 1.0])
    radius = Painter(film, (320, 240))._view.radius
    pixels = 240 / 2 / np.tan(0.3) * np.cos(np.radians(30)) * ARROW * radius / (radius / np.sin(0.3))
    assert tall[0] == pytest.approx(pixels, rel=0.15)
    none = replace(film, arrows=(replace(film.arrows[0], vectors=np.zeros((1, 3))),))
    assert len(purple(none)) == 0
