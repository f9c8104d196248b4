"""Constants of parallel work."""

CONNECT_SECONDS = 10
"""Seconds within which a scheduler answers; a network answers in less than one."""

MEMORY_SHARE = 0.9
"""Part of the limit of a Dask worker that tasks may fill: Dask kills a worker at 95 %."""

MAX_THREADS = 4
"""Most threads of a computation unless more are asked for; more have not been measured."""
