"""The error of the mesh of the node's own model: in a thread, as often as its share allows, free where it is off."""

import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.scenes import SHARP
from tripod_ik.mesh_error import LiveMeshError, ModelMesh, mesh_of
from tripod_ik.model import StaticModel
from tripod_sim import SceneError, load_scene
from tripod_sim.integrators.report import MeshErrorReport
from tripod_sim.mesh_error.chord import NEAR

DEADLINE = 60.0
"""For a loaded machine [s]; nothing here waits so long unless it fails."""

ASKED = ["mesh.level=1", "clamp.stiffness=1.4e10", "mesh_error={}"]


@pytest.fixture(scope="module")
def model() -> StaticModel:
    return StaticModel(load_scene(SHARP, ASKED))


class Clock:
    """In place of `time` in the module: time passes where a test or a mesh lets it."""

    now = used = 0.0

    def monotonic(self) -> float:
        return self.now

    def thread_time(self) -> float:
        return self.used


class Mesh(ModelMesh):
    """Tells the same everywhere after a while by `clock`, the first time after a longer one, and only if it may."""

    def __init__(
        self,
        clock: Clock | None = None,
        *,
        takes: float = 0.0,
        first: float = 0.0,
        failure: Exception | None = None,
    ) -> None:
        self.clock, self.takes, self.first, self.failure = clock or Clock(), takes, first, failure
        self.asked, self.may = 0, threading.Event()
        self.may.set()

    def error(self, state: Any) -> MeshErrorReport:
        takes = self.takes if self.asked else self.first
        self.asked += 1
        assert self.may.wait(DEADLINE)
        if self.failure:
            raise self.failure
        self.clock.used += takes
        self.clock.now += takes
        return MeshErrorReport((0.0, 3e-5, 4e-5), state.time)


def moved(model: StaticModel, angle: float) -> Any:
    state = model.simulation.state.copy()
    state.joints[0] += angle
    return state


def finished(live: LiveMeshError) -> None:
    """Wait for the thread, which stands back behind all that is busy."""
    assert live._thread
    live._thread.join(DEADLINE)


def test_one_pose_after_another_is_told_as_alone(model: StaticModel) -> None:
    home = model.angles
    mesh = mesh_of(model)
    assert mesh
    for turn in (0.1, -0.2):
        model.move(home + np.array([turn, 0.0, 0.0]))
        told = mesh.error(model.simulation.state)
        alone = mesh_of(model)
        assert alone
        assert told.effector == pytest.approx(alone.error(model.simulation.state).effector, abs=NEAR)
        assert told.distance > 1e-5
    model.move(home)


def test_an_image_of_what_is_simulated_has_the_image_of_its_error(model: StaticModel) -> None:
    vector = [1.0, 2.0, 3.0]
    assert model.shown(vector).tolist() == vector
    image = model.symmetries()[1]
    here = model.save()
    model.restore((here[0], None, image))
    assert model.shown(vector) == pytest.approx(image.matrix @ vector)
    assert np.linalg.norm(model.shown(vector) - vector) > 0.1
    model.restore(here)


def test_it_is_told_once_for_each_pose_and_no_more_often_than_its_share_allows(
    model: StaticModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock()
    monkeypatch.setattr("tripod_ik.mesh_error.time", clock)
    mesh = Mesh(clock, takes=0.05, first=1.0)
    live = LiveMeshError(mesh, share=0.25)
    assert np.isnan(live.distance)

    def asked_at(angle: float, after: float) -> int:
        clock.now += after
        live.look(moved(model, angle))
        finished(live)
        return mesh.asked

    mesh.may.clear()
    live.look(model.simulation.state)
    live.look(moved(model, 0.1))  # the thread is busy: nobody waits for it
    mesh.may.set()
    finished(live)
    assert live.distance == pytest.approx(5e-5)
    assert mesh.asked == 1
    assert asked_at(0.2, after=0.0) == 2  # what is built once is not counted
    assert asked_at(0.3, after=2.9 * mesh.takes) == 2
    assert asked_at(0.3, after=0.2 * mesh.takes) == 3
    assert asked_at(0.3, after=100.0) == 3  # there it has been told


def test_where_there_is_no_richer_mesh_the_reason_is_kept_and_nobody_asks_again(model: StaticModel) -> None:
    mesh = Mesh(failure=SceneError("too many elements"))
    live = LiveMeshError(mesh, share=1e6)
    for angle in (0.0, 0.1, 0.2):
        live.look(moved(model, angle))
        finished(live)
    assert (mesh.asked, live.reason) == (1, "too many elements")
    assert np.isnan(live.distance)


@pytest.mark.parametrize("asked", [False, True])
def test_a_model_pays_for_it_only_where_its_scene_asks_for_it(asked: bool, tmp_path: Path) -> None:
    words = ASKED if asked else ASKED[:-1]
    code = (
        "import sys, time\n"
        "from tripod_ik.model import StaticModel\n"
        "from tripod_ik.own_model import OwnModel\n"
        "from tripod_ik.solve_once import solve_once\n"
        "from tripod_sim import load_scene\n"
        f"scene = load_scene({SHARP!r}, {words!r})\n"
        "import numpy as np\n"
        "own = OwnModel(lambda angles: StaticModel(scene, angles=angles), np.ones(3))\n"
        "while own.state_at(np.full(3, -1.4965)) is None: time.sleep(0.01)\n"
        "own.close()\n"
        "assert not own.failure, own.failure\n"
        "found = 'tripod_sim.mesh_error' in sys.modules\n"
        f"assert (found, own.mesh_error is not None) == ({asked}, {asked})\n"
        f"assert {asked} or 'mesh_error' not in solve_once(scene, [0.0, 0.0, -0.006], slide=0.035)\n"
        f"assert {asked} or 'tripod_sim.mesh_error' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=300)
