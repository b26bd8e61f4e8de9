"""`tripod up` from the command line: checks the options before anything is locked, started or moved."""

import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from tripod_bringup.accuracy_option import chosen, wished
from tripod_bringup.node_command import (
    UnknownParameterError,
    check_values,
    missing_import,
    parameter_table,
    parse_values,
    split_settings,
    unknown_name,
)
from tripod_bringup.node_values import RawYaml, split_word
from tripod_bringup.options import MOCK
from tripod_bringup.screen import Screen
from tripod_bringup.script import joint_path
from tripod_bringup.up import BAD_ARGUMENTS, DEMO_TIME, EXIT_CODES, UpOptions, up
from tripod_graph import names
from tripod_graph.command import CommandLimits
from tripod_graph.loopback import keep_local
from tripod_graph.namespace import full_namespace

TWICE = {"--port": ("driver", "port"), "--view-port": ("view", "port"), "--record": ("record", "directory")}
"""Options that say the same as a parameter of a node."""

CHANNEL_UNITS = ("m", "Pa")
"""Of the joints beside servos that a board drives: winches, which pull cables, and pressures."""

if TYPE_CHECKING:
    from rclpy.executors import Executor

    from tripod_bringup.script_player import ScriptPlayer
    from tripod_sim.tables.joints import Actuator, Joints


def up_command(
    words: Sequence[str],
    *,
    scene: str,
    overrides: Sequence[str] = (),
    servo: str | None = None,
    slide: str | None = None,
    actuate: Sequence[str] = (),
    port: str,
    record: Path | None,
    view: bool,
    view_port: int | None,
    demo: bool,
    namespace: str,
    duration: float | None,
    subnet: bool,
    verbose: bool,
    accuracy: str | None = None,
    budget: str | None = None,
    study: Path | None = None,
) -> int:
    """Run the chain; return the exit code that `tripod_bringup.up` documents."""
    keep_local(subnet=subnet)
    try:
        scene, words = named_scene(words, scene)
        parameters, overrides = split_settings(overrides)
        words = [*words, *parameters]
        values = node_values(words)
        check_used(values, record=demo or record is not None, view=view)
        check_once(
            values, {"--port": port if port != MOCK else None, "--view-port": view_port, "--record": record}
        )
        namespace = full_namespace(namespace)
        add_overrides(values, overrides)
        asked = words_of_set(values)
        check_scene(scene, asked)
        if sentence := settle(scene, values, wished(accuracy, budget), study):
            print(sentence, file=sys.stderr)
        chain = chain_values(values, scene, asked, port)
        for node, given in chain.items():
            with naming(node):
                check_values(node, given)
        joints = servos_of(scene, words_of_set(values))
        undriven = why_undriven(joints.others) if joints else ""
        script = joint_path(scene, words_of_set(values), servo, slide, actuate)
        if script and demo:
            raise ValueError("--demo moves the robot itself; leave out --servo and --actuate")
        if duration is not None and not math.isfinite(duration):
            raise ValueError(f"--duration is {duration}; it must be finite")
    except ValueError as error:
        print(f"tripod up: {error}", file=sys.stderr)
        return BAD_ARGUMENTS
    except ImportError as error:
        print(f"tripod up: {missing_import(error)}", file=sys.stderr)
        return BAD_ARGUMENTS
    screen = Screen()
    if demo:
        record = record or Path("recordings")
        if duration is None and not screen.terminal:
            duration = DEMO_TIME
            screen.line(
                f"no terminal: the demo ends after {DEMO_TIME:g} s; choose another time with --duration"
            )
    options = UpOptions(
        record=record,
        view=view,
        view_port=view_port,
        demo=demo,
        script=script,
        namespace=namespace,
        duration=duration,
        subnet=subnet,
        values=chain,
        verbose=verbose,
        undriven=undriven,
    )
    try:
        return up(options, screen)
    except ImportError as error:
        print(f"tripod up: {missing_import(error)}", file=sys.stderr)
        return BAD_ARGUMENTS


def node_values(words: Sequence[str]) -> dict[str, dict[str, object]]:
    """Return parameters by node from words such as `driver.angle_max:=0.3`.

    Raises:
        ValueError: a node or a parameter is unknown, or a value not allowed.
        ImportError: a node, or ROS, is not installed.

    >>> node_values(["view.port:=8081"])
    {'view': {'port': '8081'}}
    """
    own: dict[str, list[str]] = {}
    for word in words:
        name, value = split_word(word)
        node, dot, parameter = name.partition(".")
        if not dot or not parameter:
            raise ValueError(
                f"{word!r} names no node; write --set NODE.NAME=VALUE, such as --set driver.angle_max=0.3"
            )
        if node not in EXIT_CODES:
            raise ValueError(unknown_name("node", node, list(EXIT_CODES)))
        own.setdefault(node, []).append(f"{parameter}:={value}")
    return {node: _values_of(node, words) for node, words in own.items()}


def chain_values(
    values: Mapping[str, Mapping[str, object]], scene: str, overrides: Sequence[str], port: str
) -> dict[str, Mapping[str, object]]:
    """Return the parameters of all nodes: what `values` says, and what the scene and the port ask of each beside that.

    The nodes that command or follow servos keep to the angles of the scene. Inverse kinematics takes `overrides`,
    what the user asked of the scene: the setting of an accuracy is the simulator's own, and finer than ways around
    snaps need.

    Raises ValueError where the driver is told another number of servos than the scene has.
    """
    joints = servos_of(scene, words_of_set(values))
    servos = len(joints.arms) if joints else None
    angles = angle_limits(joints) if joints and joints.arms else {}
    count = {} if servos in (None, len(names.SERVOS)) else {"servos": servos}  # unless told, the Tripod's
    driven = joints.others if joints and not why_undriven(joints.others) else ()
    channels = (
        {"channels": "; ".join(f"{a.name} {a.unit} {a.low:g} {a.high:g}" for a in driven)} if driven else {}
    )
    told = str(values.get("driver", {}).get("servos", servos))
    if servos and told != str(servos):
        raise ValueError(f"driver.servos is {told}, but scene {scene!r} has {servos} servos; leave it out")
    model: dict[str, object] = {"scene": scene, **({"set": ";".join(overrides)} if overrides else {})}
    own: dict[str, object] = {} if "scene" in values.get("ik", {}) else {**model, **angles}
    asked: dict[str, dict[str, object]] = {
        "sim": {"scene": scene, **angles},
        "ik": own,
        "driver": {"port": port, **count, **channels, **angles},
    }
    return {node: {**asked.get(node, {}), **values.get(node, {})} for node in (*asked, *values)}


def _values_of(node: str, words: Sequence[str]) -> dict[str, object]:
    """Return the parameters of one node; raise ValueError, which names it."""
    with naming(node):
        return parse_values(words, parameter_table(node), node)


@contextmanager
def naming(node: str) -> Iterator[None]:
    """Let what is wrong with the parameters of a node name it."""
    try:
        yield
    except UnknownParameterError:  # which does
        raise
    except ValueError as error:
        raise ValueError(f"{node}: {error}") from None


def check_used(values: Mapping[str, Mapping[str, object]], *, record: bool, view: bool) -> None:
    """Raise ValueError for a parameter that would change nothing: of a node that does not run, or said otherwise."""
    if "scene" in values.get("sim", {}):
        raise ValueError("sim.scene: name the scene by the first word, as in tripod up maze")
    for node, runs, advice in (("record", record, "add --record DIR"), ("view", view, "leave out --no-view")):
        if node in values and not runs:
            raise ValueError(f"{node}.{next(iter(values[node]))}: {node} does not run; {advice}")


def check_once(values: Mapping[str, Mapping[str, object]], options: Mapping[str, object]) -> None:
    """Raise ValueError for a parameter that one of `options`, None where it is not given, says, too."""
    for option, said in options.items():
        node, name = TWICE[option]
        if said is not None and name in values.get(node, {}):
            given = values[node][name]
            raise ValueError(f"--set {node}.{name}={given} and {option} {said} say the same; leave one out")


def named_scene(words: Sequence[str], option: str) -> tuple[str, Sequence[str]]:
    """Return the scene, from the first word or `--scene`, and the other words. Raises ValueError if both name one."""
    if not words or ":=" in words[0]:
        return option or "tripod", words
    if option and option != words[0]:
        raise ValueError(f"the scene is {words[0]!r} and --scene is {option!r}; leave one out")
    return words[0], words[1:]


def sim_words(
    words: Sequence[str], overrides: Sequence[str], accuracy: str | None, study: Path | None
) -> list[str]:
    """Return the parameters of `tripod sim`, NAME:=VALUE, for what its command line says in the words of `tripod run`.

    Raises:
        ValueError: the scene cannot be loaded so, or there is no such accuracy.
    """
    named = bool(words) and ":=" not in words[0]
    if not (named or overrides or accuracy or study):
        return list(words)
    given = dict(split_word(word) for word in words[named:])
    if named and "scene" in given:
        raise ValueError(f"the scene is {words[0]!r} and --set scene={given['scene']}; leave one out")
    scene = words[0] if named else str(given.get("scene", "tripod"))
    values: dict[str, dict[str, object]] = {"sim": {"set": RawYaml(given["set"])} if "set" in given else {}}
    add_overrides(values, overrides)
    check_scene(scene, words_of_set(values))
    if sentence := settle(scene, values, accuracy, study):
        print(sentence, file=sys.stderr)
    given["scene"] = scene
    given |= {name: str(value) for name, value in values["sim"].items() if value}
    return [f"{name}:={value}" for name, value in given.items()]


def sim_companion(
    words: Sequence[str], servo: str | None, slide: str | None, actuate: Sequence[str] = ()
) -> "Callable[[Executor, Sequence[float]], ScriptPlayer] | None":
    """Return what plays a script beside `tripod sim`, None without a script.

    It is an operator like any other: it takes the mode, and STOP ends it.

    Raises:
        ValueError: the script cannot be read, or goes beyond the limits of the scene.
    """
    given = dict(split_word(word) for word in words)
    values: dict[str, dict[str, object]] = {"sim": {"set": RawYaml(given["set"])} if "set" in given else {}}
    path = joint_path(str(given.get("scene", "tripod")), words_of_set(values), servo, slide, actuate)
    if path is None:
        return None

    def beside(executor: "Executor", speeds: Sequence[float]) -> "ScriptPlayer":
        from tripod_bringup.script_player import ScriptPlayer  # noqa: PLC0415 - needs ROS

        def say(line: str) -> None:
            print(f"sim: {line}", file=sys.stderr, flush=True)

        return ScriptPlayer(path, executor, say, wanted=True, simulated=speeds)

    return beside


def add_overrides(values: dict[str, dict[str, object]], overrides: Sequence[str]) -> None:
    """Write the words of `--set` into the simulator's parameter `set`, behind those that are there, in place."""
    if overrides:
        values.setdefault("sim", {})["set"] = ";".join([*words_of_set(values), *overrides])


def words_of_set(values: Mapping[str, Mapping[str, object]]) -> list[str]:
    """Return the overrides of the scene in the simulator's parameter `set`. Raises ValueError where it is not YAML."""
    from tripod_sim.scene.file import override_words  # noqa: PLC0415 - pure and small

    text = values.get("sim", {}).get("set", "")
    if isinstance(text, RawYaml):
        import yaml  # noqa: PLC0415 - only with such a parameter

        try:
            text = yaml.safe_load(text)
        except yaml.YAMLError:
            raise ValueError(f"--set sim.set={text} is not YAML; quote it") from None
    return override_words(str(text or ""))


def settle(scene: str, values: dict[str, dict[str, object]], accuracy: str | None, study: Path | None) -> str:
    """Write the setting for an accuracy into the simulator's parameter `set`, and a study of one's own into `study`, in
    place; return what it is, in words.

    Raises:
        SceneError: there is none; it is a ValueError.
    """
    if accuracy is None and study is None:
        return ""
    choice = chosen(scene, accuracy, words_of_set(values), study)
    if not choice:
        return ""
    sim = values.setdefault("sim", {})
    sim["set"] = ";".join(choice.overrides)
    if study:  # from which the simulator proposes, too
        sim["study"] = str(study.absolute())
    return choice.sentence


def servos_of(scene: str, overrides: Sequence[str]) -> "Joints | None":
    """Return the servos of a scene; None: it has none. Raises SceneError, which is a ValueError."""
    from tripod_sim.scene.file import load_scene  # noqa: PLC0415 - pure and small
    from tripod_sim.tables.short_forms import joints_of  # noqa: PLC0415

    return joints_of(load_scene(scene, overrides))


def why_undriven(others: "Sequence[Actuator]") -> str:
    """Return why no driver starts for a robot with these joints beside servos; empty if one does."""
    from tripod_driver.framed_messages import CHANNELS_MAX  # noqa: PLC0415 - pure and small

    if strange := [a for a in others if a.unit not in CHANNEL_UNITS or (a.unit == "m" and not a.pulls)]:
        named = ", ".join(f"{a.name} [{a.unit}]" for a in strange)
        return f"simulated only, without a driver: a board drives angles, cables by length and pressures, not {named}"
    if len(others) > CHANNELS_MAX:
        return f"simulated only, without a driver: a board has at most {CHANNELS_MAX} channels, not {len(others)}"
    return ""


def angle_limits(joints: "Joints") -> dict[str, float]:
    """Return `angle_min` and `angle_max` [rad] of the servos, as parameters of a node that has others by default."""
    default = CommandLimits()
    found = {
        "angle_min": min(arm.low for arm in joints.arms),
        "angle_max": max(arm.high for arm in joints.arms),
    }
    return {name: angle for name, angle in found.items() if angle != getattr(default, name)}


def check_scene(scene: str, overrides: Sequence[str]) -> None:
    """Raise SceneError, which is a ValueError, unless `scene` can be loaded with `overrides`."""
    from tripod_sim.scene.file import load_scene  # noqa: PLC0415 - pure and small

    load_scene(scene, overrides)
