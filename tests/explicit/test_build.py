"""Exploration against the scalar semantics, on random small models."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from explicit.models import models
from symcheck.errors import InputError, Interrupted, MemoryLimitError, ModelFault, TimeLimitError
from symcheck.explicit.build import Exploration, explore
from symcheck.explicit.states import StateLayout
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind
from symcheck.semantics.interpreter import initial_states, state_rewards, transitions
from symcheck.semantics.model import Variable
from symcheck.syntax.ast import Type
from symcheck.syntax.parse import parse_expression, parse_model, parse_model_file

MODELS = Path(__file__).parents[2] / "models"


def _scalar(model):
    """States, their rows, and deadlocks, by the scalar semantics; breadth first, as the compiled search does it."""
    initial = initial_states(model)
    known, rows = dict.fromkeys(initial), {}
    queue = list(initial)
    for state in queue:
        rows[state] = transitions(model, state)
        for row in rows[state]:
            for _, successor in row.branches:
                if successor not in known:
                    known[successor] = None
                    queue.append(successor)
    for state in sorted(known):
        state_rewards(model, state)
    return initial, rows


def _bound(text):
    try:
        return bind(parse_model(text))
    except InputError:  # such as 1/0 in a constant expression
        return None


@settings(max_examples=150, deadline=None)
@given(models())
def test_exploration_agrees_with_the_scalar_semantics(text):
    model = _bound(text)
    if model is None:
        return
    try:
        initial, rows = _scalar(model)
    except ModelFault as fault:
        event("fault")
        expected = str(fault)
        with pytest.raises(ModelFault) as found:
            explore(model, Options())
        assert str(found.value) == expected
        return
    result = explore(model, Options())
    _compare(model, result, initial, rows)


def _compare(model, result, initial, rows):
    states = sorted(rows)
    assert list(result.states) == states
    number = {s: i for i, s in enumerate(states)}
    assert result.initial.tolist() == sorted(number[s] for s in initial)
    assert result.deadlocks.tolist() == [i for i, s in enumerate(states) if not rows[s]]
    matrix = result.matrix
    groups = np.arange(matrix.rows + 1) if matrix.groups is None else matrix.groups
    assert len(groups) == len(states) + 1
    for i, state in enumerate(states):
        mine = range(groups[i], groups[i + 1])
        wanted = rows[state]
        if not wanted:
            assert len(mine) == 1
            assert _row(matrix, mine[0]) == {i: 1.0}
            assert result.choice_actions[mine[0]] == -1
            continue
        assert len(mine) == len(wanted)
        for r, row in zip(mine, wanted, strict=True):
            assert _row(matrix, r) == pytest.approx(
                {number[s]: p for p, s in row.branches}, rel=1e-12
            )
            assert result.choice_actions[r] == (
                -1 if row.action is None else model.actions.index(row.action)
            )
            assert [c[r] for c in result.choice_rewards] == pytest.approx(
                [float(x) for x in row.rewards], rel=1e-12
            )
        assert [s[i] for s in result.state_rewards] == pytest.approx(
            [float(x) for x in state_rewards(model, state)], rel=1e-12
        )


def _row(matrix, r):
    columns = matrix.indices[matrix.indptr[r] : matrix.indptr[r + 1]].tolist()
    assert columns == sorted(set(columns))
    return dict(
        zip(columns, matrix.data[matrix.indptr[r] : matrix.indptr[r + 1]].tolist(), strict=True)
    )


COUNTER = """dtmc
const int N;
module c
  x : [0..N] init 0;
  y : int init 0;
  [] x<N -> 0.5:(x'=x+1)&(y'=y-3) + 0.5:(x'=x+1)&(y'=y+5);
endmodule
"""


def _explore(text, constants=None, **options):
    return explore(bind(parse_model(text), constants or {}), Options(**options))


def test_die():
    result = explore(bind(parse_model_file(MODELS / "die" / "die.pm"), {}), Options())
    assert len(result.states) == 13
    assert result.matrix.entries == 20
    assert result.levels == 4
    assert "dtmc: 13 states (1 initial), 20 transitions" in repr(result)
    assert list(result.states)[12] == (7, 6)
    assert result.evaluate(parse_expression("s=7 & d>3")).tolist() == [False] * 10 + [True] * 3


def test_unbounded_variables_where_the_states_are_finite():
    result = _explore(COUNTER, {"N": 20})
    assert len(result.states) == 21 * 22 // 2
    assert result.states.column(1).min() == -60
    assert result.states.column(1).max() == 100


def test_an_unbounded_variable_that_grows_for_ever():
    with pytest.raises(ModelFault, match="leaves 32 bits"):
        _explore("dtmc\nmodule c\n x : int init 1;\n [] true -> (x'=3*x);\nendmodule")


def test_deadlocks_as_errors_name_states():
    with pytest.raises(ModelFault, match=r"3 states have no transition.*\(x=2,y=-6\)"):
        _explore(COUNTER, {"N": 2}, fix_deadlocks=False)


def test_sums_may_be_left_unchecked():
    text = "dtmc\nmodule c\n x : [0..1];\n [] true -> 0.5:(x'=1);\nendmodule"
    with pytest.raises(ModelFault, match=r"probabilities sum to 0.5"):
        _explore(text)
    assert _explore(text, check_sums=False).matrix.data.tolist() == [0.5, 0.5]


def test_a_fault_of_an_update_counts_only_if_its_partners_are_possible():
    text = """ctmc
module a
  x : [0..1];
  [go] true -> 1:(x'=x+1);
endmodule
module b
  y : [0..1];
  [go] true -> (1-x):(y'=1);
endmodule
"""
    result = _explore(text)
    assert list(result.states) == [(0, 0), (1, 1)]
    assert result.deadlocks.tolist() == [1]


def test_stop_and_resume_gives_the_same_model():
    model = bind(parse_model(COUNTER), {"N": 100})
    whole = explore(model, Options())
    exploration = Exploration(model, Options())
    budgets = []
    while not exploration.run(state_budget=len(exploration.rows()) + 500):
        budgets.append(exploration.progress.states)
        assert len(exploration.rows()) == exploration.progress.states
    assert len(budgets) > 5
    parts = exploration.finish()
    assert (parts.states.rows == whole.states.rows).all()
    assert (parts.matrix.indices == whole.matrix.indices).all()


def test_seed_states_are_explored_too_and_change_nothing():
    model = bind(parse_model(COUNTER), {"N": 50})
    whole = explore(model, Options())
    seeded = explore(model, Options(), seed=whole.states.rows[7::3])
    assert (seeded.states.rows == whole.states.rows).all()
    assert (seeded.matrix.data == whole.matrix.data).all()
    assert seeded.initial.tolist() == whole.initial.tolist()


def test_limits_keep_what_was_found():
    model = bind(parse_model(COUNTER), {"N": 3000})
    limited = Exploration(model, Options(time_limit=0.05))
    with pytest.raises(TimeLimitError, match="states"):
        limited.run()
    assert limited.progress.states > 1000
    with pytest.raises(
        MemoryLimitError, match=r"(?s)memory limit of 1 MB.*has reached.*-cuddmaxmem"
    ):
        explore(model, Options(max_memory=1_000_000))


def test_observer_and_interrupt():
    model = bind(parse_model(COUNTER), {"N": 2000})
    seen = []
    exploration = Exploration(model, Options())

    def observe(progress):
        seen.append(progress)
        raise KeyboardInterrupt

    with pytest.raises(Interrupted):
        exploration.run(observer=observe)
    assert exploration.run(observer=seen.append)
    assert seen[-1].frontier == 0
    assert "M states/s" in str(seen[-1])


def test_init_with_many_states():
    text = "mdp\nmodule m\n x : [0..9];\n b : bool;\n y : [0..1000];\n [] x>0 -> (x'=x-1);\nendmodule\ninit x+y=9 & (b | x=3) & y<8 endinit"
    result = _explore(text)
    assert [result.states.row(i) for i in result.initial] == [
        (x, b, 9 - x) for x in range(2, 10) for b in (False, True) if b or x == 3
    ]


def test_init_without_states():
    with pytest.raises(ModelFault, match="no state satisfies"):
        _explore("mdp\nmodule m\n x : [0..9];\nendmodule\ninit x>3 & x<2 endinit")


def test_init_over_a_huge_domain_that_a_conjunct_fixes():
    result = _explore(
        "mdp\nmodule m\n x : [0..1000000000000];\n y : [0..3];\nendmodule\ninit x=7 & y<2 endinit"
    )
    assert list(result.states) == [(7, 0), (7, 1)]


@pytest.mark.parametrize("last", [60000, 70000])
def test_many_distinct_probabilities(last):
    """Fewer and more than two bytes can number."""
    result = _explore(
        f"dtmc\nmodule m\n x : [0..{last}];\n [] x<{last} -> x/{last}:(x'=x+1) + 1-x/{last}:(x'=0);\nendmodule\ninit true endinit"
    )
    x = np.arange(1, last)
    expected = np.stack([(last - x) / last, x / last], axis=1)
    np.testing.assert_allclose(result.matrix.data[1:-1].reshape(-1, 2), expected, rtol=1e-11)
    assert result.matrix.indices[1:-1].reshape(-1, 2)[:, 1].tolist() == list(range(2, last + 1))


def test_wide_rows_merge_duplicates():
    command = "[go] true -> 0.5:(x{0}'=true) + 0.5:(x{0}'=true&!x{1});"
    modules = "\n".join(
        f"module m{i}\n x{i} : bool;\n {command.format(i, (i + 1) % 7)}\nendmodule"
        for i in range(7)
    )
    result = _explore("dtmc\n" + modules)
    model = bind(parse_model("dtmc\n" + modules))
    initial, rows = _scalar(model)
    assert max(np.diff(result.matrix.indptr)) > 50
    _compare(model, result, initial, rows)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.integers(-(2**40), 2**40), st.integers(0, 62)), min_size=1, max_size=6)
)
def test_layout_is_lossless_and_ordered(ranges):
    variables = tuple(
        Variable(f"x{i}", Type.INT, low, low + (1 << bits) - 1, low, "m")
        for i, (low, bits) in enumerate(ranges)
    )
    layout = StateLayout.of(variables)
    rng = np.random.default_rng(0)
    columns = [rng.integers(v.low, v.high, 50, endpoint=True) for v in variables]
    rows = layout.pack(columns)
    assert all((layout.column(rows, i) == c).all() for i, c in enumerate(columns))
    tuples = list(zip(*(c.tolist() for c in columns), strict=True))
    assert [layout.unpack(r) for r in rows] == tuples
    assert sorted(tuples) == [tuples[i] for i in np.lexsort(rows.T[::-1])]
