"""Where an ArUco marker is, from one image. Needs the extra `camera` (OpenCV).

Its four corners are found to a fraction of a pixel, and its pose is that which puts them there [GarridoJuradoEtAl2014]
[CollinsBartoli2014]. Of the marker's two frames that a nearly flat view allows, the one that fits better is taken.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray
from tripod_identify.errors import DataError
from tripod_identify.lens import Lens

DICTIONARY = cv2.aruco.DICT_4X4_50
"""Of the markers that are looked for."""

SMALLEST = 24
"""Side of a marker in an image below which it is not measured [pixel]."""

AROUND = 0.5
"""White kept around a marker for a closer look, over its size."""

EDGE = 0.5
"""That way of finding corners counts pixels from the image's edge, a lens from the centre of the first [pixel]. It fits
lines to edges: others, in a blurred image, draw corners inwards, so that markers look 0.4 % and more too far."""


class MarkerFinder:
    """Finds one marker in images of one camera.

    Attributes:
        number: Of the marker in its dictionary.
    """

    def __init__(self, lens: Lens, side: float, number: int = 0) -> None:
        """`side`: of the marker's black square [m]; `number`: of the marker in the dictionary 4x4_50."""
        self._coarse, self._fine = (
            _detector(how) for how in (cv2.aruco.CORNER_REFINE_NONE, cv2.aruco.CORNER_REFINE_APRILTAG)
        )
        self._lens, self.number = lens, number
        half = 0.5 * side
        self._square = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])

    def find(self, image: NDArray[np.uint8]) -> FloatArray | None:
        """Return the marker's centre in the camera's frame, x right, y down, z ahead [m], shape (3,).

        None where it is not seen, too small to be measured, or seen twice.

        Args:
            image: Grey, shape (height, width), or colour, shape (height, width, 3).

        Raises:
            DataError: the image has another size than the lens was measured with.
        """
        if image.shape[:2] != self._lens.size[::-1]:
            has, wanted = image.shape[1::-1], self._lens.size
            raise DataError(
                f"the camera gives images of {has[0]} x {has[1]} pixels, but its lens was measured at "
                f"{wanted[0]} x {wanted[1]}; set the camera to that size or measure the lens again"
            )
        rough = self._corners_of(self._coarse, image)
        if rough is None or np.linalg.norm(rough - np.roll(rough, 1, axis=0), axis=1).min() < SMALLEST:
            return None
        about = np.ptp(rough, axis=0).max() * AROUND  # the fine way is slow on all of an image
        first = np.maximum(rough.min(axis=0) - about, 0).astype(np.int64)
        last = np.ceil(rough.max(axis=0) + about).astype(np.int64)
        fine = self._corners_of(self._fine, image[first[1] : last[1], first[0] : last[0]])
        if fine is None:
            return None
        seen = fine + first - EDGE
        found, _, place = cv2.solvePnP(
            self._square, seen, self._lens.matrix, self._lens.distortion, flags=cv2.SOLVEPNP_IPPE_SQUARE
        )
        return np.asarray(place, dtype=np.float64).reshape(3) if found and np.isfinite(place).all() else None

    def _corners_of(self, detector: cv2.aruco.ArucoDetector, image: NDArray[np.uint8]) -> FloatArray | None:
        """Return the corners of the marker [pixel], shape (4, 2); None where it is not seen once."""
        corners, numbers, _ = detector.detectMarkers(image)
        which = [] if numbers is None else np.flatnonzero(np.ravel(numbers) == self.number)
        return corners[which[0]].reshape(4, 2).astype(np.float64) if len(which) == 1 else None


def _detector(refinement: int) -> cv2.aruco.ArucoDetector:
    settings = cv2.aruco.DetectorParameters()
    settings.cornerRefinementMethod = refinement
    return cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(DICTIONARY), settings)
