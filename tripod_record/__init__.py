"""Recording to mcap, and reading what was recorded.

`writer` writes a rosbag2 directory from raw messages, `recorder` does so in its own thread, `info` reads one
back and tells what is in it; none of them needs ROS. `node` records the graph.
"""
