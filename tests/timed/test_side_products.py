"""What is asked for beside the value of a property of a timed automaton: shown, or refused by name."""

from __future__ import annotations

from pathlib import Path

import pytest

import symcheck
from symcheck.cli import main
from symcheck.errors import ModelFault, NoStrategyError, NotInResultError, UnsupportedError

RUNNING = str(Path(__file__).parents[2] / "models" / "timed" / "running.nm")

# Clocks are compared with numbers that they may equal, so that digital clocks decide it.
CLOSED = """pta
module m
  s : [0..3]; x : clock;
  invariant (s=0 => x<=2) & (s=1 => x<=3) endinvariant
  [a] s=0 & x>=1 -> 0.9 : (s'=1) & (x'=0) + 0.1 : (s'=2) & (x'=0);
  [b] s=1 & x>=2 -> 0.5 : (s'=0) & (x'=0) + 0.5 : (s'=3);
endmodule
label "late" = x>=2;
"""


@pytest.fixture
def closed(tmp_path):
    path = tmp_path / "closed.nm"
    path.write_text(CLOSED)
    return str(path)


FILES = [
    ("exportstrat", "out.txt", "no strategy: strategies are not available", "-ptamethod digital"),
    (
        "exportcounterexample",
        "out.txt",
        "no counterexample: counterexamples are not available",
        "-ptamethod digital",
    ),
    (
        "exportcertificate",
        "out.json",
        "no certificate: certificates are not available",
        "-ptamethod digital",
    ),
    ("exportvector", "out.txt", "-exportvector: the values are not those of the states", ""),
]


@pytest.mark.parametrize(("switch", "file", "refusal", "hint"), FILES)
@pytest.mark.parametrize("model", ["open", "closed"])
def test_zones_decide_a_property_and_refuse_what_is_told_by_states(
    switch, file, refusal, hint, model, closed, tmp_path, capsys
):
    name, bound = (
        (RUNNING, 'P<=0.3 [ F "target" ]') if model == "open" else (closed, "P<=0.3 [ F s=3 ]")
    )
    path = tmp_path / file
    assert main([name, "-pf", bound, "-ptamethod", "backwards", f"-{switch}", str(path)]) == 0
    printed = capsys.readouterr().out
    assert "Result: false" in printed
    assert refusal in printed
    assert hint in printed
    assert not path.exists()


@pytest.mark.parametrize(
    ("switch", "file"),
    [("exportpage", "out.html"), ("exporttrans", "out.tra"), ("exportdot", "out.dot")],
)
def test_what_needs_states_names_the_constraint_and_properties_are_checked(
    switch, file, tmp_path, capsys
):
    path = tmp_path / file
    formula = 'Pmax=? [ F "target" ]'
    assert main([RUNNING, "-pf", formula, f"-{switch}", str(path)]) == 1
    printed = capsys.readouterr().out
    assert f"running.nm:13:16: error[digital]: -{switch} needs states: digital clocks" in printed
    assert "-ptamethod backwards" not in printed
    assert "Result: 0.6 " in printed
    assert not path.exists()


@pytest.mark.parametrize("properties", [[], ["-pf", 'Pmax=? [ F "target" ]']])
@pytest.mark.parametrize("switch", ["exportjani", "exportmodel"])
def test_the_text_of_the_automaton_needs_no_states(switch, properties, tmp_path, capsys):
    path = tmp_path / "out.jani"
    assert main([RUNNING, *properties, f"-{switch}", str(path)]) == 0
    value = symcheck.load(path).check("Pmax=? [ F place=3 ]").value
    assert value == pytest.approx(0.6)
    other = tmp_path / "out.tra"
    path.unlink()
    assert main([RUNNING, *properties, f"-{switch}", str(path), "-exporttrans", str(other)]) == 1
    assert "-exporttrans needs states" in capsys.readouterr().out
    assert path.exists()
    assert not other.exists()


def test_results_by_zones_have_no_values_of_states():
    model = symcheck.loads(CLOSED, timed_method="backwards", strategy=True)
    number, truth = model.check("Pmax=? [ F s=3 ]"), model.check("P<=0.3 [ F s=3 ]")
    assert number.value == pytest.approx(9 / 11)
    with pytest.raises(NotInResultError, match=r"by zones\n.*-ptamethod digital"):
        _ = number.values
    with pytest.raises(NotInResultError, match="by zones"):
        _ = truth.satisfying
    with pytest.raises(NoStrategyError, match="not available for probabilistic timed automata by"):
        _ = number.strategy
    with pytest.raises(UnsupportedError, match="counterexamples are not available"):
        truth.counterexample()
    with pytest.raises(UnsupportedError, match="certificates are not available"):
        number.certificate()


def test_values_of_other_states_are_not_written_as_those_of_the_model(closed, tmp_path, capsys):
    vector, states = tmp_path / "out.txt", tmp_path / "out.sta"
    files = ["-exportvector", str(vector), "-exportstates", str(states)]
    assert main([closed, "-pf", "Pmax=? [ F<=5 s=1 ]", *files]) == 0
    assert "checked on 48 states of its own (digital clocks)" in capsys.readouterr().out
    assert not vector.exists()
    assert main([closed, "-pf", "Pmax=? [ F s=1 ]", *files]) == 0
    assert len(vector.read_text().splitlines()) == len(states.read_text().splitlines()) - 1


def test_a_page_draws_no_values_of_states_that_tell_more_of_a_clock():
    # In s=1 nothing compares x before it is reset, except for the first property.
    text = """pta
    module m
      s : [0..1]; x : clock;
      invariant s=0 => x<=4 endinvariant
      [] s=0 & x>=1 -> (s'=1) & (x'=0);
      [] s=1 -> (s'=0) & (x'=0);
    endmodule"""
    page = symcheck.loads(text).page("Pmax=? [ F s=1 & x>=2 ]; Pmax=? [ F s=1 ]")
    own, plain = page.data["properties"]
    assert (own["value"], own["show"]) == ("1.0", None)
    assert "other states: no picture" in own["detail"]
    assert plain["show"] is not None


def test_a_page_draws_the_values_of_its_own_states_only():
    page = symcheck.loads(CLOSED).page(
        "Pmax=? [ F s=1 & x>2 ]; Pmax=? [ F<=5 s=1 ]; Pmax=? [ F s=1 ]; Tmax=? [ F s=1 ]"
    )
    strict, bounded, plain, time = page.data["properties"]
    assert (strict["value"], strict["show"]) == ("0.9", None)
    assert "checked on 5 other states: no picture" in strict["detail"]
    assert bounded["show"] is None
    assert plain["show"] is not None
    assert time["value"] == "Infinity"
    assert not any("error" in str(frame) for show in page.data["shows"] for frame in show["frames"])


@pytest.mark.parametrize("method", ["digital", "backwards"])
def test_fair_strategies_are_refused_by_name(method):
    text = "pta module m s:[0..1]; x:clock; [g] s=0 & x>=1 -> (s'=1); endmodule"
    model = symcheck.loads(text, timed_method=method, fairness=True)
    with pytest.raises(UnsupportedError, match="fair strategies are not available for prob"):
        model.check("Pmin=? [ F s=1 ]")
    with pytest.raises(UnsupportedError, match="fair strategies are not available for prob"):
        model.check("P>=0.5 [ F s=1 ]")


# ------------------------------------------------------------------------------- what stops time


def stopped(text, method, formula="Pmax=? [ F s=1 ]"):
    with pytest.raises(ModelFault) as fault:
        symcheck.loads(text, timed_method=method).check(formula)
    return str(fault.value)


@pytest.mark.parametrize("method", ["digital", "backwards"])
def test_a_timelock_is_where_time_has_ended(method):
    text = """pta
module m s:[0..1]; x:clock; invariant s=0 => x<=20 endinvariant [] s=0 & x>=30 -> (s'=1); endmodule
module n t:[0..1]; y:clock; invariant t=0 => y<=40 endinvariant [] t=0 & y>=40 -> (t'=1); endmodule
"""
    told = stopped(text, method)
    assert told.startswith("<model>:2:39: error[timelock]: time stops: neither may it pass")
    assert "from state (s=0,x=20,t=0,y=20)\n" in told
    assert "^^^^^^^^^^^^\n  hint: let a command be enabled when the invariant ends" in told


def test_a_timelock_at_a_limit_that_is_excluded():
    text = "pta module m s:[0..1]; x:clock; invariant s=0 => x<2 endinvariant [] s=0 & x>=3 -> (s'=1); endmodule"
    told = stopped(text, "auto")
    assert "1:43: error[timelock]: time stops: it may pass up to a limit that is excluded" in told
    assert "from state (s=0,x=0)" in told


@pytest.mark.parametrize("method", ["digital", "backwards"])
def test_a_zeno_state_has_a_place_and_no_helpers(method):
    text = """pta module m s : [0..1]; x : clock; invariant s=0 => x<=0 endinvariant
      [] s=0 -> (s'=0) & (x'=0); [] s=1 -> (s'=0) & (x'=0); endmodule"""
    told = stopped(text, method, "Pmin=? [ F<=3 s=1 ]")
    assert "1:47: error[zeno]: time cannot go on for ever" in told
    assert "from state (s=0,x=0)\n" in told
    assert "hint: let time pass in each cycle of commands" in told


# --------------------------------------------------------------------- what has no digital clocks


def refused(text, formula, **options):
    with pytest.raises(UnsupportedError) as refusal:
        symcheck.loads(text, **options).check(formula)
    return str(refusal.value)


OPEN = "pta module m s:[0..1]; x:clock; invariant s=0 => x<=3 endinvariant [] s=0 & x>1 -> (s'=1); endmodule"


def test_expected_times_name_what_needs_zones():
    told = refused(OPEN, "Tmax=? [ F s=1 ]")
    assert "1:77: error[digital]: digital clocks cannot be used: this constraint on x does" in told
    assert "hint: zones, which would take it, do not give expected rewards and times" in told
    assert refused(OPEN, "Tmax=? [ F s=1 ]", timed_method="backwards") == told


def test_expected_times_by_zones_have_a_hint_where_digital_clocks_do():
    told = refused(CLOSED, "Tmin=? [ F s=3 ]", timed_method="backwards")
    assert "1:1: error[zones]: zones do not give expected rewards and times" in told
    assert "hint: -ptamethod digital, the default, takes it" in told
    assert symcheck.loads(CLOSED).check("Tmin=? [ F s>1 ]").value > 1


@pytest.mark.parametrize("formula", ['Tmin=? [ F "late" ]', "Tmax=? [ F x>=2 ]"])
@pytest.mark.parametrize("method", ["auto", "digital", "backwards"])
def test_the_target_of_an_expected_time_reads_no_clock(formula, method):
    told = refused(CLOSED, formula, timed_method=method)
    assert "the states that an expected reward or time is about cannot read the clock x" in told
    assert "hint: let a command" in told


def test_what_lists_states_names_the_constraint():
    model = symcheck.load(RUNNING)
    for ask in (
        lambda: model.labels,
        lambda: model.states,
        lambda: model.transitions.matrix,
        lambda: model.where("place=1"),
        lambda: model.simulate(3),
        lambda: model.simulator(),
        lambda: model.page(),
    ):
        with pytest.raises(UnsupportedError, match=r"13:16: error\[digital\]: digital clocks"):
            ask()


def test_random_paths_name_the_constraint(capsys):
    assert main([RUNNING, "-simpath", "5", "stdout"]) == 1
    assert "running.nm:13:16: error[digital]" in capsys.readouterr().err


# --------------------------------------------------------------------------------------- wording


@pytest.mark.parametrize("text", [CLOSED, OPEN])
def test_estimates_and_distributions_are_refused_by_name(text):
    model = symcheck.loads(text)
    with pytest.raises(UnsupportedError, match="estimates from random paths are not available"):
        model.estimate("Pmax=? [ F s=1 ]")


def test_a_distribution_is_none_of_an_mdp():
    with pytest.raises(UnsupportedError, match="not available for probabilistic timed automata"):
        symcheck.loads(CLOSED).transient(3)


def test_steps_of_time_are_no_commands():
    model = symcheck.loads(CLOSED)
    paths = str(model.check("P<=0.3 [ F s=3 ]").counterexample())
    assert "\n  [time] time passes in m" in paths
    assert "x<=2" not in paths
    assert "  0: m: [time]\n" in str(model.simulator())


def test_zones_take_no_coalition():
    text = (
        "tptg player p m endplayer module m s:[0..1]; x:clock; [] s=0 & x>=1 -> (s'=1); endmodule"
    )
    assert symcheck.loads(text).check("<<>> Pmax=? [ F s=1 ]").value == 0
    assert symcheck.loads(text, timed_method="backwards").check("Pmax=? [ F s=1 ]").value == 1
    assert "zones are not available for timed games" in refused(
        text, "<<>> Pmax=? [ F s=1 ]", timed_method="backwards"
    )
