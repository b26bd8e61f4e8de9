"""Playing with the Tripod: tilts from a path file, and the ball through the maze by itself.

`plan`, `observer`, `control`, `player`, `tilt` and `path_file` are rules without a clock; `solve` and `follow` run
them on the simulator, `node` in the graph.
"""
