"""Search by ticks: what changes little is closed at once, what changes most of the state goes step by step."""

from __future__ import annotations

import symcheck
from symcheck.options import Options
from symcheck.symbolic.build import build
from symcheck.symbolic.model import SymbolicModel
from symcheck.symbolic.reachability.clock_search import Front, advance, begin, clocks, turns
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


def test_a_clock_is_what_changes_more_than_half_of_the_variables() -> None:
    model = _model(
        "mdp module a x:[0..3]; y:[0..3]; z:[0..3]; [] x<3 -> (x'=x+1); [] true -> (x'=0)&(y'=1)&(z'=2); endmodule"
    )
    assert [len(r.touched) for r in clocks(model)] == [3]
    assert choose_schedule(model) == "turns"


def test_where_everything_is_a_clock_there_is_none() -> None:
    model = _model("mdp module a x:[0..3]; [] x<3 -> (x'=x+1); endmodule")
    assert clocks(model) == ()
    assert choose_schedule(model) == "saturation"


def test_ticks_find_what_saturation_finds() -> None:
    model = _timed()
    by_ticks, saturated = (reach(model, schedule=s) for s in ("ticks", "saturation"))
    assert by_ticks.states == saturated.states
    assert (by_ticks.schedule, saturated.schedule) == ("ticks", "saturation")


def test_what_a_tick_finds_is_closed_under_the_rest() -> None:
    model = _timed()
    front, ticks = begin(model), 0
    local = [r for r in model.relations if r not in clocks(model)]
    while not front.done:
        following = advance(model, front)
        assert isinstance(following, Front)
        assert following.frontier.disjoint(front.states)
        assert all(r.image(following.states) <= following.states for r in local)
        front, ticks = following, ticks + 1
    assert ticks > 3


def test_turns_go_on_where_they_stopped_and_say_which_ended() -> None:
    expected = reach(_timed(), schedule="saturation")
    count = expected.count
    for budgets, winner in [
        (((1, 1),), {"ticks", "saturation"}),
        (((1, 10**9),), {"ticks"}),
        (((10**9, 1),), {"saturation"}),
    ]:
        model = _timed()
        found = list(turns(model, prepare_saturation(model), budgets))
        assert model.manager.count(found[-1].states, model.encoding.rows) == count
        assert found[-1].complete
        assert not any(t.complete for t in found[:-1])
        assert found[-1].schedule in winner
        new = [model.initial, *(t.frontier for t in found)]
        assert sum(model.manager.count(f, model.encoding.rows) for f in new) == count
