"""Soft bodies of a scene in one numbering of nodes: what each is, which share nodes, what they put into a system."""
