"""What is written and read again has the same answers: random models of all types, on engines of all kinds."""

from __future__ import annotations

import io
import os
import re
from math import isclose
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import symcheck
from exchange.models import some_model
from generate import random_property
from symcheck.errors import NumericalError, SymcheckError, UsageError
from symcheck.exchange.explicit_export import explicit_export
from symcheck.exchange.export import export, parse_target
from symcheck.exchange.text import write_text
from symcheck.syntax.ast import ModelType

KINDS = ("dtmc", "ctmc", "mdp")


def exported(model, target):
    """Write with the API; the folder may be a temporary one."""
    return symcheck.export(model, str(target))


@settings(max_examples=80, deadline=None)
@given(
    seed=st.integers(0, 10**9),
    kind=st.sampled_from(KINDS),
    engine=st.sampled_from(["explicit", "sparse", "hybrid", "mtbdd"]),
)
def test_answers_survive_a_round_trip(seed, kind, engine, tmp_path_factory):
    rng = Random(seed)
    generated = some_model(rng, kind)
    model = symcheck.loads(generated.text, engine="explicit")
    folder = tmp_path_factory.mktemp("trip")
    exported(model, folder / "m.all")
    again = symcheck.load_explicit(str(folder / "m.all"), type=ModelType(kind), engine=engine)
    assert again.engine.states == model.engine.states
    assert again.engine.transitions == model.engine.transitions
    assert again.engine.choices == model.engine.choices
    for _ in range(6):
        formula = random_property(rng, generated)
        try:
            expected = model.check(formula).value
        except SymcheckError:
            continue
        try:
            found = again.check(formula).value
        except NumericalError:
            # The digits of the file round the probabilities: a threshold that is the value cannot
            # be decided, and is not guessed.
            compares = isinstance(expected, bool) or re.search(r"[PRST](min|max)?[<>]", formula)
            assert compares, (formula, expected)
            continue
        assert _near(found, expected), (formula, found, expected)


def _near(found, expected):
    if isinstance(expected, tuple):
        return all(map(_near, found, expected))
    return found == expected or isclose(found, expected, rel_tol=3e-6, abs_tol=1e-12)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**9), kind=st.sampled_from(KINDS))
def test_every_engine_writes_the_same(seed, kind):
    text = some_model(Random(seed), kind).text
    found = {}
    for engine in ("explicit", "sparse", "mtbdd", "exact"):
        options = {"exact": True} if engine == "exact" else {"engine": engine}
        out = io.StringIO()
        names = ["a", "b"]
        model = symcheck.loads(text, **options)
        built = model.engine
        found[engine] = explicit_export(
            built, names, lambda n, m=model: m.engine.where(m.bound.labels[n])
        )
        list(export(found[engine], parse_target("stdout.sta,lab", "m"), out))
        found[engine, "text"] = out.getvalue()
    first = found["explicit"]
    for engine in ("sparse", "mtbdd", "exact"):
        other = found[engine]
        assert found[engine, "text"] == found["explicit", "text"]
        assert sorted(_choices(other)) == sorted(_choices(first))


def _choices(model):
    """State, action, successors and reward of each row, numbers rounded."""
    m = model.matrix
    for r, state in enumerate(model.state_of_row.tolist()):
        i, j = m.indptr[r], m.indptr[r + 1]
        values = tuple(round(float(x), 9) for x in model.values[i:j])
        action = -1 if model.row_actions is None else int(model.row_actions[r])
        name = "" if action < 0 else model.actions[action]
        yield (
            state,
            name,
            tuple(m.indices[i:j].tolist()),
            values,
            tuple(round(float(x.rows[r]), 9) for x in model.rewards),
        )


def test_states_in_another_order_are_put_in_order():
    model = symcheck.loads(some_model(Random(3), "mdp").text)
    whole = explicit_export(model.engine)
    from symcheck.exchange.explicit_export import _permuted, _sorted

    order = np.arange(whole.n)[::-1]
    mixed = _permuted(whole, order)
    assert whole.n > 1
    assert not np.array_equal(mixed.columns[0], whole.columns[0])
    back = _sorted(mixed, np.lexsort(mixed.columns[::-1]))
    for a, b in zip(back.columns, whole.columns, strict=True):
        assert np.array_equal(a, b)
    assert np.array_equal(back.matrix.indptr, whole.matrix.indptr)
    assert np.array_equal(back.matrix.indices, whole.matrix.indices)
    assert np.array_equal(back.values, whole.values)
    assert np.array_equal(back.matrix.groups, whole.matrix.groups)


@pytest.mark.parametrize("kind", KINDS)
def test_a_model_without_states_file_has_one_variable(kind, tmp_path):
    model = symcheck.loads(some_model(Random(11), kind).text)
    exported(model, tmp_path / "m.tra,lab")
    again = symcheck.load_explicit(str(tmp_path / "m.tra,lab"), type=ModelType(kind))
    assert [v.name for v in again.bound.variables] == ["x"]
    direction = "max" if kind == "mdp" else ""
    formula = f'P{direction}=? [ F "a" ]'
    assert _near(again.check(formula).value, model.check(formula).value)
    assert again.check(f"filter(count, x<{model.engine.states})").value == model.engine.states


def test_a_ctmc_whose_rates_sum_to_1_stays_one(tmp_path):
    model = symcheck.loads(
        "ctmc module m x:[0..1]; [] x=0 -> 1:(x'=1); [] x=1 -> 1:(x'=0); endmodule"
    )
    exported(model, tmp_path / "m.all")
    again = symcheck.load_explicit(str(tmp_path / "m.all"))
    assert again.engine.model.type is ModelType.CTMC
    assert _near(again.check("P=? [ F<=1 x=1 ]").value, model.check("P=? [ F<=1 x=1 ]").value)
    exported(model, f"{tmp_path / 'n.tra'}:headers=false")
    assert (tmp_path / "n.tra").read_text().startswith("2 2\n")


def test_what_is_no_plain_file_is_written_to_and_not_replaced(tmp_path):
    (tmp_path / "real.txt").write_text("before")
    (tmp_path / "link.txt").symlink_to(tmp_path / "real.txt")
    write_text(str(tmp_path / "link.txt"), ["after"], io.StringIO())
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real.txt").read_text() == "after"
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    write_text(str(tmp_path / "pipe"), ["through"], io.StringIO())
    assert os.read(reader, 100) == b"through"
    os.close(reader)
    assert (tmp_path / "pipe").is_fifo()
    with pytest.raises(UsageError, match="cannot write"):
        write_text(str(tmp_path), ["a folder"], io.StringIO())


def test_thresholds_on_rounded_numbers_are_decided_as_before(tmp_path):
    text = "dtmc module m x:[0..3]; [] x=0 -> 1/3:(x'=1)+1/3:(x'=2)+1/3:(x'=3); [] x>0 -> true; endmodule"
    model = symcheck.loads(text)
    exported(model, tmp_path / "m.all")
    again = symcheck.load_explicit(str(tmp_path / "m.all"))
    for formula in (
        "P>=1/3 [ F x=1 ]",
        "P>1/3 [ F x=1 ]",
        "P<=1/3 [ F x=1 ]",
        "P>=2/3 [ F x<3&x>0 ]",
    ):
        assert again.check(formula).value == model.check(formula).value == (">1/3" not in formula)
    exact = symcheck.load_explicit(str(tmp_path / "m.all"), exact=True)
    assert str(exact.check("P=? [ F x=1 ]").value) == "1/3"


def test_a_threshold_on_numbers_that_are_no_distribution_is_left_open(tmp_path):
    rounded = "0.333333333333333", "0.666666666666666"
    (tmp_path / "m.tra").write_text("3 4\n0 1 {}\n0 2 {}\n1 1 1\n2 2 1\n".format(*rounded))
    model = symcheck.load_explicit(str(tmp_path / "m.tra"))
    with pytest.raises(SymcheckError, match="do not sum to 1 exactly"):
        model.check(f"P>={rounded[0]} [ F x=1 ]")


def test_paths_along_the_rows(tmp_path):
    (tmp_path / "m.tra").write_text("2 2\n0 1 1\n1 1 1\n")
    model = symcheck.load_explicit(str(tmp_path / "m.tra"))
    assert [step.state for step in model.simulate(2)] == [(0,), (1,), (1,)]
    assert model.estimate("P=? [ F x=1 ]", samples=100).value == 1


def test_other_options_keep_the_states(tmp_path):
    (tmp_path / "m.tra").write_text("2 2\n0 1 1\n1 1 1\n")
    model = symcheck.load_explicit(str(tmp_path / "m.tra"))
    assert model.with_options(epsilon=1e-9).check("P=? [ F x=1 ]").value == 1
    assert model.with_options(exact=True).engine.is_rational
