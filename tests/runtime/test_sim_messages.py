"""Messages of the simulator: right shapes, units, frames and stamps, and nothing lost on the wire."""

from array import array
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import PointCloud2, PointField
from visualization_msgs.msg import Marker, MarkerArray

from tripod_graph.names import SERVOS
from tripod_runtime import messages
from tripod_runtime.markers import SceneMarkers
from tripod_runtime.realtime import Snapshot
from tripod_sim.compliance import Compliance
from tripod_sim.integrators.report import MeshErrorReport, StepReport
from tripod_sim.mesh.y_piece import LEVELS, y_piece
from tripod_sim.scene.file import load_scene
from tripod_sim.simulation import Energies, Pose
from tripod_sim.tables.short_forms import joints_of

MESH = y_piece(LEVELS[1])
STAMP = 1_767_225_600_123_456_789


def snapshot(seed: int = 0, servos: int = 3, stamp: int = STAMP) -> Snapshot:
    """Return a snapshot of random numbers, all different."""
    rng = np.random.default_rng(seed)
    position, quaternion = rng.standard_normal(3), rng.standard_normal(4)
    size = 6 + servos
    compliance = Compliance(
        rng.standard_normal((size, size)), rng.standard_normal((6, servos)), rng.standard_normal((servos, servos)),
        rng.standard_normal(servos), 0.0123, rng.standard_normal(servos), position, quaternion, rng.standard_normal(6),
    )  # fmt: skip
    return Snapshot(
        stamp, 41, 0.205, rng.standard_normal(MESH.nodes.shape), rng.standard_normal(servos + 1),
        rng.standard_normal(servos), Pose(position, quaternion), compliance, StepReport(), Energies(0.1, 0.2, 0.3),
    )  # fmt: skip


def wired(message: Any) -> Any:
    """Return the message as a subscriber receives it."""
    return deserialize_message(serialize_message(message), type(message))


def assert_header(header: Any, stamp: int = STAMP) -> None:
    assert header.frame_id == "world"
    assert header.stamp.sec * 1_000_000_000 + header.stamp.nanosec == stamp
    assert 0 <= header.stamp.nanosec < 1_000_000_000


def pose_numbers(pose: Any) -> list[float]:
    p, q = pose.position, pose.orientation
    return [p.x, p.y, p.z, q.x, q.y, q.z, q.w]


@pytest.mark.parametrize("stamp", [0, 999_999_999, 1_000_000_000, STAMP])
def test_a_stamp_is_split_without_loss(stamp: int) -> None:
    assert_header(messages.header(stamp), stamp)


@pytest.mark.parametrize(
    "values", [np.arange(6.0).reshape(2, 3).T, np.arange(12.0)[::2], np.array([1, 2, 3])]
)
def test_flat_arrays_are_row_major_whatever_the_memory(values: np.ndarray) -> None:
    given = messages.flat(values)
    assert isinstance(given, array)
    assert given.typecode == "d"
    assert given.tolist() == values.ravel().tolist()


def test_body_state_carries_every_node() -> None:
    s = snapshot()
    message = wired(messages.body_message(s, MESH))
    assert_header(message.header)
    assert message.topology_id == MESH.topology_id
    assert (message.step, message.time) == (41, 0.205)
    np.testing.assert_array_equal(np.reshape(message.positions, (-1, 3)), s.positions)


def test_joint_states_name_servos_and_slide() -> None:
    s = snapshot()
    message = wired(messages.JointTeller(joints_of(load_scene("tripod"))).message(s))
    assert_header(message.header)
    assert list(message.name) == ["servo_0", "servo_1", "servo_2", "slide"]
    assert message.position.tolist() == s.joints.tolist()
    assert message.effort.tolist() == [*s.efforts.tolist(), 0.0]
    assert len(message.velocity) == 0


def test_effector_pose_is_position_and_quaternion_x_y_z_w() -> None:
    s = snapshot()
    assert s.effector
    message = wired(messages.PoseTeller().message(s, s.effector))
    assert_header(message.header)
    assert pose_numbers(message.pose) == [*s.effector.position, *s.effector.quaternion]


@pytest.mark.parametrize("servos", [0, 3])
def test_compliance_has_one_row_for_each_name(servos: int) -> None:
    """W is written row by row: a transposed one would show, as the sample is not symmetric."""
    s = snapshot(servos=servos)
    c = s.compliance
    assert c
    message = wired(messages.compliance_message(s))
    assert_header(message.header)
    assert tuple(message.joint_names) == SERVOS[:servos]
    assert message.angles.tolist() == c.angles.tolist()
    assert message.efforts.tolist() == c.efforts.tolist()
    assert message.equilibrium_offset.tolist() == c.equilibrium_offset.tolist()
    assert pose_numbers(message.effector) == [*c.position, *c.quaternion]
    assert message.slide == 0.0123
    assert message.effector_mesh_error == -1.0
    np.testing.assert_array_equal(np.reshape(message.w, (6 + servos, 6 + servos)), c.w)


@pytest.mark.parametrize(("error", "told"), [((0.0, 3e-5, -4e-5), 5e-5), ((np.nan,) * 3, -1.0)])
def test_compliance_tells_the_error_of_its_mesh(error: tuple[float, float, float], told: float) -> None:
    s = snapshot()
    s.report.mesh_error = MeshErrorReport(error, 0.2)
    assert wired(messages.compliance_message(s)).effector_mesh_error == pytest.approx(told)


def test_a_snapshot_without_compliance_gives_no_message() -> None:
    assert messages.compliance_message(SimpleNamespace(compliance=None)) is None  # type: ignore[arg-type]


def test_the_mesh_has_all_nodes_and_indices_into_them() -> None:
    message = wired(messages.mesh_message(MESH))
    vertices = np.array([[p.x, p.y, p.z] for p in message.vertices])
    triangles = np.array([t.vertex_indices for t in message.triangles])
    np.testing.assert_array_equal(vertices, MESH.nodes)
    np.testing.assert_array_equal(triangles, MESH.surface)
    assert triangles.max() < len(vertices)
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    assert np.einsum("ti,ti->", a, np.cross(b, c)) / 6 == pytest.approx(
        2e-5, rel=0.5
    )  # outward; about 21 cm³


def decode(cloud: PointCloud2) -> np.ndarray:
    """Return the points of a cloud by its own description of its bytes, shape (height * width, 3)."""
    kinds = {PointField.FLOAT32: "f4", PointField.FLOAT64: "f8"}
    order = ">" if cloud.is_bigendian else "<"
    layout = np.dtype(
        {
            "names": [f.name for f in cloud.fields],
            "formats": [order + kinds[f.datatype] for f in cloud.fields],
            "offsets": [f.offset for f in cloud.fields],
            "itemsize": cloud.point_step,
        }
    )
    assert cloud.row_step == cloud.point_step * cloud.width
    assert len(cloud.data) == cloud.row_step * cloud.height
    points = np.frombuffer(bytes(cloud.data), layout)
    return np.stack([points[n] for n in "xyz"], axis=1)


def test_the_point_cloud_decodes_to_the_positions() -> None:
    s = snapshot()
    cloud = wired(messages.cloud_message(s))
    assert_header(cloud.header)
    assert all(f.count == 1 for f in cloud.fields)
    np.testing.assert_array_equal(decode(cloud), s.positions.astype(np.float32))
    assert cloud.is_dense


def test_the_markers_are_the_deformed_surface() -> None:
    """The buffer is used again: a second snapshot must leave nothing of the first."""
    surface = SceneMarkers(MESH)
    for seed, stamp in ((1, STAMP), (2, 7), (3, 2_000_000_000_999_999_999)):
        s = snapshot(seed, stamp=stamp)
        (marker,) = deserialize_message(surface.serialised(s), MarkerArray).markers
        assert_header(marker.header, stamp)
        points = np.array([[p.x, p.y, p.z] for p in marker.points])
        np.testing.assert_array_equal(points, s.positions[MESH.surface.ravel()])
        assert (marker.type, marker.action) == (Marker.TRIANGLE_LIST, Marker.ADD)
        assert (marker.scale.x, marker.scale.y, marker.scale.z) == (1, 1, 1)
        assert pose_numbers(marker.pose) == [0, 0, 0, 0, 0, 0, 1]
        assert marker.color.a == 1


def test_earlier_markers_keep_their_bytes() -> None:
    surface = SceneMarkers(MESH)
    first = surface.serialised(snapshot(1))
    before = bytes(first)
    surface.serialised(snapshot(2))
    assert first == before
