"""What runs in real time: the loop in a thread, the ROS node, the log of inputs, resimulation, hot swap of scenes."""
