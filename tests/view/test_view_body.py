"""Which meshes and node positions are drawn, and what is said of those that are not."""

import numpy as np
import pytest

from tests.messages import assert_names, raises_naming
from tripod_graph import names
from tripod_view.body import PATIENCE, Body, BodyError, Surface

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
ONE_WAY = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
OTHER_WAY = np.array([[1, 2, 3], [1, 3, 0]], np.uint32)


def body(triangles: np.ndarray = ONE_WAY) -> Body:
    made = Body()
    made.rebuild(Surface(SQUARE, triangles))
    return made


@pytest.mark.parametrize(
    ("nodes", "triangles", "named"),
    [
        (SQUARE, np.array([[0, 1, 4]], np.uint32), ("node 4", "has 4")),
        (SQUARE, np.zeros((0, 3), np.uint32), ("triangles", "(0, 3)", "(m, 3)")),
        (np.zeros((0, 3)), ONE_WAY, ("nodes", "(0, 3)", "(n, 3)")),
        (np.where(SQUARE == 1, np.nan, SQUARE), ONE_WAY, ("mesh node 1", "not finite")),
        (1e300 * SQUARE, ONE_WAY, ("mesh node 1", "beyond 1e+09 m")),
    ],
)
def test_bad_meshes_are_refused(nodes: np.ndarray, triangles: np.ndarray, named: tuple[str, ...]) -> None:
    with raises_naming(BodyError, *named):
        Surface(nodes, triangles)


def test_positions_that_fit_are_shaped() -> None:
    fitted = body().fit(7, np.arange(12.0))
    assert fitted is not None
    assert fitted.tolist() == [[0, 1, 2], [3, 4, 5], [6, 7, 8], [9, 10, 11]]


NAN = np.arange(12.0)
NAN[4] = np.nan


@pytest.mark.parametrize(
    ("topology_id", "positions", "named", "unsaid"),
    [
        (7, np.zeros(9), ("9 coordinates", "4 nodes"), PATIENCE),
        (7, np.zeros(13), ("13 coordinates", "4 nodes"), PATIENCE),
        (7, NAN, ("node 1", "not finite"), 0),
        (7, 1e160 * np.arange(12.0), ("node 0", "beyond 1e+09 m"), 0),
        (8, np.zeros(12), ("topology id 8", "has 7"), PATIENCE),
    ],
)
def test_positions_that_do_not_fit_are_counted(
    topology_id: int, positions: np.ndarray, named: tuple[str, ...], unsaid: int
) -> None:
    one = body()
    assert one.fit(7, SQUARE.ravel()) is not None
    for _ in range(unsaid):
        assert one.fit(topology_id, positions) is None
    assert one.skipped == 0
    assert one.fit(topology_id, positions) is None
    assert one.skipped == 1
    assert_names(one.reason, *named)
    assert one.fit(7, SQUARE.ravel()) is not None  # the next good one is drawn again


def test_positions_before_the_mesh_are_counted() -> None:
    early = Body()
    for _ in range(PATIENCE + 1):
        assert early.fit(7, np.zeros(12)) is None
    assert early.skipped == 1
    assert_names(early.reason, "no mesh")


def test_positions_about_a_change_of_the_mesh_are_passed_over_without_a_word() -> None:
    one = body()
    one.fit(7, SQUARE.ravel())
    for _ in range(3):
        one.rebuild(Surface(SQUARE[:3], ONE_WAY[:1]))
        for _ in range(PATIENCE):
            assert one.fit(7, SQUARE.ravel()) is None
        assert one.fit(8, SQUARE[:3].ravel()) is not None
        one.rebuild(Surface(SQUARE, ONE_WAY))
        assert one.fit(7, SQUARE.ravel()) is not None
    assert (one.skipped, one.reason) == (0, "")


def test_refused_positions_do_not_tell_the_id_of_the_mesh() -> None:
    one = body()
    assert one.fit(8, NAN) is None
    assert one.fit(7, SQUARE.ravel()) is not None


def test_positions_left_over_from_an_older_mesh_are_refused_though_their_count_fits() -> None:
    one = body()
    one.fit(7, SQUARE.ravel())
    assert one.rebuild(Surface(SQUARE, OTHER_WAY))
    for _ in range(PATIENCE + 1):
        assert one.fit(7, SQUARE.ravel()) is None
    assert_names(one.reason, "topology id 7", "older mesh")
    assert one.fit(9, SQUARE.ravel()) is not None
    assert one.rebuild(Surface(SQUARE, ONE_WAY))  # and back: the old id is known
    assert one.fit(9, SQUARE.ravel()) is None
    assert one.fit(7, SQUARE.ravel()) is not None


def test_the_same_mesh_again_is_no_change_but_moved_nodes_are() -> None:
    one = body()
    assert not one.rebuild(Surface(SQUARE.copy(), ONE_WAY.copy()))
    one.fit(7, SQUARE.ravel())
    assert one.rebuild(Surface(2 * SQUARE, ONE_WAY))
    assert one.fit(7, SQUARE.ravel()) is not None  # same nodes in the same order: same id


@pytest.mark.parametrize(
    ("topology_id", "values", "named"),
    [
        (7, np.zeros(3), ("3 values", "4 nodes")),
        (7, np.zeros(12), ("12 values", "4 nodes")),
        (7, np.zeros(0), ("0 values", "4 nodes")),
        (8, np.zeros(4), ("topology id 8", "has 7")),
    ],
)
def test_fields_that_do_not_fit_are_counted(
    topology_id: int, values: np.ndarray, named: tuple[str, ...]
) -> None:
    one = body()
    for _ in range(PATIENCE):
        assert one.fit_field(7, np.zeros(4)) is None  # the id of the mesh is not known yet
    assert one.skipped == 0
    assert one.fit(7, SQUARE.ravel()) is not None
    assert one.fit_field(7, np.zeros(4)) is not None
    for _ in range(PATIENCE + 1):
        assert one.fit_field(topology_id, values) is None
        assert one.fit(7, SQUARE.ravel()) is not None
    assert (one.skipped, one.topic) == (1, names.FIELD)
    assert_names(one.reason, *named)


def test_values_of_a_field_that_are_not_finite_are_none() -> None:
    one = body()
    one.fit(7, SQUARE.ravel())
    field = one.fit_field(7, np.array([1e38, np.nan, np.inf, -np.inf]))
    np.testing.assert_array_equal(field, [1e38, np.nan, np.nan, np.nan])
