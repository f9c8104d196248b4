"""`check_many`: many tasks, each with its model, properties, constants and options."""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import count, islice, pairwise
from pathlib import Path

import pytest

import symcheck
from symcheck.errors import UsageError

COIN = """dtmc const int N; module m x : [0..N+1];
  [] x=0 -> 1/2 : (x'=1) + 1/2 : (x'=2); endmodule"""
DIE = Path(__file__).parents[2] / "models" / "die" / "die.pm"


def test_each_task_has_the_rows_of_its_experiment() -> None:
    tasks = [
        symcheck.Check(COIN, "P=? [ F x=1 ]; P=? [ F x=2 ]", "N=1:3"),
        (DIE, DIE.with_suffix(".pctl")),
        (symcheck.load(DIE), "P=? [ F d=6 ]", None, {"exact": True}),
    ]
    together = list(symcheck.check_many(tasks))
    alone = [
        symcheck.experiment(COIN, "P=? [ F x=1 ]; P=? [ F x=2 ]", "N=1:3"),
        symcheck.experiment(DIE, DIE.with_suffix(".pctl")),
        symcheck.experiment(symcheck.load(DIE), "P=? [ F d=6 ]", exact=True),
    ]
    for many, one in zip(together, alone, strict=True):
        assert [(r.name, r.constants, r.value) for r in many] == [
            (r.name, r.constants, r.value) for r in one
        ]


def test_a_faulty_task_is_a_row_and_the_others_go_on() -> None:
    tasks = [
        ("missing.pm", "P=? [ F x=1 ]"),
        ("dtmc modul", "P=? [ F x=1 ]"),
        (COIN, "P=? [ F x=1", "N=1"),
        (COIN, "P=? [ F x=1 ]"),
        (COIN, "P=? [ F y=1 ]; P=? [ F x=1 ]", "N=1"),
    ]
    answers = [[row.error or row.value for row in rows] for rows in symcheck.check_many(tasks)]
    assert [len(rows) for rows in answers] == [1, 1, 1, 1, 2]
    for rows, text in zip(
        answers, ("no such file", "modul", "missing", "no value", "y"), strict=True
    ):
        assert text in str(rows[0]).lower()
    assert answers[4][1] == 0.5


def test_tasks_are_read_when_they_are_done() -> None:
    taken = []

    def tasks() -> Iterator[tuple[str, str, str]]:
        for n in count(1):
            taken.append(n)
            yield COIN, "P=? [ F x=1 ]", f"N={n}"

    assert [rows[0].value for rows in islice(symcheck.check_many(tasks()), 3)] == [0.5] * 3
    assert taken == [1, 2, 3]


def test_options_of_a_task_replace_those_of_all() -> None:
    tasks = [(COIN, "P=? [ F x=1 ]", "N=1"), (COIN, "P=? [ F x=1 ]", "N=1", {"exact": False})]
    exact, inexact = (rows[0].value for rows in symcheck.check_many(tasks, exact=True))
    assert (type(exact).__name__, type(inexact)) == ("Fraction", float)


def test_an_executor_gives_the_results_in_the_order_of_the_tasks() -> None:
    tasks = [
        (COIN, "R=? [ I=0 ]; P=? [ F x=1 ]" if n == 2 else "P=? [ F x>N ]", f"N={n}")
        for n in range(1, 5)
    ]
    with ThreadPoolExecutor(2) as executor:
        many = [[r.value for r in rows] for rows in symcheck.check_many(tasks, executor=executor)]
    assert many == [[r.value for r in rows] for rows in symcheck.check_many(tasks)]


@pytest.mark.parametrize("task", ["model.pm", (COIN,), [COIN, "P=? [ F x=1 ]"], (1, 2, 3, 4, 5)])
def test_a_task_of_another_form_is_an_error(task: object) -> None:
    with pytest.raises(UsageError, match="a task of check_many is a tuple"):
        list(symcheck.check_many([task]))  # type: ignore[list-item]


def test_wrong_options_are_an_error_before_the_first_task() -> None:
    with pytest.raises(UsageError):
        symcheck.check_many([], engine="fast")  # type: ignore[arg-type]
    with pytest.raises(UsageError):
        symcheck.check_many([], jobs=0)


@pytest.mark.parametrize("engine", ["explicit", "hybrid"])
def test_memory_does_not_grow_with_the_tasks(engine: symcheck.options.EngineName) -> None:
    tasks = ((COIN, "P=? [ F x=1 ]; Q=? [ F x=1 ]", "N=1") for _ in range(80))
    sizes = []
    tracemalloc.start()
    try:
        for number, _ in enumerate(symcheck.check_many(tasks, engine=engine), 1):
            if number % 10 == 0:
                sizes.append(_kept())
    finally:
        tracemalloc.stop()
    # Python keeps some bytes at first, and its tables grow at times. A task takes far more.
    growth = sorted(after - before for before, after in pairwise(sizes))
    assert growth[len(growth) // 2] < 10 * 2000


def _kept() -> int:
    """Bytes that are alive after the garbage collection."""
    import gc

    gc.collect()
    return tracemalloc.get_traced_memory()[0]


def test_a_property_that_does_not_follow_the_grammar_has_a_row_of_its_own() -> None:
    text = "P=? [ F x=1 ]; P=? [ F x=1 ; x=0"
    [results] = symcheck.check_many([(COIN, text, "N=1")])
    assert [(row.value, row.error is None) for row in results] == [
        (0.5, True),
        (True, True),
        (None, False),
    ]
    assert "']' is missing" in (results[2].error or "")
