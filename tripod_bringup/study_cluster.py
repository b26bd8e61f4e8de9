"""The points of a study on a Dask cluster: the same results from other machines. Needs the extra `cluster`."""

import re
from collections.abc import Iterator, Sequence
from typing import Any

from tripod_bringup.study_run import Executor, Job
from tripod_bringup.study_worker import measure_point

WAIT = 10
"""How long a scheduler may take to answer [s]."""


class ClusterError(Exception):
    """The cluster cannot be used; the message says why and what to do."""


def cluster(address: str) -> Executor:
    """Return what runs points through the Dask scheduler at `address`, `tcp://HOST:PORT`. Raises ClusterError."""
    if not re.fullmatch(r"(tcp|tls)://[^\s/:]+:\d{1,5}", address):
        raise ClusterError(
            f"--scheduler is {address!r}; it must be tcp://HOST:PORT, such as tcp://127.0.0.1:8786"
        )
    try:
        from distributed import Client, as_completed  # noqa: PLC0415 - an optional extra
    except ImportError:
        raise ClusterError("--scheduler needs Dask: pip install 'tripod[cluster]'") from None
    try:
        client = Client(address, timeout=WAIT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ClusterError(f"--scheduler {address}: no scheduler answers there ({error})") from None

    def run(work: Sequence[Job]) -> Iterator[tuple[str, dict[str, Any]]]:
        with client:
            futures = {client.submit(measure_point, *job[1:], pure=False, retries=1): job[0] for job in work}
            try:
                for future in as_completed(futures, loop=client.loop):
                    yield futures[future], _record(future)
            finally:
                client.cancel(list(futures))

    return run


def _record(future: Any) -> dict[str, Any]:
    """Return what a future holds; a worker that was lost is a record, too."""
    if future.status == "finished":
        record: dict[str, Any] = future.result()
        return record
    return {
        "status": "crashed",
        "message": f"the cluster's worker: {future.exception()!r}",
        "observed": {},
        "cpu": [],
        "amount": 1.0,
    }
