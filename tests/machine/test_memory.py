"""How much memory is free: on the machine, in control groups, below the limits of the process."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from symcheck.machine import FREE_MEMORY, available_memory

MIB = 1 << 20


def folder(root: Path, files: dict[str, str]) -> str:
    """A folder with the files of a machine on which 1000 MiB are available."""
    meminfo = f"MemTotal: {4000 * 1024} kB\nMemAvailable:    {1000 * 1024} kB\n"
    for name, text in {"proc/meminfo": meminfo, **files}.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return str(root)


V1 = "sys/fs/cgroup/memory"
V2 = "sys/fs/cgroup"


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        ({}, 1000),
        ({"proc/self/cgroup": "0::/\n", f"{V2}/memory.max": "max\n"}, 1000),
        (
            {
                "proc/self/cgroup": "0::/a/b\n",
                f"{V2}/a/memory.max": f"{300 * MIB}\n",
                f"{V2}/a/memory.current": f"{120 * MIB}\n",
                f"{V2}/a/memory.stat": f"anon 5\ninactive_file {20 * MIB}\n",
                f"{V2}/a/b/memory.max": "max\n",
            },
            200,
        ),
        (
            {
                "proc/self/cgroup": "9:cpu:/\n4:memory:/outside/of/the/container\n",
                f"{V1}/memory.limit_in_bytes": f"{500 * MIB}",
                f"{V1}/memory.usage_in_bytes": f"{100 * MIB}",
            },
            400,
        ),
        (
            {
                "proc/self/cgroup": "4:memory:/\n",
                f"{V1}/memory.limit_in_bytes": f"{2**63 - 4096}",
                f"{V1}/memory.usage_in_bytes": "1",
            },
            1000,
        ),
        (
            {
                "proc/self/cgroup": "0::/\n",
                f"{V2}/memory.max": f"{MIB}",
                f"{V2}/memory.current": f"{2 * MIB}",
            },
            0,
        ),
    ],
)
def test_the_least_counts(files: dict[str, str], expected: int, tmp_path: Path) -> None:
    assert available_memory(folder(tmp_path, files)) == expected * MIB


def test_without_files_the_machine_counts(tmp_path: Path) -> None:
    assert available_memory(str(tmp_path)) > 100 * MIB


@pytest.mark.parametrize(("text", "expected"), [("5m", 5 * MIB), ("64", 64 << 10), ("lots", None)])
def test_the_environment_counts(
    text: str, expected: int | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(FREE_MEMORY, text)
    assert available_memory(folder(tmp_path, {})) == (expected or 1000 * MIB)


LIMITED = """
from symcheck.machine import available_memory, limit_memory
limit_memory(50 << 20)
assert 40 << 20 < available_memory() <= 50 << 20
limit_memory(100 << 20)
assert available_memory() <= 50 << 20
held = bytearray(20 << 20)
assert available_memory() < 31 << 20
try:
    bytearray(40 << 20)
except MemoryError:
    print("refused")
"""


def test_an_allocation_beyond_the_limit_fails() -> None:
    run = subprocess.run([sys.executable, "-c", LIMITED], capture_output=True, text=True)
    assert (run.stdout, run.stderr) == ("refused\n", "")
