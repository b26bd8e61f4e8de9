"""Recorded sessions of all scenes, made again: every body is the recorded one, bit for bit."""

from pathlib import Path

import numpy as np
import pytest

from tests.replay.sessions import run_session, write_session
from tripod_bringup.bag_session import read_session
from tripod_record.bag import Bag
from tripod_sim.rerun import Ended, Outcome, Rerun
from tripod_sim.scene_file import scene_names

SESSIONS = [(name, ()) for name in scene_names()] + [
    ("tripod", ("mesh.level=1", "dt=auto", "inertia.scheme=auto")),
    ("tripod", ("mesh.level=1", "inertia.scheme=bdf2", "time_error={}")),
    ("tripod", ("mesh.level=1", "servo_dynamics={}")),
    ("tripod", ("mesh.level=1", "solver.mode=newton")),
    ("tripod", ("mesh.level=1", "inertia=off", "damping=off")),
    ("pendulum", ("springs.nodes=8", "inertia.scheme=auto", "dt=auto")),
]


def made_again(rerun: Rerun) -> Outcome:
    while True:
        try:
            joints = rerun.joints()
        except Ended:
            return rerun.outcome
        rerun.simulation.step(joints)
        rerun.compare()


@pytest.mark.parametrize(("scene", "overrides"), SESSIONS, ids=lambda v: v if isinstance(v, str) else "-".join(v))
def test_a_session_made_again_is_the_recorded_one(scene: str, overrides: tuple[str, ...], tmp_path: Path) -> None:
    found = run_session(scene, overrides, steps=120, seed=len(scene), reset_at=50, checkpoint_at=85)
    path = write_session(found, tmp_path / "whole")
    outcome = made_again(read_session(Bag(path)).rerun())
    assert outcome.different == 0, outcome.parted
    assert (outcome.steps, outcome.lost, outcome.unknown) == (120, 0, 0)
    assert outcome.equal == len(found.bodies)
