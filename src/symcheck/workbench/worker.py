"""The process of a worker: a job per line of its input, a message per line of its output."""

from __future__ import annotations

import json
import os
import sys
from queue import SimpleQueue
from threading import Thread
from typing import Any

__all__: list[str] = []


def _read(jobs: SimpleQueue[str]) -> None:
    for line in sys.stdin:
        jobs.put(line)
    os._exit(0)  # nobody listens any more, whatever is being computed


def main() -> None:
    """Do jobs until the input ends."""
    out, sys.stdout = sys.stdout, sys.stderr  # nothing else is printed between the messages
    sys.set_int_max_str_digits(0)
    jobs: SimpleQueue[str] = SimpleQueue()
    Thread(target=_read, args=(jobs,), daemon=True).start()

    def say(message: dict[str, Any]) -> None:
        print(json.dumps(message), file=out, flush=True)

    from symcheck.workbench.jobs import done

    while True:
        say(done(json.loads(jobs.get()), say))


if __name__ == "__main__":
    main()
