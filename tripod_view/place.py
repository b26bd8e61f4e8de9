"""Where a node of the drawn scene is."""

import numpy as np
import viser

from tripod_view.pose import Pose


def place(handle: viser.SceneNodeHandle, pose: Pose) -> None:
    """Put a node at a pose; what is as it was is not sent.

    viser looks for that itself, at ten times the cost.
    """
    if (handle.position != pose.position).any():
        handle.position = pose.position
    x, y, z, w = pose.quaternion.tolist()
    wxyz = np.array((w, x, y, z))
    if (handle.wxyz != wxyz).any():
        handle.wxyz = wxyz


def send_pose(handle: viser.SceneNodeHandle) -> None:
    """Send where a new node is, although that is where nodes begin.

    viser does not send that, and in a browser a node stands as the one of its name did that was removed just before.
    """
    handle.wxyz, handle.position = (0.0, 1.0, 0.0, 0.0), (1.0, 0.0, 0.0)
    handle.wxyz, handle.position = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
