"""The error of the mesh at the effector, live: a richer mesh at rest beside the motion, and how the error swings."""
