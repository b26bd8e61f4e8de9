"""A camera's lens: what turns pixels into directions. Read from the file that ROS's `camera_calibration` writes."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from tripod_host.arrays import FloatArray
from tripod_host.reading import read_file
from tripod_identify.errors import DataError

LARGEST_FILE = 65536
"""Bytes that a lens may have."""


@dataclass(frozen=True, eq=False)
class Lens:
    """A camera's lens.

    Attributes:
        size: Of its images, width and height [pixel].
        matrix: [[f_x, 0, c_x], [0, f_y, c_y], [0, 0, 1]] [pixel].
        distortion: Of the model plumb_bob, k1 k2 p1 p2 k3, or of rational_polynomial, three more.
    """

    size: tuple[int, int]
    matrix: FloatArray
    distortion: FloatArray


def read_lens(path: Path) -> Lens:
    """Return the lens in a file of `camera_calibration` (`ost.yaml`). Raises DataError."""
    try:
        table = yaml.safe_load(read_file(path, LARGEST_FILE).decode("utf-8"))
    except OSError as error:
        raise DataError(f"lens {path} cannot be read: {error.strerror or error}") from None
    except (UnicodeDecodeError, yaml.YAMLError, ValueError, RecursionError):
        raise DataError(
            f"lens {path} is not valid YAML; give the ost.yaml that `camera_calibration` writes"
        ) from None
    if not isinstance(table, dict):
        raise DataError(f"lens {path} contains no table; give the ost.yaml that `camera_calibration` writes")
    width, height = (_pixels(path, table, key) for key in ("image_width", "image_height"))
    matrix = _numbers(path, table, "camera_matrix", (9,)).reshape(3, 3)
    distortion = _numbers(path, table, "distortion_coefficients", (4, 5, 8))
    model = table.get("distortion_model", "plumb_bob")
    if model not in ("plumb_bob", "rational_polynomial"):
        raise DataError(f"lens {path}: distortion_model is {model!r}; known: plumb_bob, rational_polynomial")
    if not (matrix[0, 0] > 0 and matrix[1, 1] > 0 and np.array_equal(matrix[2], [0, 0, 1])):
        raise DataError(
            f"lens {path}: camera_matrix must have the form [[f_x, 0, c_x], [0, f_y, c_y], [0, 0, 1]]"
        )
    return Lens((width, height), matrix, distortion)


def _pixels(path: Path, table: dict[Any, Any], key: str) -> int:
    value = table.get(key)
    if isinstance(value, bool) or not isinstance(value, int) or not 16 <= value <= 16384:
        raise DataError(f"lens {path}: {key} is {value!r}; it must be 16 to 16384 pixels")
    return value


def _numbers(path: Path, table: dict[Any, Any], key: str, counts: tuple[int, ...]) -> FloatArray:
    part = table.get(key)
    data = part.get("data") if isinstance(part, dict) else None
    good = isinstance(data, list) and all(isinstance(v, int | float) for v in data)
    if not good or len(data or ()) not in counts or not np.isfinite(np.array(data, float)).all():
        wanted = " or ".join(map(str, counts))
        raise DataError(f"lens {path}: {key}.data must be {wanted} finite numbers")
    return np.array(data, dtype=np.float64)
