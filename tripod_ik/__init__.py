"""Inverse kinematics of the Tripod: from the compliance of the present state and a target to the next servo
angles.

`state`, `tasks` and `limits` say what goes in, `problem` builds the quadratic program, `solver` solves it,
`tracker` follows a target from one compliance to the next; all pure. `node` puts that into the graph.
"""
