"""Driving the robot from the keys of a terminal.

`escape`, `keys`, `joints`, `drive`, `operate` and `screen` are rules without ROS; `terminal` is the
terminal, `node` the node.
"""
