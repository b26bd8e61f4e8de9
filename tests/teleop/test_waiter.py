"""The thread that wakes the node when keys come."""

import os
import pty
import threading

from tripod_teleop.terminal import Terminal
from tripod_teleop.waiter import KeyWaiter

DEADLINE = 60.0


def test_it_wakes_once_for_keys_that_wait_and_again_after_they_were_taken() -> None:
    looks, woken = threading.Semaphore(0), threading.Semaphore(0)

    class Watched(Terminal):
        def wait(self, timeout: float) -> bool:
            found = super().wait(timeout)
            looks.release()
            return found

    master, slave = pty.openpty()
    terminal = Watched(slave)
    waiter = KeyWaiter(terminal, woken.release)
    others = set(threading.enumerate())
    with terminal:
        terminal.enter()
        waiter.start()
        (thread,) = set(threading.enumerate()) - others
        for _ in range(2):  # the first has no consequence any more when the second is over
            assert looks.acquire(timeout=DEADLINE)
        assert not woken.acquire(blocking=False), "woken without a key"
        for key in (b"a", b"b"):
            os.write(master, key)
            assert woken.acquire(timeout=DEADLINE)
            assert terminal.read() == key
            waiter.taken()
        waiter.stop()
        while woken.acquire(blocking=False):
            pass
        thread.join(DEADLINE)
        assert not thread.is_alive()
        os.write(master, b"c")
        assert not woken.acquire(blocking=False), "woken after the end"
        assert terminal.read() == b"c", "the thread reads no keys itself"
    os.close(slave)
    os.close(master)


def test_a_terminal_that_is_gone_wakes_too_so_that_reading_tells() -> None:
    master, slave = pty.openpty()
    woken = threading.Event()
    waiter = KeyWaiter(Terminal(slave), woken.set)
    waiter.start()
    os.close(master)
    assert woken.wait(DEADLINE)
    waiter.stop()
    os.close(slave)
