"""The broad phase finds what comparing all with all finds, whatever the boxes."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tripod_sim.contact.broad_kernels import sort_codes
from tripod_sim.contact.broad_phase import Boxes, Tree


def found(pairs: np.ndarray) -> list[tuple[int, int]]:
    return sorted(map(tuple, pairs.tolist()))


@given(st.integers(0, 2**32 - 1), st.integers(0, 300), st.sampled_from([4, 2**12, 2**24, 2**36, 2**48]))
def test_codes_are_sorted_by_all_their_bits_and_equal_ones_stay(seed: int, n: int, most: int) -> None:
    codes = np.random.default_rng(seed).integers(0, most, n)
    order, spare = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    sort_codes(codes, order, spare)
    np.testing.assert_array_equal(order, np.argsort(codes, kind="stable"))


def near(one: Boxes, other: Boxes, margin: float) -> np.ndarray:
    """Compares all with all: the reference."""
    apart = (one.low[:, None] - margin > other.high) | (one.high[:, None] + margin < other.low)
    return ~apart.any(axis=2)


def boxes_of(points: np.ndarray, size: int, radius: float = 0.0) -> Boxes:
    shapes = np.arange(len(points) // size * size).reshape(-1, size)
    boxes = Boxes(shapes, radius * np.arange(len(shapes)))
    boxes.sweep(points, points + 0.1 * points[::-1])
    return boxes


@given(
    st.integers(0, 2**32 - 1),
    st.integers(0, 60),
    st.integers(1, 60),
    st.sampled_from([0.0, 1e-3, 0.3]),
    st.sampled_from([0.0, 1e-2]),
    st.sampled_from(["cube", "plane", "line", "point", "grid", "wide"]),
)
def test_tree_finds_the_pairs_of_the_reference(
    seed: int, n: int, m: int, margin: float, radius: float, spread: str
) -> None:
    rng = np.random.default_rng(seed)

    def points(count: int) -> np.ndarray:
        x = rng.standard_normal((3 * count, 3))
        if spread == "grid":
            x = np.round(x)  # boxes that touch exactly
        if spread == "wide":
            x *= 10.0 ** rng.uniform(-6, 6, (len(x), 1))
        x[:, {"plane": 1, "line": 2}.get(spread, 3) :] = 0.0
        return x * (0.0 if spread == "point" else 1.0)

    query, boxes = boxes_of(points(n), 3, radius), boxes_of(points(m), 3, radius)
    tree = Tree(boxes)
    tree.update()
    assert found(tree.pairs(query, margin)) == found(np.argwhere(near(query, boxes, margin)))
    own = found(np.sort(tree.pairs(margin=margin), axis=1))
    assert own == found(np.argwhere(np.triu(near(boxes, boxes, margin), 1)))


def test_boxes_that_move_are_swept() -> None:
    start, end = np.zeros((2, 3)), np.array([[1.0, 0, 0], [0, 0, 0]])
    boxes = Boxes(np.array([[0]]), np.array([0.25]))
    boxes.sweep(start, end)
    np.testing.assert_array_equal(boxes.low, [[-0.25, -0.25, -0.25]])
    np.testing.assert_array_equal(boxes.high, [[1.25, 0.25, 0.25]])


def test_more_pairs_than_the_buffer_holds_are_all_reported() -> None:
    boxes = boxes_of(np.zeros((300, 3)), 1)
    tree = Tree(boxes)
    tree.update()
    assert len(tree.pairs()) == 300 * 299 // 2
    assert len(set(found(tree.pairs(boxes)))) == 300 * 300


def test_nothing_overlaps_nothing() -> None:
    empty = Boxes(np.zeros((0, 3), dtype=np.int64))
    tree = Tree(empty)
    tree.update()
    assert len(tree.pairs()) == 0
    full = Tree(boxes_of(np.ones((3, 3)), 3))
    full.update()
    assert len(full.pairs(empty)) == 0
