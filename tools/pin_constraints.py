"""Print the pins of everything that is installed: `.venv/bin/python -m tools.pin_constraints > constraints.txt`.

Run it in an environment just made by `make setup` after a change of pyproject.toml. Only distributions with their own
metadata folder count: some ROS wheels carry a second, inner name (`rclpy` in `ros-rclpy`) that no index knows.
"""

import re
from importlib.metadata import distributions

HEADER = """\
# Pins of every package, also those needed indirectly. Made by tools/pin_constraints.py; valid for Python 3.11 to 3.13.
"""
OWN = {"tripod", "tripod-msgs", "pip"}


def pins() -> list[str]:
    """Return one line `name==version` for each installed distribution, sorted by name."""
    found = {}
    for distribution in distributions():
        name = re.sub(r"[-_.]+", "-", distribution.metadata["Name"]).lower()
        # RECORD is in the metadata folder of what pip installed; an inner .egg-info has none
        if distribution.read_text("RECORD") is not None and name not in OWN:
            found[name] = distribution.version
    return [f"{name}=={version}" for name, version in sorted(found.items())]


if __name__ == "__main__":
    print(HEADER + "\n".join(pins()))
