"""Threads share exploration and products, and no digit depends on their number."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import symcheck
from symcheck.errors import Interrupted, ModelFault, TimeLimitError
from symcheck.explicit import build, tuning
from symcheck.explicit.build import Exploration
from symcheck.matrices import tuning as matrix_tuning
from symcheck.numerics import tuning as numerics_tuning
from symcheck.operating_system import processors
from symcheck.parallel.threads import helpers, on_team, thread_count, use_threads

BITS = range(15)
"""All values of so many bits are states: levels are wide enough for threads."""


def hypercube(kind: str, flip: str, rest: str = "") -> str:
    """Modules of one bit each, which flip it."""
    modules = "".join(
        f"module m{i} b{i} : bool; [{'a' if i % 2 else ''}] !b{i} -> {flip.format(i=i)};"
        f" [] b{i} & !b{(i + 1) % len(BITS)} -> {flip.format(i=i)}; endmodule "
        for i in BITS
    )
    together = " ".join(f"m{i}" for i in BITS).replace(" ", " ||| ")
    return f"{kind} {modules} system {together} endsystem {rest}"


REWARDS = 'rewards [a] true : 0.3; b3 : 1.7; endrewards label "all" = b0 & b4 & b7 & b11;'
CTMC = hypercube("ctmc", "0.7+0.1*{i} : (b{i}'=!b{i})", REWARDS)
DTMC = hypercube("dtmc", "0.3 : (b{i}'=!b{i}) + 0.7 : true", REWARDS)
MDP = hypercube("mdp", "0.3 : (b{i}'=!b{i}) + 0.7 : true", REWARDS)
SYMMETRIC = "ctmc module m0 b0:[0..8]; [] b0<8 -> b0+0.5 : (b0'=b0+1); endmodule " + " ".join(
    f"module m{i}=m0[b0=b{i}] endmodule" for i in range(1, 12)
)
RING = "dtmc " + " ".join(
    f"module r{i} x{i}:[0..1]; [s] x{i}=x{(i - 1) % 11} -> {0.3 + i / 50}:(x{i}'=0)"
    f" + {0.7 - i / 50}:(x{i}'=1); [s] x{i}!=x{(i - 1) % 11} -> (x{i}'=x{(i - 1) % 11}); endmodule"
    for i in range(11)
)
RING += " init true endinit"
"""Rows of up to 2,048 entries."""
FAULT = DTMC.replace("dtmc", "dtmc module f x:[0..3]; [] b1&b5&b9&b13 -> (x'=x-1); endmodule", 1)
FAULT = FAULT.replace(" system ", " system f ||| ")


@pytest.fixture(autouse=True)
def threads_for_small_models(monkeypatch):
    monkeypatch.setattr(tuning, "THREADED_STATES", 0)
    monkeypatch.setattr(tuning, "SECONDS_PER_SLICE", 0.002)
    monkeypatch.setattr(matrix_tuning, "MIN_THREADED_ENTRIES", 0)
    monkeypatch.setattr(matrix_tuning, "MIN_THREADED_ROWS_ENTRIES", 0)
    monkeypatch.setattr(numerics_tuning, "TWO_THREADS_STATES", 0)


@pytest.fixture
def counts(monkeypatch):
    """The numbers of threads that explore more than nothing."""
    seen = []

    def recorded():
        seen.append(thread_count())
        return helpers()

    monkeypatch.setattr(build, "helpers", recorded)
    return seen


def explored(text: str, count: int) -> list[bytes]:
    """The arrays of a model, explored by some threads."""
    bound = symcheck.loads(text).bound
    model = symcheck.explore(bound, symcheck.Options(threads=count))
    arrays = [*model.matrix.arrays, model.states.rows, model.choice_actions, model.deadlocks]
    arrays += [*model.choice_rewards, *model.state_rewards, model.initial]
    arrays += [] if model.matrix.groups is None else [model.matrix.groups]
    return [np.ascontiguousarray(a).tobytes() for a in arrays]


@pytest.mark.parametrize("text", [CTMC, DTMC, MDP, RING], ids=["ctmc", "dtmc", "mdp", "ring"])
def test_states_and_rows_do_not_depend_on_threads(text, counts):
    alone = explored(text, 1)
    assert not counts
    assert explored(text, 2) == alone == explored(text, 3)
    assert set(counts) == {2, 3}


def test_few_states_with_many_entries_have_threads(counts, monkeypatch):
    monkeypatch.setattr(tuning, "THREADED_STATES", 10**9)
    explored(RING, 2)
    assert not counts
    monkeypatch.setattr(tuning, "THREADED_ENTRIES", 10_000)
    explored(RING, 2)
    assert set(counts) == {2}


def test_long_rows_are_in_order():
    """Each row is the product of what the processes do on their own."""
    model = symcheck.explore(symcheck.loads(RING).bound, symcheck.Options())
    matrix, step = model.matrix, int(model.states.rows[1, 0])
    states = [row // step for row in model.states.rows[:, 0].tolist()]  # x0 has the highest bit
    assert states == list(range(2_048))
    assert matrix.longest == 2_048
    for s in (0, 1, 700, 1_365, 2_047):
        bits = [s >> 10 - i & 1 for i in range(11)]
        products = {0: 1.0}
        for i in range(11):
            left, p = bits[i - 1], 0.3 + i / 50
            moves = {0: p, 1: 0.7 - i / 50} if bits[i] == left else {left: 1.0}
            products = {
                t | b << 10 - i: w * q for t, w in products.items() for b, q in moves.items()
            }
        row = slice(matrix.indptr[s], matrix.indptr[s + 1])
        columns = matrix.indices[row].tolist()
        assert columns == sorted(products)
        expected = [products[c] for c in columns]
        assert matrix.data[row] == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("budget", [1, 20_000, 30_001])
def test_a_budget_stops_at_the_same_state(budget):
    stops = []
    for count in (1, 2, 3):
        search = Exploration(symcheck.loads(MDP).bound, symcheck.Options(threads=count))
        assert not search.run(budget)
        stops.append((len(search.rows()), search.progress.explored, search.progress.transitions))
        assert search.run()
    assert stops[0] == stops[1] == stops[2]


def test_an_interrupted_search_goes_on():
    search = Exploration(symcheck.loads(MDP).bound, symcheck.Options(threads=2))

    def interrupt(progress):
        if progress.states > 10_000:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted):
        search.run(None, interrupt)
    assert search.run()
    assert search.finish().matrix.data.tobytes() == explored(MDP, 1)[2]


def test_a_fault_is_the_same_one():
    messages = set()
    for count in (1, 2, 3):
        with pytest.raises(ModelFault) as fault:
            explored(FAULT, count)
        messages.add(str(fault.value))
    assert len(messages) == 1


MEASURES = [
    (CTMC, 'P=? [ F<=2 "all" ]', {}),
    (CTMC, "R=? [ C<=0.7 ]", {}),
    (CTMC, "R=? [ S ]", {}),
    (CTMC, 'P=? [ F "all" ]', {"method": "interval"}),
    (DTMC, 'P=? [ F<=20 "all" ]', {}),
    (DTMC, 'R=? [ F "all" ]', {"method": "power"}),
    (MDP, 'Pmax=? [ F<=9 "all" ]', {}),
    (MDP, 'Pmin=? [ F "all" ]', {"method": "interval"}),
    (MDP, 'Rmin=? [ F "all" ]', {"method": "optimistic"}),
]


@pytest.mark.parametrize("engine", ["explicit", "sparse", "hybrid"])
@pytest.mark.parametrize(("text", "question", "options"), MEASURES)
def test_values_do_not_depend_on_threads(text, question, options, engine):
    values = set()
    for count in (1, 2, 3):
        model = symcheck.loads(text, engine=engine, threads=count, **options)
        result = model.check(question)
        values.add((str(result.value), str(result.accuracy), result.values.lower.tobytes()))
    assert len(values) == 1


def test_representatives_of_orbits_do_not_depend_on_threads(counts):
    results = set()
    for count in (1, 2):
        model = symcheck.loads(SYMMETRIC, engine="explicit", threads=count, symmetry=True)
        result = model.check("P=? [ F<=3 " + "&".join(f"b{i}>3" for i in range(12)) + " ]")
        results.add((str(result.value), str(result.accuracy), len(result.values.lower)))
    assert len(results) == 1
    assert set(counts) == {2}


def test_small_models_make_no_threads(monkeypatch):
    monkeypatch.undo()
    before = threading.active_count()
    started = []
    monkeypatch.setattr(threading.Thread, "start", lambda thread: started.append(thread))
    model = symcheck.loads(DTMC, engine="explicit", threads=3)
    assert model.check('P=? [ F<=3 "all" ]').value >= 0
    assert (started, threading.active_count()) == ([], before)


def test_the_time_limit_ends_threads():
    model = symcheck.loads(MDP, engine="explicit", threads=2, time_limit=0.1)
    before, started = threading.active_count(), time.monotonic()
    with pytest.raises(TimeLimitError):
        model.check("Rmax=? [ C<=99999 ]")
    assert time.monotonic() - started < 30  # at once on an idle machine, and not hours
    assert threading.active_count() == before


def test_by_default_there_is_a_thread_per_processor():
    assert default_count() == min(processors(), 4)
    with use_threads(7), use_threads():
        assert thread_count() == 7
    others = []
    thread = threading.Thread(target=lambda: others.append(default_count()))
    thread.start()
    thread.join()
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        others.append(pool.submit(default_count).result())
    assert others == [1, 1]


def default_count() -> int:
    with use_threads():
        return thread_count()


def test_a_team_shares_what_is_left_and_needs_no_helper_to_begin() -> None:
    """Also where all helpers are busy, this thread does all of it."""
    with use_threads(2):
        free = threading.Event()
        busy = helpers().submit(free.wait)
        claimed, done = iter(range(100)), list[int]()
        on_team(lambda: done.extend(claimed), 4)
        assert sorted(done) == list(range(100))
        free.set()
        assert busy.result()
