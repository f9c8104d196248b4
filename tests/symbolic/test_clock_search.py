"""Clock search finds the same states as saturation, and alternation ends with either of them."""

from __future__ import annotations

import symcheck
from symcheck.options import Options
from symcheck.symbolic.build import build
from symcheck.symbolic.model import SymbolicModel
from symcheck.symbolic.reachability.clock_search import (
    ClockSearch,
    alternate,
    apply_clocks,
    clock_relations,
    start_clock_search,
)
from symcheck.symbolic.reachability.search import choose_schedule, prepare_saturation, reach

_STATION = """
module station1
  s1 : [0..3]; x1 : [0..7]; c1 : [0..5];
  [tick] s1<3 & x1<7 -> (x1'=x1+1)&(c1'=max(c1-1,0));
  [tick] s1=3 -> (x1'=0);
  [] s1=0 & x1>2 -> 0.5:(s1'=1)&(c1'=0) + 0.5:(s1'=1)&(c1'=c1);
  [] s1=1 & c1<5 -> (c1'=c1+1);
  [back] s1=1 & c1=5 -> (s1'=2);
  [] s1=2 & x1>5 -> (s1'=3)&(x1'=0);
endmodule
module station2=station1[s1=s2,x1=x2,c1=c2] endmodule
module station3=station1[s1=s3,x1=x3,c1=c3] endmodule
"""


def _model(text: str) -> SymbolicModel:
    return build(symcheck.bind(symcheck.parse_model(text)), Options())


def _timed() -> SymbolicModel:
    return _model("mdp" + _STATION)


def test_a_clock_changes_more_than_half_of_the_variables() -> None:
    model = _model(
        "mdp module a x:[0..3]; y:[0..3]; z:[0..3]; [] x<3 -> (x'=x+1); [] true -> (x'=0)&(y'=1)&(z'=2); endmodule"
    )
    assert [len(r.touched) for r in clock_relations(model)] == [3]
    assert choose_schedule(model) == "alternating"


def test_there_is_no_clock_where_all_relations_change_most_variables() -> None:
    model = _model("mdp module a x:[0..3]; [] x<3 -> (x'=x+1); endmodule")
    assert clock_relations(model) == ()
    assert choose_schedule(model) == "saturation"


def test_clock_search_finds_the_states_of_saturation() -> None:
    model = _timed()
    by_clock, saturated = (reach(model, schedule=s) for s in ("clock", "saturation"))
    assert by_clock.states == saturated.states
    assert (by_clock.schedule, saturated.schedule) == ("clock", "saturation")


def test_states_of_a_step_are_closed_under_the_local_relations() -> None:
    model = _timed()
    search, steps = start_clock_search(model), 0
    local = [r for r in model.relations if r not in clock_relations(model)]
    while not search.complete:
        following = apply_clocks(model, search)
        assert isinstance(following, ClockSearch)
        assert following.frontier.disjoint(search.states)
        assert all(r.image(following.states) <= following.states for r in local)
        search, steps = following, steps + 1
    assert steps > 3


def test_alternation_goes_on_where_it_stopped_and_names_the_schedule_that_ended() -> None:
    expected = reach(_timed(), schedule="saturation")
    count = expected.count
    for budgets, winner in [
        (((1, 1),), {"clock", "saturation"}),
        (((1, 10**9),), {"clock"}),
        (((10**9, 1),), {"saturation"}),
    ]:
        model = _timed()
        found = list(alternate(model, prepare_saturation(model), budgets))
        assert model.manager.count(found[-1].states, model.encoding.rows) == count
        assert found[-1].complete
        assert not any(t.complete for t in found[:-1])
        assert found[-1].schedule in winner
        new = [model.initial, *(t.frontier for t in found)]
        assert sum(model.manager.count(f, model.encoding.rows) for f in new) == count
