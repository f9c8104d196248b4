"""A worker: a process that does one job at a time and can be killed."""

from __future__ import annotations

import asyncio
import json
import sys
from collections.abc import AsyncGenerator, Mapping
from contextlib import suppress
from typing import Any

__all__ = ["Message", "Worker"]

Message = dict[str, Any]
"""What a worker says of a job: its progress, or at the end its `result` or `error`."""

_TICK = 0.5
"""Seconds without a word of the worker after which the time of a job is told."""
_LONGEST = 1 << 28
"""Bytes of a message."""


class Worker:
    """A process that does jobs one after the other. It is started when it is needed."""

    def __init__(self) -> None:
        self.process: asyncio.subprocess.Process | None = None
        self._killed: list[asyncio.subprocess.Process] = []
        self._turn, self._starts = asyncio.Lock(), asyncio.Lock()

    async def start(self) -> asyncio.subprocess.Process:
        """The process, started anew if it has ended."""
        async with self._starts:  # a job that comes while it starts takes the same one
            if self.process is None or self.process.returncode is not None:
                self.process = await asyncio.create_subprocess_exec(
                    *(sys.executable, "-m", "symcheck.workbench.worker"),
                    stdin=asyncio.subprocess.PIPE,
                    stdout=asyncio.subprocess.PIPE,
                    stderr=asyncio.subprocess.DEVNULL,
                    limit=_LONGEST,
                )
            return self.process

    async def ask(self, question: Mapping[str, Any]) -> AsyncGenerator[Message, None]:
        """Do a job: progress, then a result or an error. Who stops listening kills the process."""
        async with self._turn:
            process = await self.start()
            assert process.stdin is not None
            assert process.stdout is not None
            started, finished = asyncio.get_running_loop().time(), False
            try:
                with suppress(ConnectionError):  # it has just died: the end of its output says so
                    process.stdin.write(json.dumps(question).encode() + b"\n")
                    await process.stdin.drain()
                while not finished:
                    try:
                        line = await asyncio.wait_for(process.stdout.readline(), _TICK)
                    except TimeoutError:
                        yield {"seconds": asyncio.get_running_loop().time() - started}
                        continue
                    ended = not line.endswith(b"\n")  # perhaps within a message
                    message = _ENDED if ended else json.loads(line)
                    finished = "result" in message or "error" in message
                    if ended:
                        await process.wait()
                    yield message
            finally:
                if not finished:
                    self.kill()

    def kill(self) -> None:
        """End the process; the next job starts another one."""
        if self.process is not None and self.process.returncode is None:
            with suppress(ProcessLookupError):
                self.process.kill()
            self._killed = [p for p in self._killed if p.returncode is None]
            self._killed.append(self.process)
        self.process = None

    async def close(self) -> None:
        """End the process, and wait for its end, and for that of those that were killed before."""
        self.kill()
        for process in self._killed:
            await process.communicate()


_ENDED: Message = {
    "error": {"message": "the process of this job was ended, by the system or by a user"}
}
