"""Driver of the real robot: joint trajectories in, servo packets out.

`protocol`, `ports`, `link` and `driver` need no ROS; `node` puts them into the graph.
"""
