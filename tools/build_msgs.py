"""Build `msgs/` into `.venv`: configure, compile and install the ament_cmake package `tripod_msgs` with cmake."""

import os
import shutil
from pathlib import Path

from tools.command import Shell
from tools.ros_source import RosSource

PACKAGE = "tripod_msgs"
WORKAROUND = Path(__file__).with_name("drop_missing_includes.cmake")


def message_files(root: Path) -> list[Path]:
    """Return the files on which the built messages depend, sorted."""
    msgs = root / "msgs"
    sources = [
        msgs / "CMakeLists.txt",
        msgs / "package.xml",
        *msgs.glob("msg/*.msg"),
        *msgs.glob("srv/*.srv"),
    ]
    return sorted([*sources, Path(__file__), WORKAROUND])


def build_messages(root: Path, venv: Path, ros: RosSource, shell: Shell) -> None:
    """Replace the messages in `venv` with those of `root`/msgs. Raises StepError.

    The build folder lies in `venv`, is new each time (it takes about 15 s in all) and goes when the build succeeds.
    """
    build, python = venv / "build_msgs", venv / "bin" / "python"
    shutil.rmtree(build, ignore_errors=True)
    prefixes = [*ros.prefixes, str(venv)]
    shell = shell.with_environ(AMENT_PREFIX_PATH=os.pathsep.join(prefixes))
    cmake = shutil.which("cmake", path=shell.environ["PATH"]) or "cmake"
    shell.run(
        cmake,
        *("-S", root / "msgs", "-B", build, "-G", "Ninja"),
        f"-DCMAKE_PREFIX_PATH={';'.join(prefixes)}",
        f"-DCMAKE_INSTALL_PREFIX={venv}",
        "-DCMAKE_INSTALL_RPATH=$ORIGIN;$ORIGIN/../../..",  # lib/ as seen from the libraries and from the Python modules
        f"-DPYTHON_INSTALL_DIR={site_packages(venv).relative_to(venv)}",
        f"-DPython3_EXECUTABLE={python}",
        "-DBUILD_TESTING=OFF",
        *([] if ros.sourced else [f"-DCMAKE_PROJECT_{PACKAGE}_INCLUDE={WORKAROUND}"]),
    )
    shell.run(cmake, "--build", build)
    remove_messages(venv)  # only now: what runs in the meantime has the old ones
    shell.run(cmake, "--install", build)
    shell.run(python, "-c", f"import {PACKAGE}.msg")
    shutil.rmtree(build)


def remove_messages(venv: Path) -> None:
    """Remove an earlier build from `venv`, so that a message gone from `msgs/` is gone there too."""
    for path in [
        *venv.glob(f"lib/lib{PACKAGE}__*"),
        *venv.glob(f"share/{PACKAGE}"),
        *venv.glob(f"share/ament_index/resource_index/*/{PACKAGE}"),
        *venv.glob(f"include/{PACKAGE}"),
        *site_packages(venv).glob(f"{PACKAGE}*"),
    ]:
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()


def site_packages(venv: Path) -> Path:
    """Return the folder of `venv` where its Python packages are; `venv` must exist."""
    return next(venv.glob("lib/python3*/site-packages"))
