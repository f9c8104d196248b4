"""Relations computed on the fly against full encoding, and where full encoding is impossible."""

from __future__ import annotations

import pytest

from symbolic.oracle import assert_same, bound, explore, states_of
from symbolic.test_build import MODELS
from symcheck.errors import ModelFault
from symcheck.options import Options
from symcheck.symbolic.build import build
from symcheck.symbolic.matrix.transitions import transitions
from symcheck.symbolic.reachability.search import reach, search
from symcheck.symbolic.tuning import EncodingLimits

NOTHING = EncodingLimits(table_bits=0, wide_table_bits=0, max_nodes=0, max_leaves=0)

WIDE = """dtmc
module walk
  p : [0..3];
  a : [0..1000000] init 17; b : [0..1000000] init 5; c : [0..1000000];
  [] p=0 -> 0.5 : (c'=mod(floor(1.7*a)+3*b,5)) & (p'=1) + 0.5 : (c'=mod(a*b+c,6)) & (p'=1);
  [] p=1 -> (a'=b) & (p'=2);
  [] p=2 & mod(a*b+c,17)!=0 -> (c/8)/2 : (b'=c) & (p'=0) + 1-(c/8)/2 : (b'=mod(a+b+c,7)) & (p'=0);
  [] p=2 & mod(a*b+c,17)=0 -> (p'=3);
endmodule
"""


@pytest.mark.parametrize("name", MODELS)
def test_on_the_fly_and_full_encoding_agree(name):
    model = bound(MODELS[name])
    made = build(model, Options(), limits=NOTHING)
    assert any(e.evaluated is not None for e in made.events)
    space = reach(made)
    assert_same(model, transitions(space, Options()))


def test_a_domain_beyond_tables_needs_the_reached_valuations_only():
    model = bound(WIDE)
    made = build(model, Options())
    assert any(e.evaluated is not None for e in made.events)
    space = reach(made)
    expected = explore(model)
    assert set(states_of(space)) == set(expected)
    assert_same(model, transitions(space, Options()))
    evaluated = sum(part.evaluated for part in space.symbolic.translator.on_the_fly.values())
    assert evaluated < 20 * len(expected)


def test_an_update_out_of_range_on_the_fly_is_reported():
    text = "dtmc module m a : [0..1000000] init 1; b : [0..1000000] init 1; c : [0..100]; [] true -> (c'=a*b+c) & (a'=a*2+b); endmodule"
    space = reach(build(bound(text), Options()))
    with pytest.raises(ModelFault, match="c would become") as caught:
        transitions(space, Options())
    assert [d.code for d in caught.value.diagnostics] == ["update-range"]


def test_only_breadth_first_search_works_on_the_fly():
    with pytest.raises(ValueError, match="frontier"):
        list(search(build(bound(WIDE), Options()), "chaining"))


def test_updates_behind_a_guard_known_from_another_event_are_evaluated():
    # The condition b is known from the initial states before the command was ever encoded behind
    # it.
    model = bound(
        "mdp module m b : bool; x : [0..2]; [] b -> (x'=floor(x/2)); endmodule init b endinit"
    )
    assert_same(model, transitions(reach(build(model, Options(), limits=NOTHING)), Options()))
