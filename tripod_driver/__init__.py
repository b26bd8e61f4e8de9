"""Driver of the real robot: joint trajectories in, servo packets out.

`node`, `settings` and `messages` put it into the graph; all other modules need no ROS.
"""
