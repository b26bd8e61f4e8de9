"""ArUco markers in images made from known poses, and the files of lenses."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.messages import raises_naming
from tripod_identify.errors import DataError
from tripod_identify.lens import Lens, read_lens

cv2 = pytest.importorskip("cv2", reason="the extra `camera` is not installed")

from tripod_identify.marker import MarkerFinder  # noqa: E402

SIZE = (1280, 720)
LENS = Lens(
    SIZE, np.array([[1000.0, 0, 630], [0, 1005.0, 370], [0, 0, 1]]), np.array([0.05, -0.1, 1e-3, -5e-4, 0])
)
SIDE, QUIET, CELL = 0.02, 2, 40
"""Side of a marker [m]; white cells around it; pixels of a cell in the drawing."""

FILE = """
image_width: 1280
image_height: 720
camera_name: desk
camera_matrix: {rows: 3, cols: 3, data: [1000, 0, 630, 0, 1005, 370, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0.05, -0.1, 0.001, -0.0005, 0]}
"""


def drawn(places: list[tuple[np.ndarray, np.ndarray]], number: int = 0, noise: float = 2.0) -> np.ndarray:
    """The image of markers at places [m] with rotation vectors [rad], in the camera's frame; blurred, noisy."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    inner = cv2.aruco.generateImageMarker(dictionary, number, 6 * CELL)
    picture = np.pad(inner, QUIET * CELL, constant_values=255)
    half = 0.5 * SIDE * (6 + 2 * QUIET) / 6
    corners = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])
    image = np.full(SIZE[::-1], 128, np.uint8)
    edge = len(picture)
    source = np.array([[0, 0], [edge, 0], [edge, edge], [0, edge]], np.float32) - 0.5
    fine = 4  # drawn larger and made smaller: edges between pixels
    flat = Lens(LENS.size, LENS.matrix, np.zeros(5))
    for place, turn in places:
        seen, _ = cv2.projectPoints(corners, turn, place, flat.matrix, flat.distortion)
        goal = ((seen.reshape(4, 2) + 0.5) * fine - 0.5).astype(np.float32)
        view = cv2.getPerspectiveTransform(source, goal)
        big = (SIZE[0] * fine, SIZE[1] * fine)
        layer = cv2.warpPerspective(picture, view, big, flags=cv2.INTER_AREA, borderValue=128)
        mask = cv2.warpPerspective(np.full_like(picture, 255), view, big)
        layer, mask = (cv2.resize(x, SIZE, interpolation=cv2.INTER_AREA) for x in (layer, mask))
        image = np.where(mask > 127, layer, image)
    image = bent(image)
    noisy = cv2.GaussianBlur(image, (3, 3), 0.7) + np.random.default_rng(1).normal(0, noise, image.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8)


def bent(image: np.ndarray) -> np.ndarray:
    """The image as LENS shows what a lens without distortion would: each pixel from where it would have been."""
    grid = (
        np.stack(np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1])), axis=-1)
        .reshape(-1, 1, 2)
        .astype(np.float64)
    )
    straight = cv2.undistortPoints(grid, LENS.matrix, LENS.distortion, P=LENS.matrix)
    straight = straight.reshape(*SIZE[::-1], 2).astype(np.float32)
    return cv2.remap(image, straight[..., 0], straight[..., 1], cv2.INTER_LINEAR, borderValue=128)


@pytest.mark.parametrize("colour", [False, True])
def test_a_marker_is_found_to_a_fraction_of_a_millimetre(colour: bool) -> None:
    rng = np.random.default_rng(3)
    errors = []
    for _ in range(12):
        place = np.array([*rng.uniform(-0.05, 0.05, 2), rng.uniform(0.2, 0.3)])
        turn = (
            Rotation.from_rotvec([np.pi, 0, 0]) * Rotation.from_rotvec(rng.uniform(-0.4, 0.4, 3))
        ).as_rotvec()
        image = drawn([(place, turn)])
        image = np.repeat(image[..., None], 3, axis=2) if colour else image
        found = MarkerFinder(LENS, SIDE).find(image)
        assert found is not None
        errors.append(found - place)
    errors = np.abs(errors)
    assert errors[:, :2].max() < 1e-4
    assert errors[:, 2].max() < 1e-3


FACING = np.array([np.pi, 0, 0])


HERE, THERE, FAR = np.array([0.03, 0, 0.25]), np.array([-0.03, 0, 0.25]), np.array([0, 0, 1.5])


@pytest.mark.parametrize(
    ("places", "number"),
    [([], 0), ([HERE], 1), ([FAR], 0), ([HERE, THERE], 0)],
    ids=["none", "another", "far", "twice"],
)
def test_what_is_no_sure_marker_gives_no_place(places: list[np.ndarray], number: int) -> None:
    assert MarkerFinder(LENS, SIDE).find(drawn([(p, FACING) for p in places], number)) is None


def test_an_image_of_another_size_is_refused() -> None:
    with raises_naming(DataError, "640 x 480 pixels", "lens", "1280 x 720"):
        MarkerFinder(LENS, SIDE).find(np.zeros((480, 640), np.uint8))


def test_a_lens_is_read(tmp_path: Path) -> None:
    (tmp_path / "ost.yaml").write_text(FILE)
    lens = read_lens(tmp_path / "ost.yaml")
    assert lens.size == SIZE
    np.testing.assert_array_equal(lens.matrix, LENS.matrix)
    np.testing.assert_array_equal(lens.distortion, LENS.distortion)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[1, 2]", ("table", "camera_calibration")),
        ("a: [", ("YAML",)),
        (FILE.replace("1280", "eleven"), ("image_width", "'eleven'", "16 to 16384 pixels")),
        (FILE.replace("[1000, 0,", "[1000, .nan,"), ("camera_matrix.data", "9 finite numbers")),
        (FILE.replace("[1000, 0,", "[-1000, 0,"), ("camera_matrix", "[[f_x, 0, c_x]")),
        (
            FILE.replace("-0.0005, 0]", "-0.0005, 0, 1]"),
            ("distortion_coefficients.data", "4 or 5 or 8 finite"),
        ),
        (FILE.replace("plumb_bob", "fisheye"), ("distortion_model", "'fisheye'", "plumb_bob")),
    ],
)
def test_a_wrong_lens_is_told_in_a_line(tmp_path: Path, text: str, named: tuple[str, ...]) -> None:
    (tmp_path / "ost.yaml").write_text(text)
    with raises_naming(DataError, tmp_path / "ost.yaml", *named) as error:
        read_lens(tmp_path / "ost.yaml")
    assert "\n" not in str(error.value)
    with raises_naming(DataError, tmp_path / "none.yaml"):
        read_lens(tmp_path / "none.yaml")
