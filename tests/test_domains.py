"""The domains that tests hold: no two at once."""

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
with domains.own_domain() as number:
    print(number, flush=True)
    sys.stdin.read()
"""


def start(first: int) -> subprocess.Popen[str]:
    """Start a process that tries `first`, then all, and prints what it holds."""
    words = [sys.executable, "-c", OTHER, str(first)]
    root = Path(__file__).parents[1]
    return subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=root)


def test_one_process_gets_them_in_turn() -> None:
    seen = []
    with own_domain() as outer:
        for _ in range(20):
            with own_domain() as inner:
                seen.append(inner)
    assert outer not in seen
    assert len(set(seen)) == 20
    assert set(seen) < set(DOMAINS)


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
    with own_domain() as one, own_domain() as two:
        pass
    monkeypatch.setattr(domains, "_turn", iter([one, two]))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind(("127.0.0.1", 7400 + 250 * one + 13))  # the second participant's messages
        with own_domain() as taken:
            assert taken == two
