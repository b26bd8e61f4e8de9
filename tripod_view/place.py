"""Where a node of the drawn scene is."""

import numpy as np
import viser

from tripod_view.pose import FloatArray


def place(handle: viser.SceneNodeHandle, position: FloatArray, quaternion: FloatArray) -> None:
    """Put a node at `position` [m], turned by `quaternion` (x, y, z, w); what is as it was is not sent.

    viser looks for that itself, at ten times the cost.
    """
    if (handle.position != position).any():
        handle.position = position
    x, y, z, w = quaternion.tolist()
    wxyz = np.array((w, x, y, z))
    if (handle.wxyz != wxyz).any():
        handle.wxyz = wxyz
