"""The option `time_limit` of the library: a call ends with TimeLimitError."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from time import perf_counter, sleep

import pytest

import symcheck
from symcheck.errors import TimeLimitError
from symcheck.options import EngineName
from symcheck.time_limit import within

CHAIN = """dtmc module m x : [0..3000000]; [] x>0 & x<3000000 -> 0.5:(x'=x-1) + 0.5:(x'=x+1);
  [] x=0 | x=3000000 -> true; endmodule init x=1500000 endinit"""
ENDLESS = """dtmc module m x : [0..100000000]; y : [0..100000000];
  [] true -> 0.5 : (x'=mod(x*7+y+1, 99999989)) + 0.5 : (y'=mod(x+y*5+3, 99999971)); endmodule"""
STEP = "dtmc module m x : [0..1]; [] x=0 -> (x'=1); endmodule"


def here(call: Callable[[], object]) -> None:
    call()


def in_thread(call: Callable[[], object]) -> None:
    """Let the error of a call in another thread be raised here."""
    errors: list[BaseException] = []

    def run() -> None:
        try:
            call()
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    if errors:
        raise errors[0]


@pytest.mark.parametrize("run", [here, in_thread])
@pytest.mark.parametrize(
    ("text", "formula", "engine"),
    [
        (CHAIN, "P=? [ F<=1000000 x=0 ]", "sparse"),
        (CHAIN, "P=? [ F<=1000000 x=0 ]", "hybrid"),
        (CHAIN, "P=? [ F x=0 ]", "explicit"),
        (CHAIN, "P=? [ F x=0 ]", "mtbdd"),
        (ENDLESS, "P=? [ F x=0 ]", "explicit"),
        (ENDLESS, "P=? [ F x=0 ]", "mtbdd"),
        (ENDLESS, "P=? [ F x=0 ]", "exact"),
    ],
)
def test_a_long_check_ends(
    run: Callable[[Callable[[], object]], None], text: str, formula: str, engine: EngineName
) -> None:
    model = symcheck.loads(text, engine=engine, time_limit=0.5)
    started = perf_counter()
    with pytest.raises(TimeLimitError, match=r"^the time limit of 0\.5 s was reached"):
        run(lambda: model.check(formula))
    assert perf_counter() - started < 10  # half a second later on an idle machine, and not hours


@pytest.mark.parametrize("engine", ["explicit", "mtbdd"])
def test_an_engine_may_notice_the_end_of_the_time_first(
    engine: EngineName, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The timer is late on a machine under load."""
    monkeypatch.setattr("symcheck.time_limit.ThreadTimer.start", lambda _: None)
    model = symcheck.loads(ENDLESS, engine=engine, time_limit=0.3)
    with pytest.raises(TimeLimitError, match=r"^the time limit of 0\.3 s was reached"):
        in_thread(lambda: model.check("P=? [ F x=0 ]"))


@pytest.mark.parametrize("engine", ["explicit", "mtbdd"])
def test_a_later_call_has_the_whole_time(engine: EngineName) -> None:
    model = symcheck.loads(STEP, engine=engine, time_limit=1)
    assert model.check("P=? [ F x=1 ]").value == 1
    sleep(1.1)
    assert model.check("P=? [ F x=1 ]").value == 1


SHORT_CHAIN = CHAIN.replace("3000000", "200000").replace("1500000", "100000")


def test_each_property_has_the_whole_time() -> None:
    model = symcheck.loads(SHORT_CHAIN, engine="explicit", time_limit=2)
    results = model.check_all("x=0; x=1; P=? [ F<=10000000 x=0 ]")
    assert next(results)[1].value is False
    sleep(2.1)
    assert next(results)[1].value is False
    with pytest.raises(TimeLimitError):
        next(results)


def test_a_row_of_an_experiment_has_the_error() -> None:
    model = symcheck.loads("const int N;" + SHORT_CHAIN, engine="explicit", time_limit=2)
    rows = symcheck.experiment(model, "P=? [ F<=10000000 x=0 ]; x=0", "N=1:2")
    assert ["time limit" in (row.error or "") for row in rows] == [True, False, True, False]


def test_signals_are_as_before() -> None:
    before = signal.getsignal(signal.SIGALRM)
    assert symcheck.loads(STEP, time_limit=100).check("P=? [ F x=1 ]").value == 1
    assert signal.getsignal(signal.SIGALRM) == before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_an_alarm_of_the_caller_is_left_alone() -> None:
    rung: list[int] = []
    before = signal.signal(signal.SIGALRM, lambda number, _: rung.append(number))
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        with pytest.raises(TimeLimitError):
            symcheck.loads(ENDLESS, engine="exact", time_limit=0.5).check("P=? [ F x=0 ]")
    finally:
        signal.signal(signal.SIGALRM, before)
    assert rung == [signal.SIGALRM]


def test_other_errors_pass() -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        within(100, interrupted)
    with pytest.raises(ZeroDivisionError):
        within(100, lambda: 1 / 0)


@pytest.mark.parametrize("run", [here, in_thread])
def test_a_file_that_is_being_opened_is_dropped_in_silence(
    run: Callable[[Callable[[], object]], None], tmp_path: Path
) -> None:
    """Warnings are errors here, and pytest reports those that a destructor cannot raise."""
    (path := tmp_path / "file").touch()

    def read_again_and_again() -> None:
        while True:
            with path.open("rb", buffering=0) as file:
                file.read()

    for _ in range(40):
        with pytest.raises(TimeLimitError):
            run(lambda: within(0.005, read_again_and_again))


@pytest.mark.parametrize("run", [here, in_thread])
def test_a_module_is_imported_completely(
    run: Callable[[Callable[[], object]], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """numpy, for example, cannot be imported again where an interrupt has stopped its import."""
    name = f"slow_{run.__name__}"
    (tmp_path / f"{name}.py").write_text(
        "import time\nend = time.monotonic() + 0.4\nwhile time.monotonic() < end: pass\ndone = True"
    )
    monkeypatch.syspath_prepend(tmp_path)

    def compute() -> None:
        import_module(name)
        while True:
            pass

    with pytest.raises(TimeLimitError):
        run(lambda: within(0.1, compute))
    assert sys.modules[name].done


def test_the_outer_limit_holds() -> None:
    started = perf_counter()
    with pytest.raises(TimeLimitError, match=r"limit of 0.2 s was reached"):
        within(0.2, lambda: within(100, lambda: sleep(50)))
    assert perf_counter() - started < 10


TRACED = """
import sys, threading
from time import monotonic
from symcheck.errors import TimeLimitError
from symcheck.time_limit import PATIENCE, within

def compute(seconds):  # ends about when the limit does, or when the interrupt is repeated
    until = monotonic() + seconds
    try:
        while monotonic() < until:
            pass
    except KeyboardInterrupt:
        while monotonic() < until + PATIENCE:
            pass
        raise

def repeat():
    for round in range(150):
        try:
            within(0.01, lambda: compute(0.01 + (round - 75) * 1e-5))
        except TimeLimitError:
            pass

threading.settrace(lambda *_: None)
thread = threading.Thread(target=repeat)
thread.start()
thread.join()
sys.settrace(lambda *_: None)
repeat()
print("ended")
"""


def test_limits_end_where_calls_are_traced() -> None:
    """CPython 3.11 repeats a traced call for ever while an error is set for a thread that waits."""
    command = [sys.executable, "-c", TRACED]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert (run.stdout, run.stderr) == ("ended\n", "")
