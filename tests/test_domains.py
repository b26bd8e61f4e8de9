"""The domains that tests hold: no two at once, and none where somebody is."""

import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from tests import domains
from tests.domains import DOMAINS, own_domain

OTHER = """
import sys
from tests import domains
domains._turn = iter([int(sys.argv[1]), *domains.DOMAINS])
domains._is_empty = lambda domain: True
with domains.own_domain() as number:
    print(number, flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Locks that no other run of tests on this machine has, and no look at what others do."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    locks = os.open(tmp_path / "tests.domains", os.O_RDWR | os.O_CREAT, 0o600)
    monkeypatch.setattr(domains, "_locks", lambda: locks)
    monkeypatch.setattr(domains, "_is_empty", lambda domain: True)


def start(first: int) -> subprocess.Popen[str]:
    """Start a process that tries `first`, then all, and prints what it holds."""
    words = [sys.executable, "-c", OTHER, str(first)]
    root = Path(__file__).parents[1]
    return subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=root)


@pytest.mark.usefixtures("apart")
def test_one_process_gets_them_in_turn() -> None:
    seen = []
    with own_domain() as outer:
        for _ in range(2 * len(DOMAINS)):
            with own_domain() as inner:
                seen.append(inner)
    others = len(DOMAINS) - 1
    assert set(seen) == set(DOMAINS) - {outer}
    assert len(set(seen[:others])) == others


@pytest.mark.usefixtures("apart")
def test_another_process_gets_another_until_this_one_lets_go() -> None:
    with own_domain() as mine, start(mine) as other:
        assert int(other.stdout.readline()) != mine
        other.communicate("")
    with start(mine) as other:
        assert int(other.stdout.readline()) == mine
        other.kill()
    with start(mine) as other:  # a killed process holds nothing
        assert int(other.stdout.readline()) == mine
        other.communicate("")


def test_a_domain_where_somebody_listens_is_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    with own_domain() as mine:
        assert domains._is_empty(mine)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.bind(("127.0.0.1", 7400 + 250 * mine + 13))  # the second participant's messages
            assert not domains._is_empty(mine)
    looked: list[int] = []

    def is_empty(domain: int) -> bool:
        looked.append(domain)
        return len(looked) > 3

    monkeypatch.setattr(domains, "_is_empty", is_empty)
    with own_domain() as mine:
        assert mine == looked[-1]
        assert len(set(looked)) == 4
