"""Live 3-D page of the robot, served to a browser on this machine.

Nothing here knows physics: what is drawn comes from topics, except the arms, whose geometry is a table of
parameters. `settings`, `messages` and `node` use ROS; the other files are pure. `player` makes a page of a motion that
plays without any of that.
"""
