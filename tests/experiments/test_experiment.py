"""Experiments: one row for each property and combination of constants, whoever computes it."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from fractions import Fraction
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

import symcheck
from symcheck.check.bisimulation import on_quotient
from symcheck.check.result import Certified, Exact
from symcheck.errors import InputError, UsageError
from symcheck.experiments.run import Progress
from symcheck.experiments.table import Experiment

MODEL = """dtmc const int N; const double p; module m s : [0..N] init 0; t : [0..3] init 0;
  [] s<N -> p:(s'=s+1)&(t'=2) + 1-p:(s'=0)&(t'=1); [] s=N -> true; endmodule label "done" = s=N;"""
PROPERTIES = (
    """const int k; "reach": P=? [ F<=k "done" ]; P=? [ F "done" ]; "live": A [ G !"deadlock" ];"""
)
CONSTANTS = {"N": range(1, 4), "p": [0.25, 0.5], "k": "1:2:5"}


def table(rows: Experiment) -> list[tuple[object, ...]]:
    return [(r.name, *r.constants.items(), r.value, r.accuracy, r.error, r.states) for r in rows]


@pytest.fixture(scope="module")
def expected() -> Experiment:
    return symcheck.experiment(MODEL, PROPERTIES, CONSTANTS)


def test_rows_are_in_the_order_of_the_constants_and_typed(expected: Experiment) -> None:
    assert len(expected) == 3 * 2 * (3 + 1 + 1)
    assert expected.varying == ("N", "p", "k")
    assert [r.constants for r in expected[:5]] == [
        {"N": 1, "p": 0.25, "k": 1},
        {"N": 1, "p": 0.25, "k": 3},
        {"N": 1, "p": 0.25, "k": 5},
        {"N": 1, "p": 0.25},
        {"N": 1, "p": 0.25},
    ]
    row = expected.select("reach", N=2, p=0.5, k=3)[0]
    assert (row.value, row.states, row.formula) == (0.375, 4, 'P=? [ F<=k "done" ]')
    assert row.bounds == pytest.approx((0.375, 0.375), rel=1e-12)
    assert row.bounds[0] <= 0.375 <= row.bounds[1]
    assert expected.select("live", N=1, p=0.5)[0].value is True
    assert all(r.seconds > 0 and r.build_seconds > 0 for r in expected)
    assert expected.complete
    assert expected.errors == ()


@pytest.mark.filterwarnings("ignore:.*multi-threaded, use of fork:DeprecationWarning")
@pytest.mark.parametrize("method", ["spawn", "fork", "forkserver"])
def test_the_start_method_changes_nothing(method: str, expected: Experiment) -> None:
    with ProcessPoolExecutor(2, get_context(method)) as pool:
        rows = symcheck.experiment(MODEL, PROPERTIES, CONSTANTS, executor=pool)
    assert table(rows) == table(expected)


def test_jobs_and_threads_change_nothing(expected: Experiment) -> None:
    assert table(symcheck.experiment(MODEL, PROPERTIES, CONSTANTS, jobs=2)) == table(expected)
    with ThreadPoolExecutor(3) as threads:
        rows = symcheck.experiment(MODEL, PROPERTIES, CONSTANTS, executor=threads)
    assert table(rows) == table(expected)


def test_forms_of_models_properties_and_constants(tmp_path: Path, expected: Experiment) -> None:
    (tmp_path / "m.pm").write_text(MODEL)
    (tmp_path / "m.pctl").write_text(PROPERTIES)
    parsed = symcheck.parse_properties(PROPERTIES)
    loaded = symcheck.loads(MODEL, {"p": 0.25}, engine="sparse")
    for model, properties, constants in (
        (tmp_path / "m.pm", str(tmp_path / "m.pctl"), "N=1:3,p={0.25,0.5},k=1:2:5"),
        (
            str(tmp_path / "m.pm"),
            parsed,
            {"N": np.arange(1, 4), "p": (0.25, 0.5), "k": ["1", 3, 5]},
        ),
        (loaded, parsed, {"N": "1:3", "p": np.array([0.25, 0.5]), "k": [np.int64(1), 3, 5]}),
    ):
        rows = symcheck.experiment(model, properties, constants)
        assert [(r.name, r.constants, r.value) for r in rows] == [
            (r.name, r.constants, r.value) for r in expected
        ]
    fixed = symcheck.experiment(loaded, parsed, {"N": 1, "k": 3}, exact=True)
    assert fixed[0].constants == {"p": 0.25, "N": 1, "k": 3}
    assert fixed[0].value == Fraction(37, 64)


def test_accuracies_are_those_of_results() -> None:
    model = "ctmc module m x : [0..1]; [] x=0 -> 1:(x'=1); endmodule"
    rows = symcheck.experiment(model, "const double T; P=? [ F<=T x=1 ]", {"T": [0.5, 1]})
    for row in rows:
        assert isinstance(row.accuracy, Certified)
        assert row.bounds == (row.accuracy.lower, row.accuracy.upper)
        assert row.bounds[0] <= row.value <= row.bounds[1]  # type: ignore[operator]
    assert isinstance(symcheck.experiment(model, "1+1")[0].accuracy, Exact)


def test_a_failed_instance_is_a_row_and_the_others_go_on() -> None:
    rows = symcheck.experiment(
        MODEL, 'P=? [ F "done" ]; P=? [ F "nowhere" ]', {"N": 2, "p": [0.5, 2]}
    )
    assert [r.constants["p"] for r in rows.errors] == [0.5, 2, 2]
    label, fault, _ = (r.error or "" for r in rows.errors)
    assert "nowhere" in label
    assert "probabilit" in fault
    assert rows[0].value == pytest.approx(1)
    assert {r.value for r in rows.errors} == {None}


@pytest.mark.parametrize(
    ("constants", "message"),
    [
        ({"N": 2}, "no value is given for p, k"),
        ({"N": [], "p": 1, "k": 1}, "N has no value"),
        ({"N": object(), "p": 1, "k": 1}, "expected a bool, a number or a text"),
        ({"N": "3:1", "p": 1, "k": 1}, "the range 'N=3:1' is empty"),
        ({"N": 2, "p": 1, "k": 1, "q": 1}, "constant q is given a value"),
        ([1, 2], "expected a mapping or a text"),
        ("N", "not of the form NAME=VALUE"),
    ],
)
def test_faults_of_constants_are_told_before_anything_is_built(constants, message) -> None:
    with pytest.raises((UsageError, InputError), match=message):
        symcheck.experiment(MODEL, PROPERTIES, constants)


def test_faults_of_the_call() -> None:
    with pytest.raises(UsageError, match="jobs=0"):
        symcheck.experiment(MODEL, PROPERTIES, CONSTANTS, jobs=0)
    with pytest.raises(UsageError, match=r"missing\.pm"):
        symcheck.experiment("missing.pm", PROPERTIES, CONSTANTS)
    with pytest.raises(UsageError, match="there is no option 'epsilom'"):
        symcheck.experiment(MODEL, PROPERTIES, CONSTANTS, epsilom=1)


def test_properties_of_an_instance_share_a_quotient(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    made = on_quotient.shared_quotient

    def shared_quotient(engine, formulas, options):
        asked.append(len(formulas))
        return made(engine, formulas, options)

    monkeypatch.setattr(on_quotient, "shared_quotient", shared_quotient)
    rows = symcheck.experiment(MODEL, PROPERTIES, CONSTANTS, bisim=True, engine="explicit")
    assert asked == [5] * 6
    plain = symcheck.experiment(MODEL, PROPERTIES, CONSTANTS, engine="explicit", reduce=True)
    assert [r.value for r in rows] == pytest.approx([r.value for r in plain], rel=1e-9)
    assert plain.select(N=2)[0].states == 3


def test_progress_is_told_of_each_instance() -> None:
    events: list[Progress] = []
    rows = symcheck.experiment(MODEL, PROPERTIES, CONSTANTS, progress=events.append)
    assert [e.finished for e in events] == [5, 10, 15, 20, 25, 30]
    assert {e.total for e in events} == {30}
    assert [row for e in events for row in e.rows] == list(rows)
    assert str(events[0]) == "5 of 30 results"


def test_ctrl_c_keeps_finished_rows(expected: Experiment) -> None:
    def stop(event: Progress) -> None:
        if event.finished == 10:
            raise KeyboardInterrupt

    rows = symcheck.experiment(MODEL, PROPERTIES, CONSTANTS, progress=stop)
    assert table(rows) == table(expected)[:10]
    assert not rows.complete
    assert repr(rows) == "<Experiment: 10 rows, 0 errors, stopped before the end>"
    assert "stopped before the end" in rows._repr_html_()


def test_a_script_needs_no_guard(tmp_path: Path) -> None:
    """Processes that are spawned do not run the script again."""
    script = tmp_path / "script.py"
    script.write_text(
        "import symcheck\n"
        "print('once')\n"
        f"rows = symcheck.experiment({MODEL!r}, 'P=? [ F s=1 ]', 'N=1:4,p=0.5', jobs=2)\n"
        "print(len(rows), len(rows.errors))\n"
    )
    run = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=120)
    assert (run.stdout, run.stderr) == ("once\n4 0\n", "")
