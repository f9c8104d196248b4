"""Waiting for the workers of a local Dask cluster."""

from __future__ import annotations

from time import monotonic, sleep

from distributed import Client

__all__ = ["wait_for_workers"]


def wait_for_workers(client: Client, count: int, seconds: float = 60.0) -> None:
    """Wait until the scheduler has this many workers.

    `Client.wait_for_workers` overwrites what a `LocalCluster` knows of its workers, possibly with
    what was true before a worker came; closing the cluster then raises a KeyError.
    """
    end = monotonic() + seconds
    while len(client.nthreads()) < count:
        assert monotonic() < end, f"there are {len(client.nthreads())} workers, not {count}"
        sleep(0.05)
