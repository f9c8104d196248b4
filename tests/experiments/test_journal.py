"""Resuming from a file: nothing is lost, nothing is computed twice, nothing is mixed up."""

from __future__ import annotations

import fcntl
import json
from fractions import Fraction
from pathlib import Path

import pytest

import symcheck
from symcheck.errors import UsageError

MODEL = """dtmc const int N; const double p = 0.5; module m s : [0..9] init 0;
  [] s<N -> p:(s'=s+1) + 1-p:(s'=0); [] s>=N -> true; endmodule
  rewards true : 1; endrewards"""
PROPERTIES = "const int k; P=? [ F<=k s=N ]; R=? [ F s=N ]; s; P=? [ F s=4 ]"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "rows.jsonl"


def run(file: Path, numbers: object, **options: object) -> tuple[list[int], list[object]]:
    """Sizes of the events, and the rows."""
    events: list[int] = []
    rows = symcheck.experiment(
        MODEL,
        PROPERTIES,
        {"N": numbers, "k": [2, 3]},
        resume=file,
        progress=lambda event: events.append(len(event.rows)),
        **options,  # type: ignore[arg-type]
    )
    return events, list(rows)


@pytest.mark.parametrize("options", [{}, {"exact": True}, {"certify": False}])
def test_rows_are_read_as_they_were_written(options: dict[str, object], file: Path) -> None:
    _, first = run(file, [1, 2], **options)
    assert all(row.error is None for row in first)  # type: ignore[attr-defined]
    events, again = run(file, [1, 2], **options)
    assert again == first
    assert events == [10]
    assert len(file.read_text().splitlines()) == 11


def test_rationals_and_pairs_are_kept(file: Path) -> None:
    model = """dtmc module m x : [0..2]; [] x=0 -> 1/3:(x'=1) + 2/3:(x'=2); [] x>0 -> true;
      endmodule init x<2 endinit"""
    rows = [symcheck.experiment(model, "P=? [ F x=1 ]", exact=True, resume=file) for _ in range(2)]
    assert rows[0][0].value == (Fraction(1, 3), 1)
    assert list(rows[0]) == list(rows[1])
    assert rows[1][0].bounds == pytest.approx((1 / 3, 1))


def test_values_may_be_added(file: Path) -> None:
    run(file, [1, 2])
    events, rows = run(file, range(1, 5))
    assert events == [10, 5, 5]
    assert len(rows) == 20
    assert len(run(file, 3)[1]) == 5  # and left out


def test_half_an_instance_is_completed(file: Path) -> None:
    _, first = run(file, 1)
    lines = file.read_text().splitlines(keepends=True)
    file.write_text("".join(lines[:3]) + lines[3][:-1])  # a line without its end is incomplete
    events, rows = run(file, 1)
    assert events == [2, 3]
    assert [r.value for r in rows] == [r.value for r in first]  # type: ignore[attr-defined]
    assert len(file.read_text().splitlines()) == 6


def test_a_first_line_may_be_half_written(file: Path) -> None:
    file.write_text('{"experim')
    assert run(file, 1)[0] == [5]
    assert json.loads(file.read_text().splitlines()[0]).keys() == {"experiment"}


def test_a_file_of_another_experiment_is_refused(file: Path) -> None:
    run(file, 1)
    before = file.read_text()
    with pytest.raises(UsageError, match="another experiment: another set of options\n"):
        run(file, 1, epsilon=1e-8)
    with pytest.raises(UsageError, match="another model, another set of properties\n"):
        symcheck.experiment(MODEL.replace("0.5", "0.25"), "P=? [ F s=1 ]", {"N": 1}, resume=file)
    assert file.read_text() == before


@pytest.mark.parametrize(
    "text", ["no JSON\n", "[]\n", "{}\n", '{"experiment": 7}\n', "half a line"]
)
def test_another_file_is_refused_and_kept(text: str, file: Path) -> None:
    file.write_text(text)
    with pytest.raises(UsageError, match="not a file of finished rows"):
        run(file, 1)
    assert file.read_text() == text


def test_files_that_cannot_be_used(file: Path) -> None:
    with pytest.raises(UsageError, match="resume: cannot write"):
        run(file / "below", 1)
    with file.open("w") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        with pytest.raises(UsageError, match="in use by another run"):
            run(file, 1)


def test_errors_are_rows_of_the_file_too(file: Path) -> None:
    rows = symcheck.experiment(MODEL, 'P=? [ F "x" ]', {"N": [1, 2]}, resume=file)
    assert len(rows.errors) == 2
    again = symcheck.experiment(MODEL, 'P=? [ F "x" ]', {"N": [1, 2]}, resume=file)
    assert list(again) == list(rows)
