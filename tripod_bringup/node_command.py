"""`tripod sim|ik|driver|teleop|view|record`: one node in this process, its parameters in its help."""

import difflib
import importlib
import re
import shlex
import shutil
import sys
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from typer.core import TyperCommand

from tripod_bringup.node_values import (
    RawYaml,
    ValueSyntaxError,
    node_arguments,
    node_package,
    read,
    split_word,
    typed,
)
from tripod_graph.loopback import keep_local
from tripod_graph.run import split_ros

if TYPE_CHECKING:
    from tripod_graph.parameters import Parameter

BAD_ARGUMENTS = 2

SCENE_NODES: Final = ("sim", "ik")
"""Nodes that load a scene: `--set` changes its fields, too."""


@dataclass(frozen=True)
class NodeInfo:
    """A node as the command line shows it.

    Attributes:
        help: What it does, one line.
        examples: Command lines.
    """

    help: str
    examples: tuple[str, ...]


NODES: Final[Mapping[str, NodeInfo]] = {
    "sim": NodeInfo(
        "Run the simulator as a ROS node.",
        (
            "tripod sim",
            "tripod sim silicone --set material.young=3e5",
            "tripod sim --set pose_rate=100",
            'tripod sim --servo "0:0,0,0; 2:-0.7854,-0.7854,-0.7854"',
        ),
    ),
    "ik": NodeInfo(
        "Find servo angles for a target, or run the ROS node for it.",
        (
            'tripod ik --target "5mm 0 -6mm"',
            'tripod ik --target "5mm 0 -6mm" --accuracy 1%',
            'tripod ik --target "0 0 0.005" --goal orientation --tilt "0.2 -0.1" --json',
            'tripod ik --target "0 0 -0.004" --scene robot.toml --slide 23mm --posterior robot.json',
            "tripod ik",
            "tripod ik --set goal=orientation --set feedback=imu",
            "tripod ik --set feedback=pose --set observe_load=true",
        ),
    ),
    "driver": NodeInfo(
        "Run the driver of the servos.",
        (
            "tripod driver --set port=mock",
            "tripod driver --set port=/dev/ttyACM0 --set calibration=robot.yaml",
            "tripod driver --set protocol=legacy",
        ),
    ),
    "teleop": NodeInfo("Steer the robot from the keyboard.", ("tripod teleop",)),
    "view": NodeInfo(
        "Serve the page that shows and moves the robot.", ("tripod view", "tripod view --view-port 8081")
    ),
    "record": NodeInfo(
        "Record ROS topics into mcap files.",
        (
            "tripod record",
            "tripod record --topics 'sim/*' --topics /tf",
            "tripod record --all --set directory=my_recordings --set max_duration=60",
        ),
    ),
}


OLD_FORM: Final = re.compile(r"(?!__)([^=]*):=(.*)", re.DOTALL)
"""A setting as it was written before `--set`, which ROS still writes so."""


class UnknownParameterError(ValueError):
    """A node has no such parameter; the message says which one may be meant."""


def parameter_table(name: str) -> tuple["Parameter", ...]:
    """Return the parameters of the node `name`. Raises ImportError where it, or ROS, is not installed."""
    parameters: tuple[Parameter, ...] = importlib.import_module(f"{node_package(name)}.settings").PARAMETERS
    return parameters


def parse_values(words: Sequence[str], table: Sequence["Parameter"], node: str) -> dict[str, object]:
    """Return the values that `words` (NAME:=VALUE) set.

    Raises:
        ValueSyntaxError: one is no such word.
        UnknownParameterError: there is no such parameter.
        ParameterError, which is a ValueError: it cannot be that.
    """
    known = {p.name: p for p in table}
    values: dict[str, object] = {}
    for word in words:
        key, value = split_word(word)
        if parameter := known.get(key):
            values[key] = given = typed(value, type(parameter.default))
            parameter.taken(read(given) if isinstance(given, RawYaml) else given)
        elif key == "use_sim_time" or key.startswith("__"):  # __ns:= and __node:= remap
            values[key] = RawYaml(value)
        else:
            raise UnknownParameterError(unknown_name(f"parameter of {node}", key, sorted(known)))
    return values


def split_settings(
    settings: Sequence[str], node: str | None = None, known: Sequence[str] = ()
) -> tuple[list[str], list[str]]:
    """Return the words of `--set` that set parameters of nodes, as NAME:=VALUE, and those that set fields of the scene.

    Args:
        settings: Words PATH=VALUE. NODE.NAME sets a parameter of a node, anything else a field of the scene.
        node: The node, whose name may be left out; None: of `tripod up`, which has several.
        known: Names of the parameters of `node`.

    Raises:
        ValueSyntaxError: one is no such word, or names another node.

    >>> split_settings(["driver.rate=25", "dt=0.01"])
    (['driver.rate:=25'], ['dt=0.01'])
    >>> split_settings(["rate=25", "view.port=8081"], "view", ["rate", "port"])
    (['rate:=25', 'port:=8081'], [])
    """
    parameters: list[str] = []
    fields: list[str] = []
    for word in settings:
        path, equals, value = word.partition("=")
        first, _, rest = path.partition(".")
        if not equals or not path:
            raise ValueSyntaxError(
                f"--set {word!r} has no value; write --set NAME=VALUE, such as --set dt=0.01"
            )
        if rest and first not in NODES and (meant := difflib.get_close_matches(first, NODES, 1, 0.75)):
            raise ValueSyntaxError(f"--set {word!r}: no node is named {first!r}; did you mean {meant[0]!r}?")
        if rest and first in NODES and node not in (None, first):
            raise ValueSyntaxError(f"--set {word!r} is for the node {first}; this is {node}: leave it out")
        if rest and first in NODES:
            parameters.append(f"{rest if node else path}:={value}")
        elif node and (path in known or node not in SCENE_NODES):
            parameters.append(f"{path}:={value}")
        else:
            fields.append(word)
    return parameters, fields


def name_new_form(program: str, words: Sequence[str]) -> None:
    """Say on standard error how settings of the old form NAME:=VALUE are written now; nothing without any."""
    matches = [match for word in words if (match := OLD_FORM.fullmatch(word))]
    if matches:
        new = " ".join(f"--set {shlex.quote(f'{match[1]}={match[2]}')}" for match in matches)
        print(f"{program}: NAME:=VALUE is the old form; write {new}", file=sys.stderr)


def check_values(name: str, values: Mapping[str, object]) -> None:
    """Raise ValueError where the node `name` would refuse `values`, as `parse_values` gives them, beside its defaults.

    Raises:
        ImportError: it, or ROS, is not installed.
    """
    settings = importlib.import_module(f"{node_package(name)}.settings")
    known = {p.name: p for p in parameter_table(name)}
    given = {
        key: known[key].taken(read(value) if isinstance(value, RawYaml) else value)
        for key, value in values.items()
        if key in known
    }
    if check := getattr(settings, "check", None):
        check({p.name: p.default for p in known.values()} | given)


def unknown_name(what: str, name: str, known: Sequence[str]) -> str:
    """Return the message for a name that does not exist: with what is meant, perhaps, and what does exist."""
    close = difflib.get_close_matches(name, known, n=1)
    hint = f"did you mean {close[0]!r}? " if close else ""
    return f"no {what} is named {name!r}; {hint}known: {', '.join(known)}"


def run_node_command(
    name: str,
    words: Sequence[str],
    settings: Sequence[str] = (),
    *,
    subnet: bool,
    ros: Sequence[str] = (),
    beside: object = None,
) -> int:
    """Run the node `name` until it is told to stop; return its exit code.

    Args:
        name: Of the node.
        words: Its parameters, NAME:=VALUE.
        settings: Those that `--set` names, NAME=VALUE; of a node that loads a scene also fields of that.
        subnet: Whether others in the local network are heard.
        ros: Words of `--ros-args`.
        beside: What the main function of the node shall run beside it; None: nothing.
    """
    keep_local(subnet=subnet)
    try:
        module = importlib.import_module(f"{node_package(name)}.node")
    except ImportError as error:
        print(f"tripod {name}: {missing_import(error)}", file=sys.stderr)
        return 1
    name_new_form(f"tripod {name}", words if settings or name != "sim" else [])
    try:
        table = parameter_table(name)
        parameters, fields = split_settings(settings, name, [p.name for p in table])
        fields = [f"set:={';'.join(fields)}"] if fields else []
        values = parse_values([*words, *parameters, *fields], table, name)
    except ValueError as error:
        print(f"tripod {name}: {error}", file=sys.stderr)
        return BAD_ARGUMENTS
    own = [*node_arguments(values), *(["--subnet"] if subnet else [])]
    companion = {} if beside is None else {"beside": beside}
    code: int = module.main([*own, "--ros-args", *ros] if ros else own, **companion)
    return code


def missing_import(error: ImportError) -> str:
    """Return what to do when a module cannot be imported."""
    return f"{error}; run `make setup`, and `tripod doctor` to see what is missing"


class RosCommand(TyperCommand):
    """A command that leaves what stands between `--ros-args` and `--` to ROS, in `context.obj`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the command's own words."""
        own, ctx.obj = split_ros(args)
        words: list[str] = super().parse_args(ctx, own)
        return words


class NodeCommand(RosCommand):
    """A command whose help ends with the table of the node's parameters."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the usual help, then the table."""
        super().format_help(ctx, formatter)
        name = ctx.info_name
        try:
            table = parameter_table(name)
        except ImportError as error:
            print(f"The parameters cannot be listed: {missing_import(error)}")
            return
        print_parameters(name, table)


def print_parameters(name: str, table: Sequence["Parameter"]) -> None:
    """Print the parameters: name, default, unit and what is allowed in columns, the meaning below."""
    rows = [("name", "default", "unit", "allowed")]
    rows += [(p.name, _default(p.default), p.unit or "-", _allowed(p) or "any") for p in table]
    widths = [max(len(row[i]) for row in rows) for i in range(3)]
    print(f"Parameters of {name}: --set NAME=VALUE; in ROS's own words --ros-args -p NAME:=VALUE.\n")
    meanings = ["meaning", *(p.help + p.note for p in table)]
    for row, meaning in zip(rows, meanings, strict=True):
        columns = [f"{text:<{width}}" for text, width in zip(row, widths, strict=False)]
        print("  ".join(["", *columns, row[3]]).rstrip())
        wide = max(40, shutil.get_terminal_size().columns - 1)
        print(textwrap.fill(meaning, wide, initial_indent=" " * 6, subsequent_indent=" " * 6))
    print()


def _default(value: object) -> str:
    if isinstance(value, str):
        return value or '""'
    if isinstance(value, bool):
        return str(value).lower()
    return str(list(value)) if isinstance(value, list | tuple) else str(value)


def _allowed(parameter: "Parameter") -> str:
    text = parameter.allowed
    unit = f" {parameter.unit}"
    return text.removesuffix(unit) if parameter.unit else text
