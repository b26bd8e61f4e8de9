"""Parts of a computation in several threads."""

import os
import threading

import pytest

from tripod_host import threads
from tripod_host.threads import thread_count, together


@pytest.fixture(autouse=True)
def three(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("NUMBA_NUM_THREADS", "3")
    threads._pool.cache_clear()
    yield
    threads._pool().shutdown()
    threads._pool.cache_clear()


def test_the_environment_says_how_many(monkeypatch: pytest.MonkeyPatch) -> None:
    assert thread_count() == 3
    for wrong in ("0", "many", ""):
        monkeypatch.setenv("NUMBA_NUM_THREADS", wrong)
        assert thread_count() == len(os.sched_getaffinity(0))


def test_answers_come_in_the_order_of_the_calls() -> None:
    assert together([lambda k=k: k * k for k in range(20)]) == [k * k for k in range(20)]
    assert together([]) == []


def test_calls_run_at_the_same_time() -> None:
    all_here = threading.Barrier(3, timeout=20)
    assert len(together([all_here.wait] * 3)) == 3


def test_one_thread_is_the_caller(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_NUM_THREADS", "1")
    assert set(together([threading.get_ident] * 5)) == {threading.get_ident()}


@pytest.mark.parametrize("bad", [0, 1, 2])
def test_an_error_is_raised_when_nobody_works_any_more(bad: int) -> None:
    all_here, running = threading.Barrier(3, timeout=20), set[int]()

    def call(k: int) -> None:
        running.add(k)
        all_here.wait()
        if k == bad:
            running.remove(k)
            raise ZeroDivisionError
        threading.Event().wait(0.05)
        running.remove(k)

    with pytest.raises(ZeroDivisionError):
        together([lambda k=k: call(k) for k in range(3)])
    assert not running


def test_where_no_thread_begins_any_more_the_caller_does_all() -> None:
    threads._pool().shutdown()
    assert together([threading.get_ident] * 3) == [threading.get_ident()] * 3


def test_callers_do_not_wait_for_each_other() -> None:
    """Several threads may ask at once, more than there are helpers."""
    found = list[list[int]]()
    callers = [
        threading.Thread(target=lambda: found.append(together([lambda k=k: k for k in range(9)])))
        for _ in range(6)
    ]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join(20)
    assert found == [list(range(9))] * 6


def test_a_forked_process_has_threads_of_its_own() -> None:
    assert together([threading.get_ident] * 3)
    child = os.fork()
    if child == 0:
        all_here = threading.Barrier(3, timeout=20)
        try:
            together([all_here.wait] * 3)
        except threading.BrokenBarrierError:
            os._exit(1)
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
