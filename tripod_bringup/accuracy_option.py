"""`--accuracy`, `--budget` and `--study`, options of the commands that load a scene."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from tripod_study.accuracy.choice import Choice

Accuracy = Annotated[
    str | None,
    typer.Option(
        metavar="5%",
        help="Take the cheapest setting with an error below this, by the scene's study: a percentage, draft, real-time "
        "or reference. --set wins.",
    ),
]

Study = Annotated[
    Path | None,
    typer.Option(
        "--study", metavar="FILE", help="Study (JSON) that --accuracy looks into; the scene's own by default."
    ),
]


Budget = Annotated[
    str | None,
    typer.Option(
        metavar="50%",
        help="Take the most exact setting, by the scene's study, that takes no more than this of one core, 50%, or "
        "than this time for each step, 2ms. --set wins.",
    ),
]


def wished(accuracy: str | None, budget: str | None) -> str | None:
    """Return what `--accuracy` or `--budget` asks for, in the words of the first. Raises SceneError for both."""
    from tripod_sim.errors import SceneError  # noqa: PLC0415 - not needed for the help

    if budget is None:
        return accuracy
    if accuracy is not None:
        raise SceneError(f"--accuracy {accuracy} and --budget {budget} exclude each other; leave one out")
    return f"budget {budget.strip()}"


def chosen(
    scene: str,
    accuracy: str | None,
    overrides: Sequence[str],
    study: Path | None,
    chooser: "Callable[..., Choice] | None" = None,
) -> "Choice | None":
    """Return the setting that the options ask for; None without `--accuracy`. Raises SceneError.

    `chooser` is what chooses; None: `tripod_study.accuracy.choice.choose`.
    """
    from tripod_sim.errors import SceneError  # noqa: PLC0415 - not needed for the help

    if accuracy is None:
        if study is not None:
            raise SceneError(
                "--study needs --accuracy or --budget: it is where the setting for an accuracy is looked up"
            )
        return None
    from tripod_study.accuracy.choice import choose  # noqa: PLC0415

    return (chooser or choose)(scene, accuracy, overrides, study=study)


OWN_STUDIES, MOST = Path("studies"), 50
"""Where `tripod study` writes by default, and how many of the newest files there are read."""


def own_study(scene: str, overrides: Sequence[str], folder: Path = OWN_STUDIES) -> Path | None:
    """Return the newest study in `folder` that was made of the scene as `overrides` change it.

    None where the study that comes with the scene serves, and where there is none. Raises SceneError: no such scene.
    """
    from tripod_sim.errors import SceneError  # noqa: PLC0415 - not needed for the help
    from tripod_sim.scene.file import load_scene  # noqa: PLC0415
    from tripod_study.accuracy.choice import study_of, unseen  # noqa: PLC0415

    made = load_scene(scene, overrides)
    files = sorted(folder.glob("*.json"), key=lambda path: path.stat().st_mtime, reverse=True)[:MOST]
    for path in (None, *files):
        with suppress(SceneError, OSError):  # of another scene, or no study at all
            if not unseen(scene, study_of(scene, made, path), made):
                return path
    return None
