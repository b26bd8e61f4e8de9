"""What is told while the loops of a scene are compiled."""

import gc
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from numba.core import event

from tests.messages import assert_names
from tripod_bringup import compiling
from tripod_bringup.compiling import Note, garbage_left


def test_the_first_run_of_all_says_that_it_compiles_and_the_next_does_not(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "tripod_bringup", "run", "pendulum", "--duration", "0.01"]
    told = []
    for _ in range(2):
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
        done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True, timeout=300)
        told.append(done.stderr.splitlines())
    (first,), second = told
    assert_names(first, "tripod run: ", "compiling", "once", "a minute")
    assert second == []


@pytest.mark.ros
def test_a_simulator_that_is_started_alone_says_so_too(tmp_path: Path, domain: int) -> None:
    pytest.importorskip("tripod_msgs")
    process = subprocess.Popen(
        [sys.executable, "-m", "tripod_bringup", "sim", "pendulum"],
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "ROS_DOMAIN_ID": str(domain)},
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stderr
        first = process.stderr.readline()
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=300)
    finally:
        process.kill()
        process.wait()
    assert_names(first, "tripod sim: ", "compiling", "once", "a minute")


def test_each_loop_is_told_beside_a_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiling, "PATIENCE", 0.0)
    said: list[str] = []
    note = Note("tripod run", said.append)
    note.loop("add_gradient")
    note.loop("solve")
    first, second = said
    assert_names(first, "compiling", "once", "loop 1", "add_gradient")
    assert_names(second, "compiling", "once", "loop 2", "solve")


def test_a_short_compilation_is_not_told(capsys: pytest.CaptureFixture[str]) -> None:
    Note("tripod run", None).loop("solve")
    assert capsys.readouterr().err == ""


def test_garbage_waits_until_a_loop_is_compiled() -> None:
    """Loops are compiled within each other, and those that were begun before go on within the block."""
    collects = []
    with garbage_left():
        event.end_event("numba:compile")
        for happens in (event.start_event, event.start_event, event.end_event, event.end_event):
            happens("numba:compile")
            collects.append(gc.isenabled())
    assert collects == [False, False, False, True]
    gc.disable()
    try:
        with garbage_left(), event.trigger_event("numba:compile"):
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()
