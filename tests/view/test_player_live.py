"""A run as a film: what its arrays show, also while they grow; the server of the page; pictures and videos."""

import http.client
import json
import sys
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest

from tests.messages import assert_names, raises_naming
from tripod_view.player import run_file, video
from tripod_view.player.curves_plot import write_plot
from tripod_view.player.film import FilmError
from tripod_view.player.live import GrowingFilm
from tripod_view.player.of_run import film_of, pictures
from tripod_view.player.packing import reel
from tripod_view.player.picture import Painter
from tripod_view.player.run_file import read_run
from tripod_view.player.serve import FilmServer
from tripod_view.player.video import NoFfmpegError, write_video

SCENE = """
name = "toy"
description = "A triangle that falls beside a ball"
dt = 0.01
[springs]
[ball]
radius = 0.02
"""


def arrays(count: int = 101) -> dict[str, Any]:
    """A run of a second: a triangle falls, a ball rolls and is lost."""
    time = 0.01 * np.arange(1, count + 1)
    corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0.01]])
    ball = np.zeros((count, 7))
    ball[:, 0], ball[:, 6] = 0.1 * time, 1.0
    return {
        "time": time,
        "positions": corners - np.array([0, 0, 0.1]) * time[:, None, None],
        "triangles": np.array([[0, 1, 2]]),
        "bodies": np.array([3]),
        "scene": np.array(SCENE),
        "version": np.array("1.2.3"),
        "energies": np.zeros((count, 3)),
        "ball": ball,
        "event_times": np.array([0.505]),
        "event_texts": np.array(["ball lost"]),
    }


def test_a_run_is_shown_with_what_it_has() -> None:
    film = film_of(arrays())
    assert film.title == "toy"
    assert_names(film.source, "tripod 1.2.3", "10 ms")
    assert [body.name for body in film.bodies] == ["springs"]
    assert [piece.name for piece in film.pieces] == ["ball", "ball"]
    assert [curve.title for curve in film.curves] == ["ball", "energies"]
    assert [(e.time, e.text) for e in film.events] == [(0.505, "ball lost")]
    assert film.times[[0, -1]].tolist() == [0.01, 1.01]
    assert np.diff(film.times).max() == pytest.approx(0.02)


@pytest.mark.parametrize("name", ["time", "triangles", "scene", "version"])
def test_what_is_missing_is_named(name: str) -> None:
    found = arrays()
    del found[name]
    with raises_naming(FilmError, f"{name}: ", "tripod run --out"):
        film_of(found)


@pytest.mark.parametrize(
    ("dt", "count", "corners", "most"),
    [(0.01, 101, 3, 51), (1e-4, 20_001, 9, 102), (0.01, 10**6, 3, 1501), (0.02, 2000, 10**5, 102), (0.1, 5, 3, 5)],
)  # fmt: skip
def test_there_are_not_too_many_pictures_and_the_last_is_one(
    dt: float, count: int, corners: int, most: int
) -> None:
    found = pictures(dt * np.arange(count), corners)
    assert most // 2 < len(found) <= most
    assert found[0] == 0
    assert found[-1] == count - 1


def test_a_run_without_a_step_is_no_film() -> None:
    with raises_naming(FilmError, "time: ", "one step"):
        film_of(arrays(0))


@pytest.mark.parametrize("name", ["positions", "energies", "ball"])
def test_arrays_of_another_length_are_named(name: str) -> None:
    found = arrays()
    found[name] = found[name][:-1]
    with raises_naming(FilmError, f"{name}: ", "101 rows"):
        film_of(found)


def changed(name: str, index: Any, value: float) -> Callable[[dict[str, Any]], None]:
    """Return a change of one number of an array."""

    def change(found: dict[str, Any]) -> None:
        found[name] = found[name].copy()
        found[name][index] = value

    return change


ARMS = np.tile([0.0, 0, 0, 0, 0, 0, 1, 1, 0, 0, 0.02, 0.01, 0.03], (2, 1))


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda a: a.pop("time"), ("time",)),
        (lambda a: a.update(time=np.array(1.0)), ("time", "shape", "steps")),
        (changed("time", 3, np.nan), ("time", "finite")),
        (lambda a: a.update(positions=a["positions"].ravel()), ("positions", "shape", "steps, any, 3")),
        (lambda a: a.update(positions=a["positions"].astype(str)), ("positions", "type <U32")),
        (changed("positions", (4, 1, 2), np.inf), ("finite positions",)),
        (lambda a: a.update(energies=np.zeros((101, 2))), ("energies", "(101, 2)", "steps, 3")),
        (changed("triangles", (0, 1), 3), ("triangles", "number 0", "nodes", "0 to 2")),
        (changed("triangles", (0, 1), -1), ("triangles", "number 0", "nodes", "0 to 2")),
        (lambda a: a.update(triangles=np.array([[0.0, 1, 2]])), ("triangles", "float64")),
        (lambda a: a.update(bodies=np.array([4])), ("bodies", "[4]", "3")),
        (lambda a: a.update(bodies=np.array([4, -1])), ("bodies", "[4, -1]")),
        (lambda a: a.update(arms=ARMS * np.nan, angles=np.zeros((101, 2)), slide=np.zeros(101)), ("arms", "finite")),
        (lambda a: a.update(arms=ARMS, angles=np.zeros((101, 3)), slide=np.zeros(101)), ("arms", "2 rows", "3 servos")),
        (lambda a: a.update(arms=ARMS[:, :12]), ("arms", "(2, 12)", "any, 13")),
        (lambda a: a.update(event_times=np.zeros(2)), ("event_texts", "event_times")),
        (lambda a: a.update(scene=np.array("x" * 9)), ("scene", "TOML")),
        (lambda a: a.update(scene=np.array("[springs]\n[ball]\nradius = 'x'")), ("scene", "ball.radius", "'x'")),
        (lambda a: a.update(scene=np.array("ball = 3\n[springs]")), ("scene", "ball.radius", "None")),
        (lambda a: a.update(scene=np.array("")), ("scene", "0 soft bodies")),
        (lambda a: a.update(scene=np.array("body = [3]")), ("scene", "body", "tables")),
        (lambda a: a.update(effector=np.zeros((101, 7))), ("scene", "platform.0.size.0")),
    ],
)  # fmt: skip
def test_arrays_that_no_run_writes_are_named(
    change: Callable[[dict[str, Any]], Any], named: tuple[str, ...]
) -> None:
    found = arrays()
    change(found)
    with raises_naming(FilmError, *named):
        film_of(found)


@pytest.mark.parametrize("steps", [[], [0, 101], [-1], [0.5]])
def test_steps_that_a_run_has_not_are_refused(steps: Any) -> None:
    with raises_naming(FilmError, "steps: ", "at least one", "whole numbers", "0 to 100"):
        film_of(arrays(), steps)


def test_pictures_that_come_one_after_the_other_are_those_of_the_whole() -> None:
    whole, made = arrays(), 0

    def so_far() -> dict[str, Any]:
        return {name: a[:made] if len(np.shape(a)) and len(a) == 101 else a for name, a in whole.items()}

    film, times, events = GrowingFilm(so_far, 0.01), [], []
    assert film.reel(0) == {"reel": None, "done": False}
    for made in (1, 40, 41, 60, 101):
        before = len(times)
        answer = film.reel(before)
        shown = np.arange(0, made, 2)[before:]
        if len(shown):
            assert answer["reel"] == reel(
                film_of(whole, shown, after=whole["time"][2 * before - 2] if before else -1)
            )
            times += whole["time"][shown].tolist()
            events += answer["reel"]["events"]
        else:
            assert answer["reel"] is None
        assert not answer["done"]
    film.finish()
    assert film.reel(len(times))["done"]
    assert times == film_of(whole).times.tolist()
    assert events == [[0.505, "ball lost"]]
    assert "toy" in film.page()


def test_the_last_step_is_shown_once_the_run_is_done() -> None:
    whole = arrays(100)
    film = GrowingFilm(lambda: whole, 0.01)
    film.finish()
    assert film.reel(0)["reel"] == reel(film_of(whole))
    assert film.reel(51) == {"reel": None, "done": True}


def asked(server: FilmServer, path: str, **headers: str) -> tuple[int, str, dict[str, str]]:
    """Return status, text and headers of an answer of the server."""
    url = urlsplit(server.url)
    assert url.hostname == "127.0.0.1"
    connection = http.client.HTTPConnection(url.hostname, url.port or 0, timeout=60)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    found = answer.status, answer.read().decode(), dict(answer.getheaders())
    connection.close()
    return found


def test_the_server_answers_who_knows_its_token_and_nobody_else() -> None:
    server = FilmServer(lambda: "the page", lambda first: {"reel": first, "done": True})
    try:
        token = urlsplit(server.url).path
        status, text, headers = asked(server, token)
        assert (status, text) == (200, "the page")
        assert headers["Cache-Control"] == "no-store"
        status, text, _ = asked(server, f"{token}/reel?from=7")
        assert (status, json.loads(text)) == (200, {"reel": 7, "done": True})
        for path in ("/", "/reel?from=0", f"{token}x", f"/x{token}"):
            assert asked(server, path)[0] == 403
        assert asked(server, token, Origin="http://elsewhere.example")[0] == 403
        assert asked(server, token, Host="elsewhere.example")[0] == 403
        assert asked(server, f"{token}/other")[0] == 404
        for words in ("", "?from=-1", "?from=x", "?from=1000000000000"):
            assert asked(server, f"{token}/reel{words}")[0] == 400
    finally:
        server.close()


def test_of_a_long_recording_only_what_is_shown_is_read(tmp_path: Path) -> None:
    """100 MB of positions, of which 1000 pictures of 200 nodes are 5 MB."""
    long = arrays(20_001)
    long["time"] = 1e-3 * np.arange(20_001)
    long["positions"] = np.zeros((20_001, 200, 3))
    long["positions"][:, :, 0] = np.arange(20_001)[:, None]
    long["bodies"] = np.array([200])
    np.savez_compressed(tmp_path / "run.npz", **long)
    shown = film_of(long)
    del long
    tracemalloc.start()
    film = film_of(read_run(tmp_path / "run.npz"))
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(film.times) == 1001
    for name in ("times", "bodies"):
        assert len(getattr(film, name)) == len(getattr(shown, name))
    np.testing.assert_array_equal(film.bodies[0].positions, shown.bodies[0].positions)
    assert most < 30e6


@pytest.mark.parametrize(
    ("change", "limits", "named"),
    [
        (lambda a: a.update(arms=np.zeros((10_000, 13))), {"MOST_STILL": 100_000}, ("arms", "1e+05")),
        (lambda a: a, {"MOST_ROW": 71}, ("positions", "72 bytes", "each step")),
        (lambda a: a.update(units=np.array([{}])), {}, ("not a recording", "units")),
    ],
)  # fmt: skip
def test_a_small_file_of_large_arrays_is_refused(
    change: Callable[[dict[str, Any]], Any],
    limits: dict[str, int],
    named: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = arrays()
    change(found)
    np.savez_compressed(tmp_path / "run.npz", **found)
    for name, value in limits.items():
        monkeypatch.setattr(run_file, name, value)
    with raises_naming(FilmError, *named):
        film_of(read_run(tmp_path / "run.npz"))


def test_a_recording_cut_within_its_steps_is_named(tmp_path: Path) -> None:
    """A member that is shorter than its header says."""
    path = tmp_path / "run.npz"
    np.savez(path, **arrays())
    with zipfile.ZipFile(path) as whole:
        members = {name: whole.read(name) for name in whole.namelist()}
    members["positions.npy"] = members["positions.npy"][:-24]
    with zipfile.ZipFile(path, "w") as cut:
        for name, data in members.items():
            cut.writestr(name, data)
    with raises_naming(FilmError, path, "not a recording", "positions", "step 100"):
        film_of(read_run(path))


def test_a_recording_is_read_and_anything_else_is_named(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    np.savez(path, **arrays())
    assert film_of(read_run(path)).times.tolist() == film_of(arrays()).times.tolist()
    other = tmp_path / "run.txt"
    other.write_text("words")
    with raises_naming(FilmError, other, ".npz", "--out run.npz"):
        read_run(other)
    path.write_text("words")
    with raises_naming(FilmError, path, "not a recording"):
        read_run(path)
    np.savez(path, scene=np.array([{"code": 1}], dtype=object))
    with raises_naming(FilmError, path, "not a recording", "object arrays"):
        read_run(path)


def test_a_picture_shows_what_is_near_before_what_is_far() -> None:
    film = film_of(arrays())
    first, last = (Painter(film, (160, 120)).picture(k) for k in (0, len(film.times) - 1))
    assert first.shape == (120, 160, 3)
    blue = [int(((p[..., 2] > 150) & (p[..., 0] < 120)).sum()) for p in (first, last)]
    red = [int(((p[..., 0] > 120) & (p[..., 1] < 70)).sum()) for p in (first, last)]
    assert min(blue) > 100
    assert min(red) > 30
    assert (first != last).any()


def test_the_curves_are_drawn(tmp_path: Path) -> None:
    path = tmp_path / "curves.png"
    write_plot(film_of(arrays()), path)
    assert path.read_bytes().startswith(b"\x89PNG")


def stand_in(folder: Path, monkeypatch: pytest.MonkeyPatch, *, code: int = 0) -> Path:
    """Put a program in the place of ffmpeg that writes its options and how many bytes it was given; return that."""
    program = folder / "ffmpeg"
    program.write_text(
        f"#!{sys.executable}\nimport sys\nread = len(sys.stdin.buffer.read()) if {code} == 0 else 0\n"
        f"print('no such codec', file=sys.stderr) if {code} else None\n"
        f"open(sys.argv[-1], 'w').write(' '.join(sys.argv[1:]) + f' {{read}}')\nsys.exit({code})\n"
    )
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder))
    return program


@pytest.mark.parametrize(("kind", "count"), [("gif", 26), ("mp4", 51)])
def test_ffmpeg_gets_each_picture(
    kind: str, count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(tmp_path, monkeypatch)
    monkeypatch.setattr(video, "SIZES", {".gif": (40, 30), ".mp4": (40, 30)})
    path, done = tmp_path / f"film.{kind}", []
    write_video(film_of(arrays()), path, done.append)
    words = path.read_text().split()
    assert int(words[-1]) == count * 40 * 30 * 3
    assert words[words.index("-r") + 1] == str(video.RATES[f".{kind}"])
    assert "40x30" in words
    assert len(done) == count
    assert done[-1] == 1


def test_what_ffmpeg_says_is_told_and_nothing_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(tmp_path, monkeypatch, code=3)
    with raises_naming(FilmError, "ffmpeg", "code 3", "no such codec"):
        write_video(film_of(arrays()), tmp_path / "film.gif")
    assert [p.name for p in tmp_path.iterdir()] == ["ffmpeg"]


def test_without_ffmpeg_one_is_told_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with raises_naming(NoFfmpegError, "apt-get install ffmpeg"):
        write_video(film_of(arrays()), tmp_path / "film.mp4")


def test_a_film_too_long_for_a_video_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(tmp_path, monkeypatch)
    long = arrays()
    long["time"] = 10 * long["time"]
    monkeypatch.setattr(video, "MOST_PICTURES", 100)
    with raises_naming(FilmError, "gif: ", "251 pictures", "at most 100", "--duration"):
        write_video(film_of(long), tmp_path / "film.gif")
