"""Goals of the action `follow_joint_trajectory` as they are taken: what is too large is cut before it is converted.

rclpy converts a request whole before anybody sees it: 100,000 points make a node deaf for longer than a board waits for
a sign of life. It calls what the request's type names `_CONVERT_TO_PY` with the address of the message in C. (There, by
rosidl_generator_c, a sequence and a string are a pointer, a size and a capacity; what is freed goes by the capacity.)
Here that shortens the sequences to one more than is allowed, which shows that they are too long.
"""

import ctypes
from types import SimpleNamespace
from typing import Any, Final

from control_msgs.action import FollowJointTrajectory

from tripod_graph.cdr import MOST_NAMES, MOST_POINTS


class _Sequence(ctypes.Structure):
    _fields_ = (("data", ctypes.c_void_p), ("size", ctypes.c_size_t), ("capacity", ctypes.c_size_t))


class _Trajectory(ctypes.Structure):
    _fields_ = (
        ("stamp", ctypes.c_uint32 * 2), ("frame_id", _Sequence), ("joint_names", _Sequence), ("points", _Sequence),
    )  # fmt: skip


class _Request(ctypes.Structure):
    """control_msgs/FollowJointTrajectory_SendGoal_Request up to what is bounded."""

    _fields_ = (
        ("goal_id", ctypes.c_uint8 * 16),
        ("trajectory", _Trajectory),
        ("multi_dof_trajectory", _Trajectory),
        ("tolerances", _Sequence * 4),
    )


_FUNCTION: Final = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p)
_address = ctypes.pythonapi.PyCapsule_GetPointer
_address.restype, _address.argtypes = ctypes.c_void_p, (ctypes.py_object, ctypes.c_char_p)
_capsule = ctypes.pythonapi.PyCapsule_New
_capsule.restype, _capsule.argtypes = ctypes.py_object, (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)

Request: Any = FollowJointTrajectory.Impl.SendGoalService.Request
Request.__class__.__import_type_support__()
_convert = _FUNCTION(_address(Request.__class__._CONVERT_TO_PY, None))


@_FUNCTION
def _convert_bounded(address: int) -> Any:
    request = _Request.from_address(address)
    one, other = request.trajectory, request.multi_dof_trajectory
    bounds = [(one.points, MOST_POINTS)]
    bounds += [
        (s, MOST_NAMES) for s in (one.joint_names, other.joint_names, other.points, *request.tolerances)
    ]
    for sequence, most in bounds:
        sequence.size = min(sequence.size, most + 1)
    return _convert(address)


class _Type:
    """What rclpy asks of the class of a message's class."""

    _CREATE_ROS_MESSAGE = Request.__class__._CREATE_ROS_MESSAGE
    _DESTROY_ROS_MESSAGE = Request.__class__._DESTROY_ROS_MESSAGE
    _CONVERT_TO_PY = _capsule(ctypes.cast(_convert_bounded, ctypes.c_void_p), None, None)


class BoundedTrajectory(FollowJointTrajectory):
    """The action for servers: at most MOST_POINTS + 1 points of a goal are converted."""

    class Impl(FollowJointTrajectory.Impl):
        """Its services."""

        SendGoalService = SimpleNamespace(
            Request=_Type(), Response=FollowJointTrajectory.Impl.SendGoalService.Response
        )
