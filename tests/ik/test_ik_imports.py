import subprocess
import sys

PURE = (
    "arrays",
    "certificate",
    "errors",
    "limits",
    "load",
    "branch",
    "feedback",
    "history",
    "problem",
    "rotation",
    "row_limits",
    "solver",
    "state",
    "target",
    "target_motion",
    "tasks",
    "tracker",
    "tracker_settings",
)


def test_the_pure_part_imports_neither_ros_nor_the_simulator():
    modules = ", ".join(f"tripod_ik.{name}" for name in PURE)
    code = (
        f"import sys, {modules}\n"
        "found = {'rclpy', 'tripod_msgs', 'tripod_sim', 'serial', 'websockets'} & set(sys.modules)\n"
        "assert not found, found"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


def test_naming_the_package_loads_nothing_heavy():
    code = "import sys, tripod_ik; assert not {'numpy', 'osqp', 'rclpy'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
