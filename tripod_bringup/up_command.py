"""`tripod up` from the command line: checks the options before anything is locked, started or moved."""

import math
import sys
from collections.abc import Sequence
from pathlib import Path

from tripod_bringup.accuracy_option import chosen
from tripod_bringup.node_command import missing_import, unknown_name
from tripod_bringup.node_values import RawYaml, split_word
from tripod_bringup.screen import Screen
from tripod_bringup.up import BAD_ARGUMENTS, DEMO_TIME, EXIT_CODES, UpOptions, up
from tripod_graph.namespace import full_namespace


def up_command(
    words: Sequence[str],
    *,
    scene: str,
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
    study: Path | None = None,
) -> int:
    """Run the chain; return the exit code that `tripod_bringup.up` documents."""
    try:
        values = node_values(words)
        namespace = full_namespace(namespace)
        check_scene(scene)
        if sentence := settle(scene, values, accuracy, study):
            print(sentence, file=sys.stderr)
        if duration is not None and not math.isfinite(duration):
            raise ValueError(f"--duration is {duration}; it must be finite")
    except ValueError as error:
        print(f"tripod up: {error}", file=sys.stderr)
        return BAD_ARGUMENTS
    screen = Screen()
    if demo:
        record = record or Path("recordings")
        if duration is None and not screen.terminal:
            duration = DEMO_TIME
    options = UpOptions(
        scene=scene,
        port=port,
        record=record,
        view=view,
        view_port=view_port,
        demo=demo,
        namespace=namespace,
        duration=duration,
        subnet=subnet,
        values=values,
        verbose=verbose,
    )
    try:
        return up(options, screen)
    except ImportError as error:
        print(f"tripod up: {missing_import(error)}", file=sys.stderr)
        return BAD_ARGUMENTS


def node_values(words: Sequence[str]) -> dict[str, dict[str, object]]:
    """Return parameters by node from words such as `driver.angle_max:=0.3`. Raises ValueError.

    >>> node_values(["view.port:=8081"])
    {'view': {'port': '8081'}}
    """
    values: dict[str, dict[str, object]] = {}
    for word in words:
        name, value = split_word(word)
        node, dot, parameter = name.partition(".")
        if not dot or not parameter:
            raise ValueError(f"{word!r} names no node; write NODE.NAME:=VALUE, such as driver.angle_max:=0.3")
        if node not in EXIT_CODES:
            raise ValueError(unknown_name("node", node, list(EXIT_CODES)))
        values.setdefault(node, {})[parameter] = RawYaml(value)
    return values


def settle(scene: str, values: dict[str, dict[str, object]], accuracy: str | None, study: Path | None) -> str:
    """Write the setting for an accuracy into the simulator's parameter `set`, in place; return what it is, in words.

    Raises:
        SceneError: there is none; it is a ValueError.
    """
    if accuracy is None and study is None:
        return ""
    import yaml  # noqa: PLC0415 - only with an accuracy

    raw = str(values.get("sim", {}).get("set", ""))
    try:
        text = str(yaml.safe_load(raw) or "")
    except yaml.YAMLError:
        raise ValueError(f"sim.set:={raw} is not YAML; quote it") from None
    choice = chosen(scene, accuracy, [w.strip() for w in text.split(";") if w.strip()], study)
    if not choice:
        return ""
    values.setdefault("sim", {})["set"] = ";".join(choice.overrides)
    return choice.sentence


def check_scene(scene: str) -> None:
    """Raise SceneError, which is a ValueError, unless `scene` can be loaded."""
    from tripod_sim.scene_file import load_scene  # noqa: PLC0415 - pure and small

    load_scene(scene)
