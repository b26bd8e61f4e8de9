"""`--colour`, an option of the commands that write films: fields of the simulator as colours of a film."""

import threading
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from tripod_sim.fields import NodalFields
    from tripod_view.player.film import Colouring
    from tripod_view.player.of_run import Fields

Colour = Annotated[
    str | None,
    typer.Option(
        metavar="FIELD[:LOW:HIGH]",
        help="Colour surfaces by displacement, von_mises, principal_max, principal_min, energy_density, stretch, "
        "tension, or, in a scene with [mesh_error], mesh_error; LOW and HIGH limit the colours, by default the range "
        "of the film.",
    ),
]


USUAL = ("displacement", "von_mises", "tension")
"""What a page in a file offers unless `--colour` asks for all: each field adds about 5 % to it."""


class ColourError(Exception):
    """A colouring that cannot be; the message says what is possible."""


@dataclass(frozen=True)
class Colours:
    """By what surfaces can be coloured, and are at first: arguments of `film_of`."""

    fields: "Fields | None" = None
    colouring: "Colouring | None" = None


def chosen_colour(text: str | None) -> "tuple[str, tuple[float, float] | None] | None":
    """Return the field and the limits of its colours that `--colour` names; None without it. Raises ColourError."""
    from tripod_sim.fields import FIELDS  # noqa: PLC0415 - not needed for the help

    if text is None:
        return None
    name, *ends = text.split(":")
    if name not in FIELDS:
        raise ColourError(f"--colour {text!r}: there is no field {name!r}; choose one of {', '.join(FIELDS)}")
    if not ends:
        return name, None
    try:
        low, high = map(float, ends)
    except ValueError:
        low = high = 0.0
    if not -float("inf") < low < high < float("inf"):
        raise ColourError(
            f"--colour {text!r}: the limits must be two numbers, the lower one first, such as {name}:0:2e4"
        )
    return name, (low, high)


def names_mesh_error(text: str | None) -> bool:
    """Return whether `--colour` names the error of the mesh, which must be recorded: positions do not tell it."""
    return text is not None and text.partition(":")[0] == "mesh_error"


def colours_of(
    fields: "NodalFields",
    text: str | None,
    *,
    page: bool = False,
    every: bool = False,
    mesh_error: bool = False,
) -> Colours:
    """Return the colours of a film.

    Args:
        fields: Of the bodies that it shows.
        text: What `--colour` says.
        page: Whether others than that of `text` can be chosen: all with it, the `USUAL` without.
        every: Whether all can be chosen in either case.
        mesh_error: Whether the error of the mesh was recorded.

    Raises:
        ColourError: there is no such field, or the bodies do not have it, or it was not recorded.
    """
    from tripod_sim.errors import SceneError  # noqa: PLC0415 - not needed for the help
    from tripod_sim.fields import FIELDS  # noqa: PLC0415
    from tripod_view.player.film import Colouring  # noqa: PLC0415

    chosen = chosen_colour(text)
    if names_mesh_error(text) and not mesh_error:
        raise ColourError(
            f"--colour {text!r}: the run has no array mesh_error; run a scene with [mesh_error] again, with --colour "
            "mesh_error and --out"
        )
    try:
        names = fields.checked((chosen[0],) if chosen and not names_mesh_error(text) else ())
    except SceneError as error:
        raise ColourError(f"--colour: {error}") from None
    colouring = Colouring(FIELDS[chosen[0]].label, chosen[1]) if chosen else None
    if every or (page and chosen):
        names = fields.names
    elif page:
        names = tuple(name for name in fields.names if name in USUAL)
    return Colours(_film_fields(fields, names), colouring)


def colours_of_recording(arrays: Mapping[str, Any], text: str | None) -> Colours:
    """Return the colours of a saved run, for which its simulation is built again; none without `text`.

    Raises:
        ColourError: as `colours_of`, and where the run does not fit its own scene.
        SceneError: its scene cannot be built.
    """
    if chosen_colour(text) is None:
        return Colours()
    from tripod_sim.scene.file import scene_from_toml  # noqa: PLC0415 - heavy
    from tripod_sim.simulation import Simulation  # noqa: PLC0415

    simulation = Simulation(scene_from_toml(str(arrays.get("scene", ""))))
    positions = arrays.get("positions")
    shape = simulation.positions.shape
    if getattr(positions, "shape", ())[1:] != shape:
        raise ColourError(
            f"--colour: the scene of the run now has {shape[0]} nodes, and its positions have not: a mesh file has "
            "changed since; leave out --colour"
        )
    return colours_of(simulation.fields(), text, page=True, mesh_error="mesh_error" in arrays)


def _film_fields(nodal: "NodalFields", names: tuple[str, ...]) -> "Fields | None":
    """Return what computes fields of pictures; threads of a server may call it at the same time."""
    if not names:
        return None
    import numpy as np  # noqa: PLC0415 - not needed for the help

    from tripod_host.arrays import FloatArray  # noqa: PLC0415
    from tripod_sim.fields import FIELDS  # noqa: PLC0415
    from tripod_view.player.film import Field  # noqa: PLC0415

    lock = threading.Lock()

    def fields(positions: FloatArray) -> list[Field]:
        with lock:
            rows = [nodal.values(names, x) for x in positions]
        return [
            Field(
                FIELDS[name].label,
                FIELDS[name].unit,
                np.stack([row[name] for row in rows]),
                FIELDS[name].signed,
            )
            for name in names
        ]

    return fields
