"""Surfaces of parts before they are meshed: closed, turned alike, and refused with the reason."""

from pathlib import Path

import numpy as np
import pytest

from tests.messages import assert_names
from tests.sim.broken_surfaces import ball, box, surfaces, turned, write_obj, write_stl
from tripod_sim.errors import SceneError
from tripod_sim.mesh.nearest import NearestSurface, divided
from tripod_sim.mesh.part import part
from tripod_sim.mesh.part.part import PartSettings, check_size, mesh_part, part_extent, read_part
from tripod_sim.mesh.part.part_surface import PartSurface, closed, turned_alike

VOLUMES = {
    "box": 6000, "inward": 6000, "no_lid": 6000, "doubled": 6000, "doubled_inward": 6000, "needle": 6000,
    "flat_triangles": 6000, "crossing": 7600 - 10 * 20 * 4, "touching": 2000, "thin_sheet": 120,
}  # fmt: skip
"""What is enclosed [mm³], each place once."""

LIKE = {
    "one_turned": "ball", "half_turned": "ball", "one_missing": "ball", "five_missing": "ball", "cracked": "ball",
}  # fmt: skip
"""Broken surfaces that enclose about the same as a sound one."""

REFUSED = {
    "half_ball": ("open", "hole", "%"), "open_tube": ("open", "holes", "%"), "sheet": ("open", "100 %"),
    "torn": ("open", "128"), "one_sided": ("open", "hole"),
}  # fmt: skip


def closed_part(name: str) -> PartSurface:
    """Return a surface of the set, closed; in millimetres."""
    x = surfaces()[name]
    vertices, triangles = np.unique(x.reshape(-1, 3), axis=0, return_inverse=True)
    return closed(vertices, triangles.reshape(-1, 3), name)


def test_the_set_has_thirty_surfaces() -> None:
    assert len(surfaces()) == 30


@pytest.mark.parametrize("name", VOLUMES)
def test_a_surface_encloses_its_volume(name: str) -> None:
    found = closed_part(name)
    assert found.mesh.watertight or name in ("crossing", "touching")
    assert found.volume == pytest.approx(VOLUMES[name], rel=2e-3)


@pytest.mark.parametrize("name", LIKE)
def test_a_broken_surface_is_mended(name: str) -> None:
    found, sound = closed_part(name), closed_part(LIKE[name])
    assert found.mesh.watertight
    assert found.volume == pytest.approx(sound.volume, rel=2e-3)
    assert found.holes == {"one_missing": 1, "five_missing": 5}.get(name, 0)
    assert found.turned == {"one_turned": 1, "half_turned": 64}.get(name, 0)
    assert (found.joined > 0) == (name == "cracked")


def test_an_inner_surface_is_a_cavity_if_it_faces_inwards_and_nothing_if_not() -> None:
    outer, inner = closed_part("hollow").mesh.volume, closed_part("hollow_wrong")
    assert outer == pytest.approx(closed_part("ball").volume * (1.2**3 - 0.8**3), rel=1e-9)
    assert inner.crosses
    assert inner.volume == pytest.approx(closed_part("ball").volume * 1.2**3, rel=2e-3)


@pytest.mark.parametrize("name", REFUSED)
def test_a_surface_without_inside_is_refused(name: str) -> None:
    with pytest.raises(SceneError) as caught:
        closed_part(name)
    assert_names(caught.value, *REFUSED[name])


def test_neighbours_face_the_same_side_afterwards() -> None:
    x = turned(ball(level=3), np.random.default_rng(5).choice(512, 200, replace=False))
    vertices, triangles = np.unique(x.round(9).reshape(-1, 3), axis=0, return_inverse=True)
    found, count = turned_alike(vertices, triangles.reshape(-1, 3))
    centres = vertices[found].mean(axis=1)
    a, b, c = np.moveaxis(vertices[found], 1, 0)
    assert (np.einsum("ti,ti->t", np.cross(b - a, c - a), centres) > 0).all()
    assert count == 200


def test_nearest_places_are_those_of_all_triangles() -> None:
    rng = np.random.default_rng(2)
    x = np.concatenate([box((30, 20, 0.5)), ball(6, at=(3, 2, 1))])  # long and short triangles
    vertices, triangles = np.unique(x.reshape(-1, 3), axis=0, return_inverse=True)
    points = rng.uniform(-20, 40, (200, 3))
    places, distances = NearestSurface(vertices, triangles.reshape(-1, 3)).places(points)
    assert distances == pytest.approx(np.linalg.norm(places - points, axis=1))
    # against many samples: none is nearer, and some are nearly as near
    samples = divided(x, 0.3).mean(axis=1)
    best = np.linalg.norm(points[:, None] - samples, axis=2).min(axis=1)
    assert (distances <= best).all()
    assert (distances >= best - 0.3).all()


def test_the_unit_is_guessed_and_told(tmp_path: Path) -> None:
    path = write_stl(tmp_path / "part.stl", box())
    surface, notes = read_part(path, "stl", PartSettings(0.003), "PART")
    assert np.ptp(surface.mesh.vertices, axis=0) == pytest.approx([0.03, 0.02, 0.01])
    assert_names(" ".join(notes), "part.stl", "mm", "30")
    small = write_stl(tmp_path / "small.stl", 1e-3 * box())
    surface, _ = read_part(small, "stl", PartSettings(0.003), "PART")
    assert np.ptp(surface.mesh.vertices, axis=0) == pytest.approx([0.03, 0.02, 0.01])
    assert part_extent(
        write_obj(tmp_path / "a.obj", box()), PartSettings(0.0, 0.01), "PART"
    ) == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("x", "settings", "names"),
    [
        (1e3 * box(), PartSettings(1.0, 1.0), ("3e+04 m", "unit")),
        (1e-4 * box(), PartSettings(0.1, 1e-3), ("3e-06 m", "unit")),
        (box(), PartSettings(0.1, 1e-3), ("100 mm", "30 mm", "size")),
        (box(), PartSettings(1e-5, 1e-3), ("elements", "size", "mm")),
        (surfaces()["empty"], PartSettings(0.003), ("no triangles",)),
        (surfaces()["not_finite"], PartSettings(0.003), ("not finite", "1")),
        (0 * box(), PartSettings(0.003, 1.0), ("would be 0 m",)),
    ],
)  # fmt: skip
def test_a_part_that_does_not_fit_is_refused_before_it_is_meshed(
    x: np.ndarray,
    settings: PartSettings,
    names: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(part, "run_mesher", lambda *_: pytest.fail("a mesher was started"))
    with pytest.raises(SceneError) as caught:
        mesh_part(write_stl(tmp_path / "part.stl", x), settings, "PART")
    assert_names(caught.value, "part.stl", *names)


def test_a_file_of_two_gigabytes_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "huge.stl"
    with path.open("wb") as file:
        file.truncate(2_000_000_000)
    with pytest.raises(SceneError) as caught:
        mesh_part(path, PartSettings(0.003), "PART")
    assert_names(caught.value, "huge.stl", "200000000")


def test_memory_that_would_not_suffice_is_told_with_the_size_that_fits() -> None:
    with pytest.raises(SceneError) as caught:
        check_size(0.001, 0.1, 1e-4, "part", memory=1e9)
    assert_names(caught.value, "memory", "1 GB")
    fits = float(str(caught.value).rpartition("at least ")[2].split()[0])
    check_size(1e-3 * fits, 0.1, 1e-4, "part", memory=1e9)
    with pytest.raises(SceneError):
        check_size(0.9e-3 * fits, 0.1, 1e-4, "part", memory=1e9)
