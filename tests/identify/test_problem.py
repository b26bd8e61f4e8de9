"""Derivatives of predictions, against differences of whole solutions; what cannot be fitted is refused."""

import re

import numpy as np
import pytest

from tests.identify.robots import MOVING, POSE, beam, commands, measured, tripod
from tests.messages import raises_naming
from tripod_identify.csv_columns import Channel
from tripod_identify.errors import DataError
from tripod_identify.measured import Measured
from tripod_identify.model import plainly
from tripod_identify.observe import Point, sources_of
from tripod_identify.parameters import parameters
from tripod_identify.problem import Problem
from tripod_sim import SceneError, load_scene

TIP = tuple(Channel("tip", axis) for axis in range(3))
FAR = tuple(Channel("far", axis) for axis in range(3))


def assert_jacobian(problem: Problem, u: np.ndarray, h: float, rel: float) -> None:
    J = problem.jacobian(u)
    for j, p in enumerate(problem.wanted):
        d = h * (np.arange(len(u)) == j)
        difference = (problem.at(u + d).values - problem.at(u - d).values) / (2 * h)
        size = np.abs(difference).max()
        assert size > 1e-7, p.name
        assert J[..., j] == pytest.approx(difference, abs=rel * size), p.name


def test_poses_of_the_tripod_answer_to_every_kind_of_value() -> None:
    scene = tripod("servos.slide=0.02")
    names = ["material.young", "material.poisson", "material.mass", "servos.zero", "servos.gain.1", "servos.slide",
             "servos.axis_radius", "frame", "mount"]  # fmt: skip
    problem = Problem(
        plainly(scene), parameters(scene, names), measured(plainly(scene), commands(2)[0], None), ()
    )
    u = problem.start() + np.random.default_rng(3).uniform(-0.1, 0.1, 18)
    assert len(u) == 18
    assert_jacobian(problem, u, 5e-3, 2e-3)


def test_a_beam_answers_to_load_material_and_mesh() -> None:
    scene = beam()
    data = Measured(None, None, None, (*TIP, *FAR), np.zeros((1, 6)))
    glued = (Point("far", "tip", (0.1, 0.01, 0.06)),)
    problem = Problem(plainly(scene), parameters(scene, ["material.young", "load.0.mass"]), data, glued)
    assert_jacobian(problem, problem.start() + 0.1, 3e-3, 5e-4)
    with raises_naming(DataError, "--point 'tip'", "already"):
        Problem(plainly(scene), (), problem.measured, (Point("tip", "tip", (0, 0, 0)),))


def test_a_motion_answers_to_damping_and_its_start() -> None:
    scene = beam(MOVING)
    data = Measured(np.linspace(0, 0.15, 16), None, None, TIP, np.zeros((16, 3)))
    wanted = parameters(scene, ["material.young", "damping.stiffness", "start"])
    problem = Problem(plainly(scene), wanted, data, ())
    assert_jacobian(problem, problem.start() + 0.1 * (np.arange(3) == 2), 1e-2, 0.05)


@pytest.mark.parametrize(
    ("name", "named"),
    [
        ("material.yuong", ("'yuong'", "material.young?")),
        ("material.law", ("'neo_hooke'", "not a number", "material.young")),
        ("material.density", ("no value", "--set material.density=")),
        ("mesh.level", ("whole number", 8)),
        ("time_error.tolerance", ("'tolerance'", "time_error is off", "[time_error]")),
        ("servo.zero", ("'zero'", "servos.zero?")),
        ("zero", ("'zero'", "servos.zero?")),
        ("gravity.acceleration", ("3 numbers", "gravity.acceleration.2?")),
        ("servos.zero.3", ("servos.zero", "0, 1, 2")),
        ("frame.q", ("frame", "x, y, z", "rx, ry, rz")),
    ],
)
def test_what_is_no_value_is_named(name: str, named: tuple[object, ...]) -> None:
    with raises_naming(DataError, f"--fit {name}", *named) as error:
        parameters(tripod(), [name])
    assert "\n" not in str(error.value)
    for meant in re.findall(r"did you mean (\S+)\?", str(error.value)):
        assert parameters(tripod(), [meant])


def test_values_that_the_data_have_nothing_to_do_with_are_refused() -> None:
    scene, (angles, slide) = tripod(), commands(2)
    data = Measured(None, angles, slide, POSE, np.zeros((2, 6)))
    for name, reason in (("damping.stiffness", "poses at rest"), ("servos.slide", "column")):
        with raises_naming(DataError, f"--fit {name}", reason):
            Problem(plainly(scene), parameters(scene, [name]), data, ())
    with raises_naming(DataError, "--fit servos.zero", "'beam'", "no servos"):
        parameters(beam(), ["servos.zero"])
    with raises_naming(DataError, "--fit material.young", "twice"):
        parameters(scene, ["material.young", "material.young"])


def test_two_robots_in_one_scene_are_not_compared() -> None:
    with raises_naming(SceneError, "'two_tripods'", "[body.servos]", "[servos]"):
        plainly(load_scene("two_tripods"))


def test_an_effector_that_is_a_set_has_no_orientation() -> None:
    assert sources_of(load_scene("finger_cable"), ()) == (
        "tip",
    )  # its effector is a set, and has no orientation
