"""-distributed partitions the states of a model over the workers of a cluster, and prints the same."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import chain, repeat
from pathlib import Path

import pytest

from in_process_cluster import InProcessCluster, cluster
from symcheck.cli import main, partitioned
from symcheck.distributed import parts

MODELS = Path(__file__).parents[2] / "models"
DIE = [str(MODELS / "die" / "die.pm")]
SWITCHES = ["-scheduler", "tcp://host:1", "-distributed"]
Said = Callable[..., tuple[int, str]]


@pytest.fixture
def workers(monkeypatch: pytest.MonkeyPatch) -> InProcessCluster:
    """Two workers, to which -scheduler connects."""
    started = cluster(2)

    @contextmanager
    def connect(_: str) -> Iterator[InProcessCluster]:
        yield started

    monkeypatch.setattr(partitioned, "connect", connect)
    monkeypatch.setattr(parts, "limit_worker", lambda: None)
    return started


@pytest.fixture
def said(workers: InProcessCluster, capsys: pytest.CaptureFixture[str]) -> Said:
    """Runs the command line on the workers; gives status and all output."""

    def run(*words: str) -> tuple[int, str]:
        status = main([*words, *SWITCHES])
        printed = capsys.readouterr()
        return status, printed.out + printed.err

    return run


def test_the_lines_are_those_of_other_engines(
    said: Said, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [*DIE, "-pf", 'P=? [ F d=6 ]; P>0.1 [ F d=6 ]; R{"tosses"}=? [ F d>0 ]']
    status, out = said(*words)
    assert status == 0
    assert main([*words, "-ex"]) == 0
    expected = capsys.readouterr().out
    assert "Engine:      explicit, on 2 workers" in out

    def skeleton(text: str) -> list[str]:
        """The lines without times and digits of results, up to their first words."""
        lines = [x for x in text.splitlines() if x and not x.startswith(("Engine", "Time", "Note"))]
        return [x[:14] if x.startswith("Result") else x for x in lines if not x.startswith(" ")]

    assert [x for x in skeleton(out) if x.startswith(("States", "Trans", "Model c", "Result"))] == [
        x for x in skeleton(expected) if x.startswith(("States", "Trans", "Model c", "Result"))
    ]


def test_results_of_several_instances_are_written(said: Said, tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    model = tmp_path / "walk.pm"
    model.write_text(
        "mdp const int N; module m x:[0..N] init 1; "
        "[] x>0 & x<N -> 0.5:(x'=x+1)+0.5:(x'=x-1); endmodule"
    )
    words = [str(model), "-pf", "Pmax=? [ F x=N ]", "-const", "N=3:4"]
    status, out = said(*words, "-exportresults", str(table), "-checkpoints", str(tmp_path / "c"))
    assert status == 0
    assert out.count("Choices:     ") == 2
    assert "deadlocks were given self-loops in 2 states, such as (x=" in out
    rows = table.read_text().splitlines()
    assert len(rows) == 3
    assert len(list(tmp_path.glob("c*"))) == 2


def test_result_lines_are_tested(said: Said, tmp_path: Path) -> None:
    properties = tmp_path / "die.pctl"
    properties.write_text("// RESULT: 1/6\nP=? [ F d=6 ];\n// RESULT: 0.2\nP=? [ F d=5 ];\n")
    status, out = said(*DIE, str(properties), "-testall")
    assert status == 1
    assert out.count("PASS") >= 1
    assert out.count("FAIL") >= 1


def test_switches_that_the_parts_do_not_read_are_noted(said: Said) -> None:
    status, out = said(*DIE, "-pf", "P=? [ F d=6 ]", "-method", "power", "-threads", "2")
    assert status == 0
    assert "-method, -threads have no effect: -distributed iterates bounds" in " ".join(out.split())


def test_faults_are_told(said: Said, workers: InProcessCluster, tmp_path: Path) -> None:
    status, out = said(*DIE, "-pf", "P=? [ X d=6 ]; P=? [ F d=6 ]")
    assert status == 1
    assert "a distributed model is checked for" in out
    assert "Result:" in out
    assert said(*DIE, "-pf", "P=? [ F d=6 ]", "-s")[0] == 2
    model = tmp_path / "walk.pm"
    model.write_text("dtmc const int N; module m x:[0..3] init N; [] x<5 -> (x'=x+1); endmodule")
    status, out = said(str(model), "-pf", "P=? [ F x=2 ]", "-const", "N=2")
    assert status == 1
    assert "range" in out
    status, out = said(str(model), "-pf", "P=? [ F x=2 ]", "-const", "N=2:3")
    assert status == 1
    assert out.count("Error:") == 2
    workers.killed = chain(repeat(False, 20), [True])
    status, out = said(*DIE, "-pf", "P=? [ F d=6 ]")
    assert status not in (0, 2)
    assert "a worker of the cluster is lost" in out
