"""Films as pages: what is refused, what the packed pictures hold, the camera, and that the page plays alone."""

import base64
import html
import json
import re
import shutil
import subprocess
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.bringup.processes import wait_until
from tests.messages import assert_names, names, raises_naming
from tripod_view.arm import ArmGeometry, Stand, arm_pose, carriage_pose, stands
from tripod_view.player.camera import camera
from tripod_view.player.colour_maps import MAPS
from tripod_view.player.colour_scale import BAR, NONE, scale_of
from tripod_view.player.film import Colouring, Curve, Deforming, Event, Field, Film, FilmError, Piece
from tripod_view.player.html import player_page, write_html
from tripod_view.player.of_run import _rigid_names
from tripod_view.player.packing import KINDS, edges, reel, stage
from tripod_view.player.picture import FINER, Painter
from tripod_view.player.robot import robot_pieces
from tripod_view.player.shapes import ball, box, disc

RNG = np.random.default_rng(0)
EVENT = "the ball </script> falls"
TIMES = np.array([0.0, 0.5, 1.0, 1.5])


def sheet() -> Deforming:
    """A square that waves."""
    x, y = np.meshgrid(np.linspace(-0.05, 0.05, 6), np.linspace(-0.05, 0.05, 6))
    flat = np.stack([x, y, 0 * x], axis=2).reshape(-1, 3)
    i = np.arange(36).reshape(6, 6)
    a, b, c, d = (part.ravel() for part in (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]))
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    waves = np.array([flat + [0, 0, 0.02] * np.sin(30 * flat[:, :1] + 4 * t) for t in TIMES])
    return Deforming("sheet", triangles, waves, (240, 190, 140))


def still(shape: tuple[Any, Any]) -> Piece:
    return Piece("block", shape[1], shape[0], (100, 100, 100))


def film() -> Film:
    poses = np.tile([0.0, 0.0, 0.06, 0.0, 0.0, 0.0, 1.0], (4, 1))
    poses[:, 0] = 0.1 * TIMES
    vertices, triangles = ball(0.01)[0]
    return Film(
        title="a <sheet> & more",
        times=TIMES,
        bodies=(sheet(),),
        pieces=(
            still(box((0.3, 0.3, 0.01), (0, 0, -0.05))),
            Piece("ball", triangles, vertices, (200, 40, 40), poses),
        ),
        curves=(Curve("height", "mm", ("a", "b"), np.stack([TIMES, np.full(4, np.nan)], axis=1), (0.5,)),),
        events=(Event(0.5, EVENT),),
    )


def unpacked(reeled: dict[str, Any]) -> Any:
    data = zlib.decompress(base64.b64decode(reeled["data"]))
    return lambda e: np.frombuffer(data, KINDS[e[0]], e[2], e[1])


def test_a_rigid_body_is_called_by_its_shape() -> None:
    assert _rigid_names({"rigid": [{"shape": "capsule"}]})[0] == "capsule"
    assert _rigid_names({"rigid": [{"shape": "ball"}, {}, {}]})[:3] == ("ball", "box 1", "box 2")


def rough(packed: np.ndarray) -> np.ndarray:
    """As `film.js` does, of 4 pictures."""
    low, high = packed.astype(np.uint16).reshape(2, 4, -1)
    folded = low | (high << 8)
    found = (folded >> 1) ^ (0 - (folded & 1)).astype(np.uint16)
    for first in (2, 1):
        for k in range(first, 4):
            found[k] += found[k - 1]
    return found


def test_positions_come_back_within_half_a_step_of_their_box() -> None:
    made = film()
    reeled = reel(made)
    read = unpacked(reeled)
    entry = reeled["bodies"][0]
    low, step = read(entry["low"]).reshape(4, 1, 3), read(entry["step"]).reshape(4, 1, 3)
    whole = rough(read(entry["positions"])).reshape(4, -1, 3)
    positions = made.bodies[0].positions
    assert (np.abs(low + step * whole - positions) <= 0.5 * step + 1e-12).all()
    assert step.max() < 0.1 / 16000
    assert read(reeled["times"]).tolist() == TIMES.tolist()
    np.testing.assert_array_equal(read(reeled["poses"][0]).reshape(4, 7), made.pieces[1].poses)
    np.testing.assert_array_equal(read(reeled["curves"][0])[::2], TIMES)


def test_a_body_that_is_flat_or_a_single_picture_is_packed_too() -> None:
    flat = replace(sheet(), positions=0 * sheet().positions[:1] + 0.25)
    reeled = reel(Film("flat", TIMES[:1], bodies=(flat,)))
    read = unpacked(reeled)
    assert not read(reeled["bodies"][0]["positions"]).any()
    assert (read(reeled["bodies"][0]["low"]) == 0.25).all()


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"times": np.zeros(0)}, ("times: ", "at least one", "finite")),
        ({"times": np.zeros(4)}, ("times: ", "later")),
        ({"times": np.array([0, 1, 2, np.nan])}, ("times: ", "at least one", "finite")),
        ({"times": TIMES[:3]}, ("sheet: ", "3 pictures")),
        ({"bodies": (replace(sheet(), positions=np.full((4, 36, 3), np.nan)),)}, ("sheet: ", "finite positions")),
        ({"bodies": (replace(sheet(), triangles=np.array([[0, 1, 36]])),)}, ("sheet: ", "triangles", "0 to 35")),
        ({"pieces": (replace(still(box((1, 1, 1))), poses=np.zeros((3, 7))),)}, ("block: ", "poses", "(4, 7)")),
        ({"curves": (Curve("angles", "rad", ("a",), np.zeros((4, 2))),)}, ("angles: ", "values", "(4, names)")),
        ({"bodies": (replace(sheet(), colour=(0, 0, 256)),)}, ("sheet: ", "colour", "0 to 255")),
        ({"bodies": (replace(sheet(), colour=(0.5, 0.5, 0.5)),)}, ("sheet: ", "colour", "whole numbers")),
        ({"events": (Event(np.nan, "lost"),)}, ("lost: ", "time")),
    ],
)  # fmt: skip
def test_arrays_that_make_no_film_are_named(change: dict[str, Any], named: tuple[str, ...]) -> None:
    with raises_naming(FilmError, *named):
        replace(film(), **change)


def coloured(values: np.ndarray, limits: tuple[float, float] | None = None, *, signed: bool = False) -> Film:
    """The sheet with a field, given as a value for each picture, or for each node, too."""
    field = Field("heat", "K", values + np.zeros((4, 36)), signed)
    return replace(film(), bodies=(replace(sheet(), fields=(field,)),), colouring=Colouring("heat", limits))


def test_values_of_a_field_come_back_within_half_a_step() -> None:
    made = coloured(RNG.normal(size=(4, 36)))
    made.bodies[0].fields[0].values[1, 5] = np.nan
    reeled = reel(made)
    entry = reeled["bodies"][0]["fields"][0]
    codes = np.cumsum(unpacked(reeled)(entry["codes"]).reshape(4, 36), axis=0, dtype=np.uint8)  # wraps
    values = made.bodies[0].fields[0].values
    assert (codes == 255).sum() == 1
    assert codes[1, 5] == 255
    known = codes < 255
    assert (np.abs(entry["low"] + entry["step"] * codes - values)[known] <= 0.501 * entry["step"]).all()


def test_colours_have_the_limits_of_the_whole_film_unless_told() -> None:
    values = np.array([[1.0], [np.nan], [-3.0], [2.0]])
    assert stage(coloured(values))["colouring"] == {"name": "heat", "limits": (-3.0, 2.0)}
    assert stage(coloured(values, signed=True))["colouring"] == {"name": "heat", "limits": (-3.0, 3.0)}
    assert stage(coloured(values, (0.0, 9.0)))["colouring"] == {"name": "heat", "limits": (0.0, 9.0)}
    assert stage(coloured(0 * values))["colouring"] == {"name": "heat", "limits": None}
    assert stage(film())["colouring"] is None
    assert stage(replace(film(), colouring=Colouring("cold")))["colouring"] is None
    with raises_naming(FilmError, "heat", "limits"):
        coloured(values, (1.0, 1.0))


def test_a_painted_picture_has_the_colours_of_the_field_and_a_legend() -> None:
    scale = scale_of(coloured(np.array([[0.0], [1.0], [2.0], [np.nan]])))
    assert scale
    plain = np.array(MAPS["plain"])
    np.testing.assert_array_equal(scale.colours(np.array([-1.0, 0, 2, 3])), plain[[0, 0, -1, -1]])
    np.testing.assert_array_equal(scale.colours(np.array([np.nan, np.inf])), [NONE, NONE])
    assert [replace(scale, low=1e-11)._number(v) for v in (1e-11, 1.23456, 2.0)] == ["0", "1.23", "2"]
    legend = scale.legend()
    np.testing.assert_allclose(legend[25, 6], plain[0])
    np.testing.assert_allclose(legend[25, 6 + BAR[0] - 1], plain[-1])
    assert (legend[:18] < 128).any()  # its name
    assert (legend[35:, :100] < 128).any() and (legend[35:, 100:] < 128).any()
    whole = Painter(coloured(np.linspace(0, 1, 36)[None])).picture(0)
    rows, columns = legend.shape[:2]
    assert (whole[8 : 8 + rows, 8 : 8 + columns] > 250).mean() > 0.5
    sheet_only = replace(coloured(np.linspace(0, 1, 36)[None]), pieces=())
    seen = Painter(sheet_only).picture(0)[8 + rows :].reshape(-1, 3).astype(int)
    assert ((seen[:, 0] - seen[:, 2]) > 60).any()  # yellow
    assert ((seen[:, 2] - seen[:, 1]) > 30).any()  # violet
    grey = Painter(replace(coloured(np.full((1, 36), np.nan)), pieces=())).picture(0)[8 + rows :]
    assert (np.ptp(grey.astype(int), axis=2) < 40).all()
    own = Painter(replace(sheet_only, colouring=None)).picture(0)
    assert (own[8 : 8 + rows, 8 : 8 + columns] < 253).mean() > 0.9


def test_a_ring_marks_the_largest_value_and_stays_among_places_that_are_alike() -> None:
    values = np.zeros((4, 36))
    values[0, 14], values[1, [14, 27]], values[2, 27] = 1.0, (0.9995, 1.0), 1.0
    for signed in (False, True):
        made = replace(coloured(-values if signed else values, signed=signed), pieces=())
        painter = Painter(made)

        def ring(k: int, painter: Painter = painter) -> np.ndarray:
            """Return the middle of what is black below the legend [px], column and row."""
            black = (painter.picture(k)[70:].astype(int) < 25).all(axis=2)
            rows, columns = black.nonzero()
            assert 20 < len(rows) < 200
            return np.array([columns.mean(), rows.mean() + 70])

        nodes = made.bodies[0].positions
        places = [
            painter._seen(nodes[k, [n]], painter._centre(k))[0, :2] / FINER
            for k, n in ((0, 14), (1, 14), (2, 27))
        ]
        for k, place in enumerate(places):
            assert ring(k) == pytest.approx(place, abs=1.0)
    none = Painter(replace(coloured(np.full((1, 36), np.nan)), pieces=())).picture(0)[70:]
    assert not (none.astype(int) < 25).all(axis=2).any()


def test_edges_are_each_there_once() -> None:
    assert edges(np.array([[0, 1, 2], [2, 1, 3]])).tolist() == [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]


@pytest.mark.parametrize("shape", [box((1, 2, 3), (1, 1, 1)), disc(0.5, 0.2)])
def test_shapes_are_closed_and_face_outward(shape: tuple[Any, Any]) -> None:
    vertices, triangles = shape
    sides = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    assert len({tuple(s) for s in sides}) == len(sides)
    assert {tuple(s) for s in sides} == {tuple(s[::-1]) for s in sides}
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    assert (a * np.cross(b, c)).sum() / 6 > 0.1


def test_the_two_halves_of_a_ball_are_all_of_it() -> None:
    halves = ball(2.0)
    areas = [
        0.5 * np.linalg.norm(np.cross(v[t[:, 1]] - v[t[:, 0]], v[t[:, 2]] - v[t[:, 0]]), axis=1).sum()
        for v, t in halves
    ]
    assert areas[0] == pytest.approx(areas[1])
    assert sum(areas) == pytest.approx(4 * np.pi * 4, rel=0.03)
    assert np.linalg.norm(halves[0][0], axis=1) == pytest.approx(2.0)


def test_servos_and_arms_are_where_the_page_has_them() -> None:
    geometry = ArmGeometry()
    tilted = Stand((0.1, 0.0, 0.05), (0.5, 0.5, -0.5, 0.5), (0.0, 0.6, 0.8), 0.02, 0.01, 0.03)
    places = [*stands(3, geometry), tilted]
    angles, slide = RNG.uniform(-2, 0.6, (5, 4)), RNG.uniform(0, 0.04, 5)
    pieces = {p.name: p for p in robot_pieces(angles, slide, places, geometry)}
    for i, stand in enumerate(places):
        for k in range(5):
            for name, pose in (
                (f"servo {i}", carriage_pose(stand, slide[k])),
                (f"arm {i}", arm_pose(stand, angles[k, i], slide[k])),
            ):
                poses = pieces[name].poses
                assert poses is not None
                assert poses[k, :3] == pytest.approx(pose.position)
                assert abs(poses[k, 3:] @ pose.quaternion) == pytest.approx(1)


def test_the_camera_sees_all_that_moves_and_the_ground_is_below() -> None:
    made = film()
    view = camera(made)
    points = np.concatenate([made.bodies[0].positions.reshape(-1, 3), [[0.15, 0, 0.06]]])
    assert np.linalg.norm(points - view.centre, axis=1).max() < view.radius < 0.25
    assert -0.06 < view.floor < -0.055
    assert not view.follow


def test_the_camera_goes_along_with_what_falls_far_and_looks_at_a_plane_from_the_front() -> None:
    body = sheet()
    falling = replace(body, positions=body.positions - np.array([0, 0, 5.0]) * TIMES[:, None, None] ** 2)
    view = camera(Film("fall", TIMES, bodies=(falling,)))
    assert view.follow
    assert view.radius < 0.2
    swing = replace(body, positions=body.positions * [1.0, 0.001, 1.0])
    assert camera(Film("swing", TIMES, bodies=(swing,))).elevation == 10


def test_the_camera_sees_the_whole_of_a_tall_way_and_stays_with_what_stays() -> None:
    body = sheet()
    down = np.array([0, 0, 1.0]) * TIMES[:, None, None] ** 2
    tall = camera(Film("tall", TIMES, bodies=(replace(body, positions=body.positions - 0.3 * down),)))
    assert not tall.follow
    eye = np.array([0.0, -np.cos(np.radians(30)), np.sin(np.radians(30))])  # turned about Z: seen alike
    up = np.array([0.0, eye[2], -eye[1]])
    for z in (0.0, -0.3 * 1.5**2):
        place = np.array([0, 0, z - tall.centre[2]])
        assert abs(place @ up) < np.tan(0.3) * (tall.radius / np.sin(0.3) - place @ eye)
    fallen = replace(body, positions=body.positions - 5 * down)
    both = camera(Film("one fell", TIMES, bodies=(fallen, body)))
    alone = camera(Film("none fell", TIMES, bodies=(body,)))
    assert (both.seen, both.follow) == ((False, True), False)
    assert both.radius == pytest.approx(alone.radius)
    assert [b["seen"] for b in stage(Film("one fell", TIMES, bodies=(fallen, body)))["bodies"]] == [
        False,
        True,
    ]


FETCHED = re.compile(r"(?:src|href|url)\s*[=(]\s*[\"']?(?!data:)[\w/]")


def test_the_page_asks_for_nothing_and_holds_its_words_as_text(tmp_path: Path) -> None:
    path = tmp_path / "film.html"
    write_html(film(), path)
    text = path.read_text()
    assert not FETCHED.findall(text)
    assert "https:" not in text
    assert "http:" not in text
    assert "default-src 'none'" in text
    title = re.search(r"<title>([^<]*)</title>", text)
    assert title
    assert html.unescape(title[1]) == film().title
    found = re.search(r'<script id="reel" type="application/json">(.*?)</script>', text, re.DOTALL)
    assert found
    assert json.loads(found[1])["events"] == [[0.5, EVENT]]
    assert text.count("</script>") == 4


def test_a_page_without_a_reel_says_so() -> None:
    assert '<script id="reel" type="application/json">null</script>' in player_page(stage(film()), None)


CHROMIUM = next(
    (found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), ""
)


def opened(address: str, folder: Path, *words: str) -> str:
    """Return what a browser made of a page, after the time that it needs; fails on an error of its script."""
    command = [
        CHROMIUM, "--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run", "--disable-background-networking",
        "--disable-component-update", "--disable-sync", f"--user-data-dir={folder}", "--window-size=900,600",
        "--virtual-time-budget=20000", "--enable-logging=stderr", *words, address,
    ]  # fmt: skip
    result = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert "CONSOLE" not in result.stderr, result.stderr
    return result.stdout


@pytest.mark.skipif(not CHROMIUM, reason="no Chromium; to install: sudo apt-get install chromium")
def test_a_browser_draws_it(tmp_path: Path) -> None:
    from matplotlib.image import imread

    path, picture = tmp_path / "film.html", tmp_path / "picture.png"
    write_html(film(), path)
    address, user, pages = f"{path.as_uri()}#t=0.75", tmp_path / "user", [""]

    def shows(page: str) -> bool:
        """Whether the page is unpacked, which a thread of the browser does that its virtual time does not wait for."""
        pages.append(page)
        return names(page, "0.75 of 1.50 s")

    wait_until(lambda: shows(opened(address, user, "--dump-dom")))
    assert_names(pages[-1], "0.75 of 1.50 s", "one square")
    assert html.escape(EVENT) in pages[-1]
    wait_until(lambda: shows(opened(address, user, f"--screenshot={picture}", "--dump-dom")))
    image = imread(picture)[40:540, :550, :3]
    silicone = (image[..., 0] > image[..., 2] + 0.2) & (image[..., 1] > image[..., 2] + 0.1)
    assert silicone.mean() > 0.02
    red = (image[..., 0] > image[..., 1] + 0.3) & (image[..., 2] < 0.35)
    assert red.mean() > 0.0005
