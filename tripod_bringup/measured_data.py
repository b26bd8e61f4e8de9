"""Measured data from the command line: a CSV file or a recording, and what its columns mean in a scene."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tripod_identify.errors import DataError

if TYPE_CHECKING:
    from tripod_identify.measured import Measured
    from tripod_identify.observe import Point
    from tripod_sim.scene import Scene


def read_measured(
    path: Path, scene: "Scene", points: "Sequence[Point]", renames: Sequence[str], *, poses: bool
) -> "Measured":
    """Return the data of a file for a scene. Raises DataError, RecordError."""
    from tripod_identify.measured import read_csv  # noqa: PLC0415 - not needed for the help
    from tripod_identify.observe import sources_of  # noqa: PLC0415

    renamed = dict(map(_pair, renames))
    if path.suffix.lower() == ".csv":
        return read_csv(path, scene, sources_of(scene, points), renamed, poses=poses)
    if renamed:
        raise DataError("--rename is for the columns of CSV files; a recording has topics")
    from tripod_bringup.measured_bag import read_recording  # noqa: PLC0415

    return read_recording(path, scene, poses=poses)


def _pair(word: str) -> tuple[str, str]:
    old, equals, new = word.partition("=")
    if not (equals and old.strip() and new.strip()):
        raise DataError(f"--rename {word!r} is not of the form OLD=NEW")
    return old.strip(), new.strip()
