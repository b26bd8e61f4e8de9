"""Build the documentation site for tests."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def build_site(folder: Path) -> None:
    """Build the site into `folder`; a warning of mkdocs fails the test."""
    pytest.importorskip("mkdocs")
    pytest.importorskip("material")
    pytest.importorskip("rclpy")  # the parameters of the nodes are written from their tables
    words = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
