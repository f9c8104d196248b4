"""Processes that are killed, and runs that are stopped."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from multiprocessing import active_children
from pathlib import Path

import pytest

import symcheck
from symcheck.parallel.processes import ProcessPool
from symcheck.parallel.workers import Lost, Workers

MODELS = Path(__file__).parents[2] / "models"
CROWDS, PROPERTIES = MODELS / "crowds" / "crowds.pm", MODELS / "crowds" / "crowds.pctl"
CONSTANTS = {"TotalRuns": range(3, 7), "CrowdSize": range(2, 8)}
DIES = "__import__('os')._exit(1)"


def test_a_task_that_kills_its_process_is_the_only_one_lost() -> None:
    tasks = ["0", "1", DIES, "3", "4", "5", DIES, "7", "8"]
    with Workers(2) as workers:
        found = dict(workers.completed(eval, tasks))
    lost = {i for i, result in found.items() if isinstance(result, Lost)}
    assert lost == {2, 6}
    assert {i: found[i] for i in found if i not in lost} == {i: i for i in (0, 1, 3, 4, 5, 7, 8)}


def test_the_executor_of_the_caller_breaks_once() -> None:
    with ProcessPoolExecutor(1) as pool:
        found = dict(Workers(1, pool).completed(eval, ["0", DIES, "2"]))
    assert found.keys() == {0, 1, 2}
    assert found[1] == found[2] == Lost()


def test_a_broken_executor_gives_rows_with_errors_that_are_tried_again(tmp_path: Path) -> None:
    die, k = MODELS / "die" / "die.pm", "const int k; P=? [ F d=k ]"
    with ProcessPoolExecutor(1) as pool:
        assert pool.submit(eval, DIES).exception() is not None
        rows = symcheck.experiment(die, k, {"k": 1}, executor=pool, resume=tmp_path / "rows.jsonl")
    assert "its process was killed" in (rows[0].error or "")
    again = symcheck.experiment(die, k, {"k": 1}, resume=tmp_path / "rows.jsonl")
    assert again[0].number is not None


def test_a_killed_worker_loses_no_row() -> None:
    killed = []

    def kill(_: object) -> None:
        if not killed:
            worker = active_children()[0]
            assert worker.pid is not None
            os.kill(worker.pid, signal.SIGKILL)
            killed.append(worker)

    rows = symcheck.experiment(CROWDS, PROPERTIES, CONSTANTS, jobs=2, progress=kill)
    assert killed
    assert len(rows) == 4 * 6 * 4
    assert rows.errors == ()
    assert active_children() == []


SCRIPT = f"""
import multiprocessing, symcheck
def tell(event):
    print(event.finished, *(p.pid for p in multiprocessing.active_children()), flush=True)
rows = symcheck.experiment({str(CROWDS)!r}, {str(PROPERTIES)!r}, {CONSTANTS!r}, jobs=2, resume='rows.jsonl', progress=tell)
print(len(rows), rows.complete)
"""


def start(folder: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", SCRIPT], cwd=folder, stdout=-1, stderr=-1, text=True
    )


def wait_for_end(pids: list[int]) -> None:
    end = time.monotonic() + 30
    while any(Path(f"/proc/{pid}").exists() for pid in pids):
        assert time.monotonic() < end
        time.sleep(0.05)


def test_a_killed_run_goes_on_where_it_was(tmp_path: Path) -> None:
    with start(tmp_path) as run:
        assert run.stdout is not None
        finished, *workers = [run.stdout.readline() for _ in range(3)][-1].split()
        run.kill()
    wait_for_end([int(pid) for pid in workers])  # without a parent, the workers end
    file = tmp_path / "rows.jsonl"
    before = file.read_text().splitlines()
    assert len(before) >= int(finished) + 1
    file.write_text("\n".join([*before, before[-1][:57]]))  # the last line is half written
    events: list[int] = []
    rows = symcheck.experiment(
        CROWDS,
        PROPERTIES,
        CONSTANTS,
        resume=file,
        progress=lambda event: events.append(len(event.rows)),
    )
    assert len(rows) == 4 * 6 * 4
    assert events[0] == len(before) - 1  # what was finished comes from the file,
    assert set(events[1:]) == {4}  # and the rest is computed, instance by instance
    after = file.read_text().splitlines()
    assert after[: len(before)] == before
    keys = [json.loads(line)["key"] for line in after[1:]]
    assert len(set(keys)) == len(keys) == len(rows)


def test_ctrl_c_ends_the_workers_and_keeps_the_rows(tmp_path: Path) -> None:
    run = start(tmp_path)
    assert run.stdout is not None
    finished, *workers = run.stdout.readline().split()
    run.send_signal(signal.SIGINT)
    out, err = run.communicate(timeout=60)
    assert err == ""
    wait_for_end([int(pid) for pid in workers])
    count, complete = out.splitlines()[-1].split()
    assert complete == "False"
    assert int(finished) <= int(count) < 4 * 6 * 4
    assert len((tmp_path / "rows.jsonl").read_text().splitlines()) == int(count) + 1


HALF_A_MESSAGE = """
import struct, sys, time
frame = sys._getframe()
while "result_queue" not in frame.f_locals:
    frame = frame.f_back
open("half", "w")
frame.f_locals["result_queue"]._writer._send(struct.pack("!i", 1000))
time.sleep(60)
"""


def test_a_pool_ends_while_a_result_is_sent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The thread of the pool that reads the result does not wait for its second half."""
    monkeypatch.chdir(tmp_path)
    pool = ProcessPool(1)
    pool.submit(exec, HALF_A_MESSAGE)
    while not Path("half").exists():
        time.sleep(0.01)
    pool.kill()
    assert active_children() == []


class InterruptedExecutor(Executor):
    """Ctrl-C comes while it has a lock, so to say."""

    locked = False

    def submit(self, fn, /, *arguments, **_):
        self.locked = True
        os.kill(os.getpid(), signal.SIGINT)
        future: Future[object] = Future()
        future.set_result(fn(*arguments))
        self.locked = False
        return future


def test_ctrl_c_does_not_interrupt_an_executor() -> None:
    executor = InterruptedExecutor()
    with pytest.raises(KeyboardInterrupt):
        list(Workers(1, executor).completed(str, [1, 2]))
    assert not executor.locked
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_process_that_cannot_start_is_silent() -> None:
    """A run that ends while its processes start gives them half of what they read."""
    from multiprocessing import spawn

    from symcheck.parallel.processes import _clean_start

    reader, writer = os.pipe()
    os.write(writer, b"half")
    os.close(writer)
    with _clean_start():
        words = spawn.get_command_line(pipe_handle=reader, tracker_fd=-1)
    ended = subprocess.run(words, pass_fds=[reader], capture_output=True)
    os.close(reader)
    assert ended.returncode != 0
    assert (ended.stdout, ended.stderr) == (b"", b"")
