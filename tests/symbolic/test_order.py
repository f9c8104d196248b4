"""Orders of the variables: by name, or found."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from symbolic.oracle import assert_same, bound, symbolic
from symcheck.errors import UsageError
from symcheck.options import Options
from symcheck.symbolic.build import build
from symcheck.symbolic.ordering.order import force, total_span, variable_order
from symcheck.symbolic.reachability.search import reach

edges_of = st.lists(
    st.lists(st.integers(0, 9), min_size=1, max_size=4, unique=True).map(np.array), max_size=12
)


def partners(n: int) -> str:
    """Variables x0 … and y0 … declared apart, where xi and yi become 1 together."""
    first = "\n".join(
        f"module a{i} x{i} : [0..1]; [m{i}] x{i}=0 -> (x{i}'=1); endmodule" for i in range(n)
    )
    second = "\n".join(
        f"module b{i} y{i} : [0..1]; [m{i}] y{i}=0 -> (y{i}'=1); endmodule" for i in range(n)
    )
    return f"mdp\n{first}\n{second}"


@given(edges_of)
def test_a_found_order_is_a_permutation_and_never_worse(edges):
    order = force(edges, 10)
    assert sorted(order) == list(range(10))
    place = np.empty(10)
    place[order] = np.arange(10)
    assert total_span(edges, place) <= total_span(edges, np.arange(10, dtype=float))


def test_partners_are_brought_together():
    model = bound(partners(12))
    as_declared = reach(build(model, Options()))
    found = reach(build(model, Options(order=("force",))))
    assert found.count == as_declared.count == 2**12
    assert found.states.node_count < 100 < 2**12 < as_declared.states.node_count


def test_the_order_of_the_options_is_taken():
    model = bound(partners(2))
    made = symbolic(model, order=["y1", "x0"])
    assert_same(model, made)
    assert [v.name for v in build(model, Options(order=("y1", "x0"))).encoding.ordered] == [
        "y1",
        "x0",
        "x1",
        "y0",
    ]


def test_names_that_no_variable_has_are_refused():
    with pytest.raises(UsageError, match="no such variable"):
        variable_order(bound(partners(2)), ["z"])


def test_a_variable_may_be_called_force():
    model = bound("dtmc module m a : bool; force : bool; [] true -> (a'=force); endmodule")
    assert variable_order(model, ["force"]) == ("force",)


def test_spans_add_up_how_far_members_are_apart():
    edges = [np.array([0, 2, 4]), np.array([], dtype=np.int64), np.array([3]), np.array([1, 4])]
    place = np.array([5.0, 1.0, 0.0, 2.0, 3.0])
    assert total_span(edges, place) == 5.0 + 0.0 + 2.0
    assert total_span([], place) == 0.0
