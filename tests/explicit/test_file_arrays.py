"""Large arrays in files: the same results within less memory, and nothing is left behind."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import symcheck
from symcheck.cli import main
from symcheck.errors import UsageError
from symcheck.explicit.file_arrays import arrays_in
from symcheck.kernels.file_memory import mapped_bytes

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="files are memory on Linux only")

LARGE = 3 << 20  # doubles: 24 MB
GRID = """dtmc
const int N = 1800;
module m
  x : [0..N];
  y : [0..N];
  [] x<N & y<N -> 0.5:(x'=x+1) + 0.5:(y'=y+1);
  [] x<N & y=N -> (x'=x+1);
  [] x=N & y<N -> (y'=y+1);
endmodule
"""
PROPERTY = "P=? [ F x=N & y=N ]"


def test_large_arrays_are_in_files_and_small_ones_are_not(tmp_path):
    before = mapped_bytes()
    with arrays_in(str(tmp_path)):
        large, small = np.ones(LARGE), np.ones(100)
        assert mapped_bytes() - before == large.nbytes
        zeros = np.zeros(LARGE)
        assert not zeros.any()
        assert large.sum() == LARGE
        assert small.sum() == 100
        zeros.resize(2 * LARGE, refcheck=False)
        zeros[-1] = 1
        assert mapped_bytes() - before == large.nbytes + zeros.nbytes
    outside = np.ones(LARGE)
    assert mapped_bytes() - before == large.nbytes + zeros.nbytes
    assert list(tmp_path.iterdir()) == []
    del large, zeros, outside
    assert mapped_bytes() == before


def test_folders_that_hold_no_files_are_refused(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    for folder in ("missing", "file"):
        with pytest.raises(UsageError, match="there is no folder"):
            symcheck.loads("dtmc module m endmodule", workdir=str(tmp_path / folder)).check(
                "P=? [ F true ]"
            )
    (tmp_path / "m.pm").write_text("dtmc module m endmodule")
    assert main([str(tmp_path / "m.pm"), "-workdir", str(tmp_path / "missing")]) == 2
    assert "there is no folder" in capsys.readouterr().err


def run(folder: Path, limit: str, *words: str) -> subprocess.CompletedProcess[str]:
    """Check the grid, of 3.2 million states, in a process with a limit of the shell."""
    (folder / "grid.pm").write_text(GRID)
    command = [sys.executable, "-m", "symcheck", str(folder / "grid.pm"), "-pf", PROPERTY, *words]
    shell = ["bash", "-c", f'ulimit {limit}; exec "$@"', "bash", *command]
    return subprocess.run(shell, capture_output=True, text=True, check=False)


def test_a_model_beyond_the_memory_is_checked(tmp_path):
    limit = "-d 200000"  # kB; in memory the explicit engine takes more than twice as much
    failed = run(tmp_path, limit, "-ex")
    assert failed.returncode == 3
    assert "memory" in failed.stderr
    done = run(tmp_path, limit, "-workdir", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert "Engine:      explicit (chosen automatically: its arrays may be in files)" in done.stdout
    assert "States:      3243601 (1 initial)" in done.stdout
    assert "Result: 1.0 (exact)" in done.stdout
    assert [p.name for p in tmp_path.iterdir()] == ["grid.pm"]


def test_a_full_disk_ends_a_run_as_the_end_of_memory_does(tmp_path):
    full = run(tmp_path, "-f 30000", "-ex", "-workdir", str(tmp_path))  # files of 30 MB at most
    assert full.returncode == 3
    assert "Traceback" not in full.stderr
    assert "memory" in full.stderr
