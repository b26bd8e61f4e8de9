"""Definitions of message types: complete, and decodable by the two libraries that read mcap without ROS."""

import array
from pathlib import Path

import numpy as np
import pytest
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import get_types_from_msg, get_typestore
from rosbags.typesys.stores import Stores

from tests.messages import raises_naming
from tripod_record.definitions import (
    SEPARATOR,
    definition_text,
    installed_text,
    message_class,
    parts,
    text_from_fields,
)
from tripod_record.errors import RecordError

TEXTS = {
    "a_msgs/msg/Top": "# a/B c\nstd_msgs/Header header\nPart[] parts\nuint8 MODE=1  # c\nstring<=8 s 'x=1'\n",
    "a_msgs/msg/Part": "geometry_msgs/Point[<=2] p\nfloat64[9] w\n",
    "std_msgs/msg/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "geometry_msgs/msg/Point": "float64 x 1.5\n",
    "builtin_interfaces/msg/Time": "int32 sec\nuint32 nanosec",
}


def test_a_definition_holds_every_part_once() -> None:
    text = definition_text("a_msgs/msg/Top", TEXTS.__getitem__)
    blocks = text.split(SEPARATOR + "\n")
    assert blocks[0] == TEXTS["a_msgs/msg/Top"]
    assert [b.splitlines()[0] for b in blocks[1:]] == [
        "MSG: std_msgs/Header",
        "MSG: a_msgs/Part",
        "MSG: builtin_interfaces/Time",
        "MSG: geometry_msgs/Point",
    ]
    assert blocks[2] == "MSG: a_msgs/Part\n" + TEXTS["a_msgs/msg/Part"]


def test_a_type_that_holds_itself_ends_somewhere() -> None:
    assert (
        definition_text("a_msgs/msg/Loop", {"a_msgs/msg/Loop": "Loop[] loops\n"}.__getitem__)
        == "Loop[] loops\n"
    )


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("Point p", ["geometry_msgs/msg/Point"]),
        ("  std_msgs/Header h # Other o", ["std_msgs/msg/Header"]),
        ("std_msgs/msg/Header h", ["std_msgs/msg/Header"]),
        ("Point[<=3] p", ["geometry_msgs/msg/Point"]),
        ("Point[3] p", ["geometry_msgs/msg/Point"]),
        ("string<=10[<=5] names", []),
        ("float64 x 0.5", []),
        ("uint8 POINT=1", []),
        ("uint8 POINT = 1", []),
        ('string Q="Point p"', []),
        ("# Point p", []),
        ("", []),
    ],
)
def test_the_parts_of_a_definition(line: str, expected: list[str]) -> None:
    assert parts(line, "geometry_msgs") == expected


@pytest.mark.parametrize(
    "name", ["String", "std_msgs/String", "std_msgs/msg/", "../msg/X", "std_msgs/msg/X/Y", "", "a/srv/x"]
)
def test_what_is_no_type_name_is_refused(name: str) -> None:
    with raises_naming(RecordError, repr(name), "package/msg/Name"):
        definition_text(name)


def test_a_type_that_is_not_installed_is_named() -> None:
    with raises_naming(RecordError, "'no_msgs/msg/Nothing'", "not installed", "build its package"):
        definition_text("no_msgs/msg/Nothing")


# with the installed messages -------------------------------------------------------------------------------

OURS = ["BodyState", "Compliance", "ControlMode", "IkStatus", "RobotStatus", "SimStatus"]
TYPES = [f"tripod_msgs/msg/{name}" for name in OURS] + [
    "trajectory_msgs/msg/JointTrajectory",
    "geometry_msgs/msg/PoseStamped",
    "shape_msgs/msg/Mesh",
    "visualization_msgs/msg/MarkerArray",
    "sensor_msgs/msg/PointCloud2",
    "sensor_msgs/msg/JointState",
    "diagnostic_msgs/msg/DiagnosticArray",
    "rcl_interfaces/msg/Log",
]


def filled(kind: str) -> object:
    """Return a message of that type with something in every field that is a number, text or sequence of them."""
    message = message_class(kind)()
    fill(message)
    return message


def fill(message: object) -> None:
    for name, kind in message.get_fields_and_field_types().items():  # type: ignore[attr-defined]
        value = getattr(message, name)
        if isinstance(value, np.ndarray):
            value[:] = np.arange(len(value)) + 1
        elif isinstance(value, array.array):
            setattr(message, name, array.array(value.typecode, [1, 2, 3]))
        elif isinstance(value, bool):
            setattr(message, name, True)
        elif isinstance(value, bytes):
            setattr(message, name, b"\3")
        elif isinstance(value, int | float):
            setattr(message, name, type(value)(7))
        elif isinstance(value, str):
            setattr(message, name, f"text of {name}")
        elif isinstance(value, list):
            part = kind.removeprefix("sequence<").removesuffix(">")
            if part == "string":
                setattr(message, name, ["a", "bc", ""])
            elif part == "boolean":
                setattr(message, name, [True, False])
            else:
                package, short = part.split("/")
                setattr(message, name, [filled(f"{package}/msg/{short}") for _ in range(2)])
        else:
            fill(value)


def assert_same(decoded: object, message: object) -> None:
    """Compare what a library decoded with the message of rclpy, field by field."""
    for name in message.get_fields_and_field_types():  # type: ignore[attr-defined]
        wanted, found = getattr(message, name), getattr(decoded, name)
        if hasattr(wanted, "get_fields_and_field_types"):
            assert_same(found, wanted)
        elif isinstance(wanted, list) and hasattr(wanted[0], "get_fields_and_field_types"):
            for one_found, one_wanted in zip(found, wanted, strict=True):
                assert_same(one_found, one_wanted)
        elif isinstance(wanted, bytes):
            assert found == wanted[0], name
        elif isinstance(wanted, str | int | float):
            assert found == wanted, name
        else:
            assert list(found) == list(wanted), name


@pytest.fixture(scope="module")
def messages() -> dict[str, tuple[object, bytes]]:
    """A filled message of each type and its CDR, by rclpy."""
    pytest.importorskip("rclpy")
    pytest.importorskip("tripod_msgs.msg")
    from rclpy.serialization import serialize_message

    made = {kind: filled(kind) for kind in TYPES}
    return {kind: (message, serialize_message(message)) for kind, message in made.items()}


@pytest.mark.parametrize("kind", TYPES)
def test_rosbags_decodes_it_by_its_definition(kind: str, messages) -> None:
    message, data = messages[kind]
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition_text(kind), kind))
    assert_same(store.deserialize_cdr(data, kind), message)


@pytest.mark.parametrize("kind", TYPES)
def test_mcap_decodes_it_by_its_definition(kind: str, messages) -> None:
    message, data = messages[kind]
    schema = Schema(id=1, name=kind, encoding="ros2msg", data=definition_text(kind).encode())
    decoder = DecoderFactory().decoder_for("cdr", schema)
    assert decoder is not None
    assert_same(decoder(data), message)


@pytest.mark.parametrize("kind", TYPES)
def test_a_generated_definition_decodes_as_well(kind: str, messages) -> None:
    def generated(name: str) -> str:
        return text_from_fields(message_class(name).get_fields_and_field_types())

    message, data = messages[kind]
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition_text(kind, generated), kind))
    assert_same(store.deserialize_cdr(data, kind), message)


def test_the_installed_text_is_preferred(tmp_path: Path) -> None:
    pytest.importorskip("std_msgs.msg")
    folder = tmp_path / "std_msgs" / "msg"
    folder.mkdir(parents=True)
    assert installed_text("std_msgs/msg/Bool", [tmp_path]) == "boolean data\n".replace("boolean", "bool")
    (folder / "Bool.msg").write_text("# mine\nbool data\n")
    assert installed_text("std_msgs/msg/Bool", [tmp_path]) == "# mine\nbool data\n"
