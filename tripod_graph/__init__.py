"""The graph that the nodes share: names, quality of service, parameters, command rules, and how a node runs.

`names`, `command` and `mode` are pure; `parameters`, `limits`, `qos`, `diagnostics` and `run` need rclpy.
"""
