"""Who stands back keeps its share of the processors and interrupts nobody; its children in time are as it is."""

import os
import threading

import pytest

from tripod_host.priority import stand_back

pytestmark = pytest.mark.skipif(not hasattr(os, "SCHED_BATCH"), reason="Linux only")


def test_a_thread_that_stands_back_and_those_it_starts_are_batches_and_others_are_not() -> None:
    found = list[int]()

    def worker() -> None:
        stand_back()
        found.append(os.sched_getscheduler(0))
        child = threading.Thread(target=lambda: found.append(os.sched_getscheduler(0)))
        child.start()
        child.join()

    thread = threading.Thread(target=worker)
    thread.start()
    thread.join()
    assert found == [os.SCHED_BATCH, os.SCHED_BATCH]
    assert os.sched_getscheduler(0) == os.SCHED_OTHER


def test_where_it_is_refused_nothing_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    stand_back()
