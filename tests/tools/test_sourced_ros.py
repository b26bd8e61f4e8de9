"""An environment made with a sourced ROS finds it again from any shell."""

import subprocess
import sys
from pathlib import Path

from tools.sourced_ros import completed, install

SHOW = "import os, sys; print(os.environ.get('LD_LIBRARY_PATH'), os.environ.get('PYTHONPATH'), *sys.argv[1:], sep='|')"


def test_only_what_is_lacking_is_appended() -> None:
    environ = {"LD_LIBRARY_PATH": "/mine:/ros/lib", "HOME": "/h"}
    entries = {
        "LD_LIBRARY_PATH": ["/venv/lib", "/ros/lib"],
        "PYTHONPATH": ["/ros/python"],
        "AMENT_PREFIX_PATH": [],
    }
    complete = completed(environ, entries)
    assert complete == {
        "LD_LIBRARY_PATH": "/mine:/ros/lib:/venv/lib",
        "HOME": "/h",
        "PYTHONPATH": "/ros/python",
    }
    assert completed(complete, entries) == complete, "a second start must not start again"


def test_a_python_starts_itself_anew_with_the_paths_of_ros(tmp_path: Path) -> None:
    venv = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(venv)], check=True)
    site = next(venv.glob("lib/python3*/site-packages"))
    ros = tmp_path / "ros"
    (ros / "python").mkdir(parents=True)
    (ros / "python" / "module_of_ros.py").write_text("NAME = 'found'\n", encoding="utf-8")
    install(
        site,
        venv,
        {
            "AMENT_PREFIX_PATH": (str(ros),),
            "LD_LIBRARY_PATH": (f"{ros}/lib",),
            "PYTHONPATH": (f"{ros}/python",),
        },
    )
    words = [str(venv / "bin" / "python"), "-c", f"import module_of_ros; {SHOW}", "an argument", "another"]
    result = subprocess.run(words, env={}, capture_output=True, text=True, check=True, timeout=120)
    assert result.stdout == f"{venv}/lib:{ros}/lib|{ros}/python|an argument|another\n"
    result = subprocess.run(
        words, env={"LD_LIBRARY_PATH": "/first"}, capture_output=True, text=True, check=True, timeout=120
    )
    assert result.stdout.startswith(f"/first:{venv}/lib:{ros}/lib|")
