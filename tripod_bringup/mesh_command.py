"""`tripod mesh`: from the surface or the CAD file of a part to a mesh, with what is known of its errors."""

import json
import sys
from contextlib import nullcontext
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tripod_bringup.compiling import compiling_told
from tripod_bringup.long_work import in_process, interruptible, loading
from tripod_bringup.options import Json, Quiet, SceneName, examples, metres, within
from tripod_bringup.run_command import BAD_ARGUMENTS, FAILED, plain, print_rows, progress_bar

if TYPE_CHECKING:
    from tripod_sim.mesh.part.part import PartMesh
    from tripod_study.part import StepCost, Trial

FIRST = 5
"""Edges along the largest extent of the first mesh on the way to an accuracy."""

SHOWN = 8
"""Faces that are listed."""

COLOUR, PIXELS = (214, 160, 120), (960, 720)
"""Of the picture of a mesh: the surface, and columns and rows."""

HELP = (
    "Fill a part with tetrahedra: a surface (STL, OBJ) or the solids of a CAD file (STEP).\n\n"
    "Surfaces may have holes, turned triangles or cross themselves. Give the length of an edge, or an accuracy: then "
    "the mesh is refined until its estimated error is small enough. Exit codes: 0, 1 accuracy not reached, 2 bad "
    "arguments or a part that is refused."
)

commands = typer.Typer()


def share(text: str | float) -> float:
    """Return a share that may be written as 5%. Raises typer.BadParameter."""
    try:
        value = float(text[:-1]) / 100 if isinstance(text, str) and text.endswith("%") else float(text)
    except ValueError:
        raise typer.BadParameter(f"{text!r} is no number; type one such as 5%") from None
    return value


@commands.command(
    "mesh",
    help=HELP,
    epilog=examples(
        "tripod mesh part.step --size 3mm",
        "tripod mesh part.stl --unit mm --accuracy 5% --out part.vtu --picture part.png",
        "tripod mesh part.step --accuracy 5% --scene robot.toml",
    ),
)
def mesh(
    part: Annotated[Path, typer.Argument(metavar="PART", help="An STL, OBJ or STEP file.")],
    *,
    size: Annotated[
        float | None,
        typer.Option(
            parser=metres,
            metavar="LENGTH",
            help="Length of an edge \\[m], or as 3mm.",
            callback=within(0, unit="m", such_as="3mm", above=True),
        ),
    ] = None,
    accuracy: Annotated[
        float | None,
        typer.Option(
            parser=share,
            metavar="SHARE",
            help="Error of the largest displacement, such as 5%: of the part under its weight, held at one end of its "
            "longest side, or of --scene.",
            callback=within(0, 1, such_as="5%", above=True),
        ),
    ] = None,
    element: Annotated[str, typer.Option(help="t10 (quadratic) or t4 (linear).")] = "t10",
    unit: Annotated[
        str | None, typer.Option(help="Length unit of a surface: m, cm, mm, um, inch; guessed by default.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Mesh to write, .vtu or .msh \\[default: the part's name with .vtu]."
        ),
    ] = None,
    picture: Annotated[Path | None, typer.Option(metavar="FILE.png", help="Draw the mesh.")] = None,
    scene: SceneName = "",
    volume_change: Annotated[
        float,
        typer.Option(
            parser=share,
            metavar="SHARE",
            help="Largest change of the volume.",
            callback=within(0, 1, such_as="5%"),
        ),
    ] = 0.02,
    most_unknowns: Annotated[
        int,
        typer.Option(
            help="Unknowns that --accuracy may take.", callback=within(100, 200_000, such_as="20000")
        ),
    ] = 20_000,
    time_limit: Annotated[
        float,
        typer.Option(
            help="Longest time for one mesh \\[s].", callback=within(0, unit="s", such_as="300", above=True)
        ),
    ] = 300.0,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Mesh a part; the help is `HELP`."""
    options = Options(
        part, size, accuracy, element, unit, out or part.with_suffix(".vtu"), picture, scene, volume_change,
        most_unknowns, time_limit, json, quiet,
    )  # fmt: skip
    raise typer.Exit(mesh_command(options))


@dataclass(frozen=True)
class Options:
    """What `tripod mesh` is asked for; the help of each option is that of `mesh`.

    Attributes:
        part: File of the part.
        size: Length of an edge [m], or None.
        accuracy: Largest relative error, or None.
        element: `t10` or `t4`.
        unit: Of a surface, of `UNITS`; None: guessed.
        out: Mesh to write.
        picture: To draw, or None.
        scene: In which the error counts; empty: none.
        volume_change: Largest relative change of the volume.
        most_unknowns: That an accuracy may take.
        time_limit: For one mesh [s].
        as_json: Whether to print JSON.
        quiet: Whether to print nothing else.
    """

    part: Path
    size: float | None
    accuracy: float | None
    element: str
    unit: str | None
    out: Path
    picture: Path | None
    scene: str
    volume_change: float
    most_unknowns: int
    time_limit: float
    as_json: bool
    quiet: bool


def mesh_command(options: Options) -> int:
    """Mesh, write, report and return the exit code: 2 bad arguments, 1 accuracy not reached."""
    with loading("tripod mesh", shown=not options.quiet):
        from tripod_host.writing import scratch_folder  # noqa: PLC0415 - not needed for the help
        from tripod_sim.errors import SceneError, StepError  # noqa: PLC0415 - not needed for the help
        from tripod_sim.mesh.part.part import UNITS, PartSettings  # noqa: PLC0415
        from tripod_sim.mesh.write import write_mesh  # noqa: PLC0415

    try:
        check_options(options)
        with (
            interruptible("tripod mesh", options.out, options.picture),
            progress_bar("reading the part", shown=not options.quiet and sys.stderr.isatty()) as progress,
            compiling_told("tripod mesh", progress.say if progress else None)
            if not options.quiet
            else nullcontext(),
            scratch_folder() as folder,
        ):
            say = Said(progress.say if progress else None, quiet=options.quiet)
            settings = PartSettings(
                options.size or 0.0,
                UNITS[options.unit] if options.unit else None,
                options.element,
                options.volume_change,
                options.time_limit,
            )
            job = Job(options.part, settings, options.scene, folder / "part.msh", say)
            trials, why = (
                job.meshes_for(options.accuracy, options.most_unknowns)
                if options.accuracy is not None
                else job.one_mesh()
            )
            assert job.made
            say("timing a step")
            cost = job.cost()
            write_mesh(options.out, job.made.mesh, job.made.faces)
            if options.picture is not None:
                draw(job.made, options.part.name, options.picture)
    except (SceneError, StepError) as error:
        print("tripod mesh: " + " ".join(str(error).split()), file=sys.stderr)
        return BAD_ARGUMENTS if isinstance(error, SceneError) else FAILED
    except OSError as error:
        print(f"tripod mesh: {error.filename} cannot be written: {error.strerror}", file=sys.stderr)
        return BAD_ARGUMENTS
    files = [path for path in (options.out, options.picture) if path is not None]
    table = as_table(job.made, trials, cost, files)
    reached = not why
    if options.as_json:
        print(json.dumps(plain({**table, "reached": reached})))
    elif not options.quiet:
        print_rows(rows(job.made, trials, cost, files))
    if options.accuracy is not None and not reached:
        found = f"the error is {100 * trials[-1].error:.2g} %, above {100 * options.accuracy:.3g} %"
        print(f"tripod mesh: {found}: {why}, or accept the error", file=sys.stderr)
    return 0 if reached else FAILED


def check_options(options: Options) -> None:
    """Raise SceneError or OSError where options do not fit together, or a file cannot be written."""
    from tripod_host.writing import check_place  # noqa: PLC0415 - not needed for the help
    from tripod_sim.errors import SceneError  # noqa: PLC0415
    from tripod_sim.mesh.part.part import UNITS  # noqa: PLC0415
    from tripod_sim.mesh.write import check_writable  # noqa: PLC0415

    if (options.size is None) == (options.accuracy is None):
        raise SceneError("give either --size, such as 3mm, or --accuracy, such as 5%")
    if options.scene and options.accuracy is None:
        raise SceneError("--scene is where the error is estimated; give --accuracy with it")
    if options.element not in ("t10", "t4"):
        raise SceneError(f"--element is {options.element!r}; allowed: t10, t4")
    if options.unit is not None and options.unit not in UNITS:
        raise SceneError(f"--unit is {options.unit!r}; allowed: {', '.join(UNITS)}")
    check_writable(options.out, "--out")
    for path in (options.out, options.picture):
        if path is not None:
            check_place(path)
    if options.picture is not None:
        check_picture(options.picture)


class Said:
    """Says what is being done: in a bar, else a line for each new thing on standard error."""

    def __init__(self, bar: Any, *, quiet: bool) -> None:
        """`bar`: takes a text; None: there is none."""
        self._bar, self._quiet, self._last = bar, quiet, ""

    def __call__(self, text: str) -> None:
        """Say it."""
        if self._bar:
            self._bar(text)
        elif not self._quiet and (kind := text.partition(":")[0]) != self._last:
            self._last = kind
            print(f"tripod mesh: {kind}", file=sys.stderr, flush=True)


class Job:
    """The meshes of one part.

    Attributes:
        made: The last one; None before the first.
    """

    def __init__(self, part: Path, settings: Any, scene: str, file: Path, say: Said) -> None:
        """`file`: where a mesh is kept while it is judged."""
        self._part, self._settings, self._scene, self._file, self._say = part, settings, scene, file, say
        from tripod_study.part import FILL  # noqa: PLC0415 - not needed for the help

        self.made: PartMesh | None = None
        self._fill = FILL

    def one_mesh(self) -> "tuple[list[Trial], str]":
        """Make the mesh of the size that is given."""
        self._make(self._settings.size)
        return [], ""

    def meshes_for(self, accuracy: float, most: int) -> "tuple[list[Trial], str]":
        """Make meshes until one is accurate enough; return what was tried, and why there is no finer one."""
        from tripod_sim.mesh.part.part import free_memory, part_extent  # noqa: PLC0415 - not needed for the help
        from tripod_study.part import refined  # noqa: PLC0415

        start = part_extent(self._part, self._settings, "PART") / FIRST
        return refined(start, accuracy, most, free_memory(), self._trial)

    def cost(self) -> "StepCost":
        """Return what a step costs."""
        from tripod_study.part import step_cost  # noqa: PLC0415 - not needed for the help

        return step_cost(self._judged())

    def _make(self, size: float) -> None:
        from tripod_sim.mesh.part.part import mesh_part  # noqa: PLC0415 - not needed for the help
        from tripod_sim.mesh.write import write_mesh  # noqa: PLC0415
        from tripod_study.part import HELD, held_faces  # noqa: PLC0415

        self.made = mesh_part(self._part, replace(self._settings, size=size), "PART", self._say)
        mesh = self.made.mesh
        write_mesh(self._file, mesh, {**self.made.faces, HELD: held_faces(mesh)})

    def _trial(self, size: float) -> "Trial":
        """Return the mesh of a size with its estimated error."""
        from tripod_sim.errors import SceneError  # noqa: PLC0415 - not needed for the help
        from tripod_sim.mesh.part.part import free_memory, mean_edge  # noqa: PLC0415
        from tripod_study.part import error_need, judged  # noqa: PLC0415

        self._make(size)
        assert self.made
        need, room = error_need(3 * len(self.made.mesh.nodes), self._fill), free_memory()
        words = f"about {float(f'{need.unknowns:.2g}'):.0f} unknowns, {need.memory / 1e9:.2g} GB"
        if need.memory > room:
            raise SceneError(
                f"the error of the mesh with edges of {1e3 * size:.3g} mm takes a solution with {words} of memory, and "
                f"{room / 1e9:.2g} GB are free; give a --size, or simplify the part"
            )
        text = f"estimating the error of edges of {1e3 * size:.3g} mm ({words}, about {need.seconds:.0f} s)"
        try:
            trial = in_process(
                lambda taken: self._say(f"{text}: {taken:.0f} s"),
                judged,
                self._judged(),
                size,
                mean_edge(self.made.mesh),
            )
        except MemoryError as error:
            raise SceneError(f"the memory did not suffice for {words}: {error}; give a --size") from None
        self._fill = trial.fill
        return trial

    def _judged(self) -> Any:
        """Return the scene in which the mesh is judged."""
        from tripod_sim.scene.file import load_scene  # noqa: PLC0415 - not needed for the help
        from tripod_study.part import bar_scene, scene_with  # noqa: PLC0415

        assert self.made
        if self._scene:
            return scene_with(load_scene(self._scene), self._file)
        return bar_scene(self._file, self.made.mesh.nodes)


def check_picture(path: Path) -> None:
    """Raise SceneError unless a picture can be drawn into `path`."""
    from tripod_sim.errors import SceneError  # noqa: PLC0415 - not needed for the help

    if path.suffix.lower() != ".png":
        raise SceneError(f"--picture is {str(path)!r}; it must end in .png")
    try:
        import PIL  # noqa: F401, PLC0415
    except ImportError:
        raise SceneError("--picture needs the package pillow (pip install 'tripod[view]')") from None


def draw(made: "PartMesh", title: str, path: Path) -> None:
    """Draw a mesh with the edges of its elements."""
    import numpy as np  # noqa: PLC0415 - not needed for the help
    from PIL import Image  # noqa: PLC0415

    from tripod_host.writing import replaced  # noqa: PLC0415
    from tripod_view.player.film import Deforming, Film  # noqa: PLC0415
    from tripod_view.player.picture import Painter  # noqa: PLC0415

    mesh = made.mesh
    rows = np.concatenate([faces.nodes for faces in mesh.boundary])
    loop = rows if rows.shape[1] == 3 else rows[:, [0, 3, 1, 4, 2, 5]]
    lines = np.unique(
        np.sort(np.stack([loop, np.roll(loop, -1, axis=1)], axis=2).reshape(-1, 2), axis=1), axis=0
    )
    body = Deforming(title, mesh.surface, mesh.nodes[None], COLOUR, lines=lines)
    pixels = Painter(Film(title, np.zeros(1), (body,)), PIXELS).picture(0)
    with replaced(path) as file:
        Image.fromarray(pixels).save(file, "PNG")


def as_table(made: "PartMesh", trials: "list[Trial]", cost: "StepCost", files: list[Path]) -> dict[str, Any]:
    """Return all that is known of a mesh, in SI units."""
    return {
        "tool": made.tool,
        "element": made.mesh.kind.name,
        "elements": made.mesh.count,
        "nodes": len(made.mesh.nodes),
        "unknowns": cost.unknowns,
        "volume": made.volume,
        "volume_before": made.volume_before,
        "distance": made.distance,
        "worst_quality": float(made.quality.min()),
        "cavities": list(made.cavities),
        "faces": list(made.faces),
        "step": cost.step,
        "dt": cost.dt,
        "trials": [asdict(trial) for trial in trials],
        "notes": list(made.notes),
        "written": [str(path) for path in files],
    }


def rows(
    made: "PartMesh", trials: "list[Trial]", cost: "StepCost", files: list[Path]
) -> list[tuple[str, str]]:
    """Return what is known of a mesh as names and texts for people."""

    def placed(face: str) -> str:
        """Return a face's name with the mean place of its nodes [mm]."""
        place = made.mesh.nodes[made.faces[face]].mean(axis=(0, 1))
        return f"{face} at ({', '.join(f'{round(1e3 * c, 3) + 0.0:.3g}' for c in place.tolist())})"

    low, high = made.mesh.nodes.min(axis=0), made.mesh.nodes.max(axis=0)
    reach = " x ".join(f"{1e3 * e:.4g}" for e in high - low)
    change = round(100 * (made.volume / made.volume_before - 1), 2) + 0.0  # no -0.00
    found = [
        ("part", f"{reach} mm, from ({', '.join(f'{1e3 * c:.4g}' for c in low)}) mm"),
        (
            "mesh",
            f"{made.mesh.count} elements {made.mesh.kind.name} by {made.tool}, {cost.unknowns} unknowns",
        ),
        (
            "volume",
            f"{1e9 * made.volume:.4g} mm³, before {1e9 * made.volume_before:.4g} mm³ ({change:+.2f} %)",
        ),
        ("surface", f"at most {1e3 * round(made.distance, 9):.2g} mm from that of the part"),
        ("quality", f"{made.quality.min():.2g} of the worst element (1: a right angle, 0: flat)"),
        ("step", f"{1e3 * cost.step:.3g} ms of computing for {1e3 * cost.dt:.3g} ms, on this machine"),
    ]
    for k, volume in enumerate(made.cavities):
        found.append((f"cavity {k}", f"{1e9 * volume:.4g} mm³, for a chamber: cavity = {k}"))
    if made.faces:
        more = len(made.faces) - SHOWN
        listed = ", ".join(map(placed, list(made.faces)[:SHOWN])) + (f" and {more} more" if more > 0 else "")
        found.append(
            ("faces", f"{listed}; sets of a scene{'' if files[0].suffix == '.msh' else ', by number'}")
        )
    for trial in trials:
        found.append(
            (
                "error",
                f"about {100 * trial.error:.2g} % of the largest displacement with edges of {1e3 * trial.size:.3g} mm, "
                f"{trial.unknowns} unknowns",
            )
        )
    found += [("note", note) for note in made.notes]
    return [*found, ("written", ", ".join(map(str, files)))]
