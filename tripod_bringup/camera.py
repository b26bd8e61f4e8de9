"""Images of a camera, one at a time. Needs the extra `camera` (OpenCV)."""

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from tripod_identify.errors import DataError


def camera_images(source: str, size: tuple[int, int]) -> Callable[[], NDArray[np.uint8]]:
    """Return what takes an image of the camera `source`, a number or a path, of `size` pixels where it can.

    Raises DataError: there is none. So does what is returned, where no more images come.
    """
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # what is wrong is told below
    capture = cv2.VideoCapture(int(source) if source.isdigit() else source)
    if not capture.isOpened():
        raise DataError(
            f"--camera {source} cannot be opened; is it connected, and not used by another program?"
        )
    capture.set(cv2.CAP_PROP_FRAME_WIDTH, size[0])
    capture.set(cv2.CAP_PROP_FRAME_HEIGHT, size[1])

    def image() -> NDArray[np.uint8]:
        good, found = capture.read()
        if not good:
            raise DataError(f"--camera {source} sends no more images; is it still connected?")
        return np.asarray(found, dtype=np.uint8)

    return image
