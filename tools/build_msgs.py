"""Build messages into `.venv`: configure, compile and install ament_cmake packages with cmake.

`msgs/` is `tripod_msgs`; `interfaces/` holds packages of others that have no wheel, for where no ROS is sourced.
"""

import os
import shutil
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

from tools.command import Shell
from tools.ros_source import RosSource

ON_WHEELS = Path(__file__).with_name("on_wheels.cmake")
INTERFACES = ("msg", "srv", "action")


def own_messages(root: Path) -> list[Path]:
    """Return the folder of `tripod_msgs`."""
    return [root / "msgs"]


def interfaces_of_others(root: Path, ros: RosSource) -> list[Path]:
    """Return the folders of packages of others that have to be built: none where ROS is sourced."""
    return [] if ros.sourced else [path.parent for path in sorted(root.glob("interfaces/*/CMakeLists.txt"))]


def message_files(folders: Sequence[Path]) -> list[Path]:
    """Return the files on which the messages of these packages depend, sorted."""
    sources: list[Path] = []
    for folder in folders:
        sources += [folder / "CMakeLists.txt", folder / "package.xml"]
        sources += [file for kind in INTERFACES for file in folder.glob(f"{kind}/*.{kind}")]
    return sorted([*sources, Path(__file__), ON_WHEELS])


def build_messages(folders: Sequence[Path], venv: Path, ros: RosSource, shell: Shell) -> None:
    """Replace the messages of these packages in `venv` with those of their folders. Raises StepError."""
    for folder in folders:
        package = ET.parse(folder / "package.xml").findtext("name") or folder.name
        _build(package, folder, venv, ros, shell)


def _build(package: str, folder: Path, venv: Path, ros: RosSource, shell: Shell) -> None:
    """Build one package. The build folder lies in `venv`, is new each time and goes when the build succeeds."""
    build, python = venv / "build_msgs", venv / "bin" / "python"
    shutil.rmtree(build, ignore_errors=True)
    prefixes = [*ros.prefixes, str(venv)]
    shell = shell.with_environ(AMENT_PREFIX_PATH=os.pathsep.join(prefixes))
    cmake = shutil.which("cmake", path=shell.environ["PATH"]) or "cmake"
    shell.run(
        cmake,
        *("-S", folder, "-B", build, "-G", "Ninja"),
        f"-DCMAKE_PREFIX_PATH={';'.join(prefixes)}",
        f"-DCMAKE_INSTALL_PREFIX={venv}",
        "-DCMAKE_INSTALL_RPATH=$ORIGIN;$ORIGIN/../../..",  # lib/ as seen from the libraries and from the Python modules
        f"-DPYTHON_INSTALL_DIR={site_packages(venv).relative_to(venv)}",
        f"-DPython3_EXECUTABLE={python}",
        "-DBUILD_TESTING=OFF",
        *([] if ros.sourced else [f"-DCMAKE_PROJECT_{package}_INCLUDE={ON_WHEELS}"]),
    )
    shell.run(cmake, "--build", build)
    remove_messages(venv, package)  # only now: what runs in the meantime has the old ones
    shell.run(cmake, "--install", build)
    kinds = [kind for kind in INTERFACES if (folder / kind).is_dir()]
    shell.run(python, "-c", "; ".join(f"import {package}.{kind}" for kind in kinds))
    shutil.rmtree(build)


def remove_messages(venv: Path, package: str) -> None:
    """Remove an earlier build from `venv`, so that a message gone from its folder is gone there too."""
    for path in [
        *venv.glob(f"lib/lib{package}__*"),
        *venv.glob(f"share/{package}"),
        *venv.glob(f"share/ament_index/resource_index/*/{package}"),
        *venv.glob(f"include/{package}"),
        *site_packages(venv).glob(f"{package}*"),
    ]:
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()


def site_packages(venv: Path) -> Path:
    """Return the folder of `venv` where its Python packages are; `venv` must exist."""
    return next(venv.glob("lib/python3*/site-packages"))
