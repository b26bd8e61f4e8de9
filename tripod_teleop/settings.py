"""Parameters of the node."""

from tripod_graph.limits import LIMIT_PARAMETERS
from tripod_graph.parameters import Parameter
from tripod_teleop.operate import Toss

LIMITS = ("angle_min", "angle_max", "angle_speed", "slide_max", "slide_speed", "park")
"""The command limits that matter to an operator; silence is the followers' affair."""

PARAMETERS: tuple[Parameter, ...] = (
    Parameter("speed", 0.5, "Speed of a servo whose key is down", "rad/s", low=0.01, high=4.0, dynamic=True),
    Parameter(
        "hold",
        0.2,
        "Time for which a key press counts: silence means stop",
        "s",
        low=0.05,
        high=1.0,
        dynamic=True,
    ),
    Parameter("pose_time", 3.0, "Shortest time of a motion to a pose", "s", low=0.5, high=60.0, dynamic=True),
    Parameter(
        "catch", list(Toss.catch), "Angles of the catch, key Q; one: of all servos", "rad", low=-3.2, high=3.2
    ),
    Parameter(
        "throw", list(Toss.throw), "Angles of the throw, key z; one: of all servos", "rad", low=-3.2, high=3.2
    ),
    *(p for p in LIMIT_PARAMETERS if p.name in LIMITS),
)
