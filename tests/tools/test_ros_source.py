"""Which ROS is used, and what is said where none can be."""

from pathlib import Path

import pytest

from tests.messages import assert_names
from tools.errors import MissingError
from tools.ros_source import find_ros, used_packages

ROOT = Path(__file__).parents[2]
PACKAGES = ("rclpy", "std_msgs")
HERE = {"machine": "x86_64", "system": "linux", "glibc": (2, 36), "python": (3, 11)}


def prefix_with(folder: Path, *packages: str) -> str:
    index = folder / "share/ament_index/resource_index/packages"
    index.mkdir(parents=True)
    for package in packages:
        (index / package).touch()
    return str(folder)


def refusal(environ: dict[str, str], **machine: object) -> str:
    with pytest.raises(MissingError) as caught:
        find_ros(environ, PACKAGES, **{**HERE, **machine})
    return str(caught.value)


def test_wheels_where_no_ros_is_sourced() -> None:
    ros = find_ros({}, PACKAGES, **HERE)
    assert ros.sourced is None
    assert ros.prefixes == ()


def test_a_sourced_jazzy_is_used_on_any_machine(tmp_path: Path) -> None:
    first = prefix_with(tmp_path / "overlay", "std_msgs")
    second = prefix_with(tmp_path / "jazzy", "rclpy", "std_msgs")
    environ = {
        "ROS_DISTRO": "jazzy",
        "AMENT_PREFIX_PATH": f"{first}:{second}",
        "PYTHONPATH": f"{second}/lib/python3.12/site-packages:",
    }
    ros = find_ros(environ, PACKAGES, machine="aarch64", system="linux", glibc=(2, 39), python=(3, 12))
    assert ros.prefixes == (first, second)
    assert ros.sourced == {
        "AMENT_PREFIX_PATH": (first, second),
        "LD_LIBRARY_PATH": (),
        "PYTHONPATH": (f"{second}/lib/python3.12/site-packages",),
    }


def test_another_ros_is_refused_in_one_line() -> None:
    text = refusal({"ROS_DISTRO": "humble"})
    assert_names(text, "'humble'", "'jazzy'", "source /opt/ros/jazzy/setup.bash")
    assert "\n" not in text


def test_a_sourced_ros_without_a_package_names_what_to_install(tmp_path: Path) -> None:
    environ = {"ROS_DISTRO": "jazzy", "AMENT_PREFIX_PATH": prefix_with(tmp_path, "rclpy")}
    assert_names(refusal(environ), "missing", "std_msgs", "sudo apt-get install ros-jazzy-std-msgs")


def test_a_half_sourced_ros_is_told_apart_from_a_missing_package() -> None:
    assert_names(refusal({"ROS_DISTRO": "jazzy"}), "AMENT_PREFIX_PATH", "no ROS packages")


def test_no_wheels_for_another_processor() -> None:
    text = refusal({}, machine="aarch64")
    assert_names(text, "x86_64", "linux on aarch64", "install ROS 2 Jazzy")
    assert "\n" not in text


def test_no_wheels_for_another_c_library() -> None:
    assert_names(refusal({}, glibc=()), "glibc 2.28", "another C library")
    assert_names(refusal({}, glibc=(2, 27)), "glibc 2.28", "found 2.27")
    find_ros({}, PACKAGES, **{**HERE, "glibc": (2, 28)})


@pytest.mark.parametrize("python", [(3, 10), (3, 14)])
def test_no_wheels_for_another_python(python: tuple[int, int]) -> None:
    text = refusal({}, python=python)
    assert_names(text, "Python 3.11 to 3.13", f"3.{python[1]}")


def test_used_packages_are_those_of_both_package_files() -> None:
    packages = used_packages(ROOT)
    assert {"rclpy", "trajectory_msgs", "ament_cmake", "rosidl_default_generators"} <= set(packages)
    assert "tripod_msgs" not in packages
    assert not [p for p in packages if p.startswith("python3-")], "those are Debian's, not of ROS"
