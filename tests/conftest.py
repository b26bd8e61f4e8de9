"""What holds for all tests."""

import atexit
import os
import shutil
import signal
from collections.abc import Iterator
from tempfile import mkdtemp

import pytest
from hypothesis import settings

from tests.domains import own_domain
from tools.shared_tests import pytest_collection, pytest_runtestloop  # noqa: F401 - hooks
from tripod_bringup.compiling import garbage_left

# The same examples in every run: a failure is of the code, not of the draw. No deadline: machines are shared.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

# What a driver remembers of its boards is nobody's but the test's, also in the processes that tests start.
os.environ["XDG_STATE_HOME"] = mkdtemp(prefix="tripod_state_")
atexit.register(shutil.rmtree, os.environ["XDG_STATE_HOME"], ignore_errors=True)

# In the background, or under `nohup`, a shell has SIGINT or SIGHUP ignored, and so would the processes that tests start
# and send them. What is handled is not inherited.
for _number in (signal.SIGINT, signal.SIGHUP):
    if signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, lambda *_: None)


@pytest.fixture(scope="session", autouse=True)
def _garbage_left() -> Iterator[None]:
    """Tests compile much."""
    with garbage_left():
        yield


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A ROS domain of the test's own, on this machine only; it is in the environment too."""
    with own_domain() as number:
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
        yield number
