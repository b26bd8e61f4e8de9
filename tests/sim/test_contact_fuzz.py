"""Ten thousand contact configurations of every degeneracy: no crash, no NaN, no contact lost, nothing passed."""

import numpy as np

from tests.checks import random_rotation
from tests.sim.contact_bodies import G, ball_on, plate, step
from tripod_sim.contact.contact_set import ContactSet
from tripod_sim.contact.contact_solver import ContactSolver
from tripod_sim.contact.detection import LEAST, Detector
from tripod_sim.contact.response import Law
from tripod_sim.contact.start import passing
from tripod_sim.distance_kernels import point_triangle_distance, segment_segment
from tripod_sim.mesh.surfaces import Part, join

DISTANCE, ALARM = 1e-3, 3e-3

KINDS = ("general", "sliver", "coincident", "crossing", "parallel", "flat", "point", "huge", "tiny")


def degenerate(rng: np.random.Generator, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Two triangles near each other."""
    a, b = rng.standard_normal((2, 3, 3)) * 0.01
    if kind == "sliver":
        a[2] = 0.5 * (a[0] + a[1]) + 1e-12 * a[2]
    elif kind == "coincident":
        b[rng.integers(3)] = a[rng.integers(3)]
    elif kind == "crossing":
        b[1] = b[0] + 2 * (a.mean(axis=0) - b[0])
    elif kind == "parallel":
        b[1] = b[0] + (a[1] - a[0])
    elif kind == "flat":
        a[:, 2] = b[:, 2] = 0.0
    elif kind == "point":
        b[:] = b[0]
    elif kind == "huge":
        a *= 1e4
    elif kind == "tiny":
        a *= 1e-6
        b *= 1e-6
    turn = random_rotation(rng)
    return a @ turn.T, b @ turn.T


def distance_of(a: np.ndarray, b: np.ndarray) -> float:
    """Least distance of the features of two triangles."""
    least = np.inf
    for p, t in ((a, b), (b, a)):
        for k in range(3):
            least = min(least, point_triangle_distance(p[k], t[0], t[1], t[2])[3])
            for j in range(3):
                square = segment_segment(p[k], p[(k + 1) % 3], t[j], t[(j + 1) % 3])[2]
                least = min(least, square)
    return float(np.sqrt(least))


def assert_sound(found: ContactSet) -> None:
    c, n = found.arrays, found.count
    for name in ("weight", "normal", "offset", "pressure", "friction"):
        assert np.isfinite(getattr(c, name)[:n]).all(), name
    assert np.abs(np.linalg.norm(c.normal[:n], axis=1) - 1).max(initial=0.0) < 1e-9
    assert np.abs(c.weight[:n].sum(axis=1)).max(initial=0.0) < 1e-12
    assert len(np.unique(c.key[:n])) == n


def test_contact_is_found_wherever_two_triangles_are_near() -> None:
    rng, found, near = np.random.default_rng(4), ContactSet(), 0
    triangle, loose = np.array([[0, 1, 2]]), None
    for case in range(7000):
        kind = KINDS[case % len(KINDS)]
        a, b = degenerate(rng, kind)
        other = Part(b, triangle, fixed=case % 4 == 0)
        x = np.concatenate([a, b])
        if other.fixed or not loose:
            detector = Detector(join([Part(a, triangle), other])[0], x, DISTANCE, ALARM)
            loose = loose if other.fixed else detector  # of two that move the detector serves again
        else:
            detector = loose
        detector.near(x, found)
        assert_sound(found)
        gap = distance_of(a, b)
        near += gap < DISTANCE
        # what is apart is found by its distance; what passes through each other is named as such
        named = found.count > 0 or gap > 0.99 * ALARM or passing(Part(a, triangle), [other]).size > 0
        assert named, (case, kind, gap)
        assert found.count == 0 or gap < ALARM
        # and over a step: what was apart stays apart until the time returned
        end = x.copy()
        end[:3] += rng.standard_normal(3) * 10 ** rng.uniform(-4, 0)
        share = detector.met(x, end, found)
        assert_sound(found)
        assert 0 <= share <= 1
        if share < 1 and gap > 1e-9:
            for t in np.linspace(0, share, 5):
                y = x + t * (end - x)
                assert distance_of(y[:3], y[3:]) >= min(LEAST * DISTANCE, 0.49 * gap) - 1e-12, (case, kind)
    assert near > 1000


def test_ball_is_found_wherever_it_is_near_even_with_its_centre_on_a_feature() -> None:
    rng, found, radius = np.random.default_rng(5), ContactSet(), 0.004
    for case in range(3000):
        kind = KINDS[case % len(KINDS)]
        a, _ = degenerate(rng, kind)
        w = rng.dirichlet(np.ones(3))
        w = (w, np.eye(3)[case % 3], np.array([0.5, 0.5, 0.0]))[case % 3]
        away = rng.standard_normal(3)
        away *= (0.0, 1e-12, 0.5, 1.0, 1.5)[case % 5] * radius / np.linalg.norm(away)
        ball = Part((w @ a + away)[None], radius=radius, rigid=True)
        surfaces, x = join([ball, Part(a, np.array([[0, 1, 2]]), fixed=True)])
        detector = Detector(surfaces, x, DISTANCE, ALARM)
        detector.near(x, found)
        assert_sound(found)
        gap = float(np.sqrt(point_triangle_distance(x[0], x[1], x[2], x[3])[3])) - radius
        assert found.count > 0 or gap > 0.99 * ALARM, (case, kind, gap)


def test_ball_whose_centre_lies_on_the_plate_is_parted_slowly() -> None:
    world = ball_on(plate(), Law(distance=DISTANCE), [0.0, 0.0, 0.0])  # on the diagonal edge, too
    highest = 0.0
    for _ in range(200):
        report = step(world, 0.01)
        assert world.rigid
        assert np.isfinite(world.positions_now()).all()
        highest = max(highest, float(world.rigid.centre[0, 2]))
    assert report.pressed == 1
    np.testing.assert_allclose(world.rigid.centre[0], [0, 0, 0.051], atol=1e-4)
    assert highest < 0.051 + ContactSolver.PART_SPEED**2 / (2 * G)
