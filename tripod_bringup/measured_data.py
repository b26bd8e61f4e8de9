"""Measured data from the command line: a CSV file or a recording, and what its columns mean in a scene."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tripod_host.writing import check_place
from tripod_identify.errors import DataError

if TYPE_CHECKING:
    from tripod_identify.measured import Measured
    from tripod_identify.observe import Point
    from tripod_sim.scene import Scene


def opened(
    scene: str,
    path: Path,
    *,
    align: str,
    overrides: Sequence[str],
    points: Sequence[str],
    renames: Sequence[str],
    poses: bool,
    places: "Sequence[Path | None]",
) -> "tuple[Scene, list[Point], Measured]":
    """Return what `tripod identify` begins with: the scene, the points, the data.

    Args:
        scene: Name or file of a scene.
        path: CSV file or recording.
        align: Kind of the alignment.
        overrides: Of the scene, `table.field=value`.
        points: What is measured, as `NAME=PLACE:X,Y,Z`.
        renames: `OLD=NEW` of columns.
        poses: Whether the data are taken as poses at rest.
        places: Where results will be written; checked before the work.

    Raises:
        DataError, RecordError, SceneError: what is wrong with any of them.
    """
    from tripod_identify.alignment import KINDS  # noqa: PLC0415 - not needed for the help
    from tripod_identify.observe import parse_point  # noqa: PLC0415
    from tripod_sim.scene.file import load_scene  # noqa: PLC0415

    if align not in KINDS:
        raise DataError(f"--align is {align!r}; allowed: {', '.join(KINDS)}")
    for place in places:
        if place is not None:
            check_place(place)
    description = load_scene(scene, overrides)
    glued = [parse_point(text) for text in points]
    return description, glued, read_measured(path, description, glued, renames, poses=poses)


def read_measured(
    path: Path, scene: "Scene", points: "Sequence[Point]", renames: Sequence[str], *, poses: bool
) -> "Measured":
    """Return the data of a file for a scene. Raises DataError, RecordError."""
    from tripod_identify.measured import read_csv  # noqa: PLC0415 - not needed for the help
    from tripod_identify.model import check_servos  # noqa: PLC0415
    from tripod_identify.observe import sources_of  # noqa: PLC0415

    check_servos(scene)
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
