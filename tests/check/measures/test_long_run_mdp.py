"""Long-run averages of decision processes: against every memoryless strategy, against Storm, and by hand."""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from checking import check_text, engine_of
from symcheck.engines.registry import BUILDERS
from symcheck.errors import InputError, UnsupportedError
from symcheck.syntax.parse import parse_expression
from symcheck.syntax.printer import pretty

SLOW = settings(max_examples=12, deadline=None, suppress_health_check=list(HealthCheck))

MACHINE = """mdp
module m
  s : [0..3];
  [run] s=0 -> 0.9:(s'=0) + 0.1:(s'=1);
  [care] s=0 -> (s'=0);
  [mend] s=1 -> 0.5:(s'=0) + 0.5:(s'=1);
  [sell] s=0 -> 0.25:(s'=2) + 0.75:(s'=3);
  [] s>1 -> true;
endmodule
rewards "gain"
  [run] true : 10;
  [care] true : 8;
  s=1 : -1;
  s=2 : 30;
endrewards
rewards "plain"
  [run] true : 10;
  [care] true : 8;
  s=2 : 30;
endrewards
label "up" = s=0;
"""


def ask(text, engine="explicit", model=MACHINE):
    return check_text(engine_of(model, engine), text).value


@pytest.mark.parametrize("engine", list(BUILDERS))
def test_by_hand(engine):
    # Running pays (10*10 - 2) / 12 = 49/6 a step, and so beats taking care (8) and selling (7.5).
    assert ask('R{"gain"}max=? [ S ]', engine) == pytest.approx(49 / 6, rel=1e-6)
    assert ask('R{"plain"}max=? [ S ]', engine) == pytest.approx(100 / 12, rel=1e-6)
    assert ask('R{"plain"}min=? [ S ]', engine) == pytest.approx(7.5, rel=1e-6)
    assert ask('Smax=? [ "up" ]', engine) == 1
    assert ask('Smin=? [ "up" ]', engine) == 0
    assert ask("Smax=? [ s=1 ]", engine) == pytest.approx(1 / 6, rel=1e-6)
    assert ask("S<=0.2 [ s=1 ]", engine) is True
    assert ask("S<=0.15 [ s=1 ]", engine) is False
    assert ask('R{"gain"}<=49/6 [ S ]', engine) is True
    assert ask('R{"gain"}max>49/6 [ S ]', engine) is False


def test_spellings():
    for text in ('Smax=? ["up"]', 'S max=? ["up"]', 'LRAmax=? ["up"]'):
        assert pretty(parse_expression(text)) == 'Smax=? [ "up" ]'
    assert pretty(parse_expression('LRA=? ["up"]')) == 'S=? [ "up" ]'
    assert pretty(parse_expression('S min<0.5 ["up"]')) == 'S min<0.5 [ "up" ]'
    assert pretty(parse_expression("Smax<3")) == "Smax<3"
    with pytest.raises(InputError, match="Smin"):
        ask('S=? [ "up" ]')
    with pytest.raises(UnsupportedError, match="fair"):
        check_text(engine_of(MACHINE), 'Smax=? [ "up" ]', fairness=True)


def test_values_everywhere():
    assert ask('filter(min, R{"plain"}min=? [ S ], s!=3)') == pytest.approx(7.5, rel=1e-6)
    assert ask('filter(sum, R{"plain"}max=? [ S ], s>1)') == pytest.approx(30, rel=1e-6)
    assert ask('R{"plain"}max=? [ S ] > 8') is True


@pytest.mark.parametrize("engine", ["explicit", "exact"])
def test_one_average_for_all_needs_no_equations(engine, monkeypatch):
    """Every run ends in an end component; here they pay the same, however slowly they are reached."""
    slow = """mdp
    module m
      s : [0..3];
      [] s=0 -> 1e-9:(s'=1) + 1-1e-9:(s'=0);
      [wait] s=0 -> true;
      [] s=1 -> 0.5:(s'=2) + 0.5:(s'=3);
      [] s=2 -> (s'=3);
      [] s=3 -> (s'=2);
    endmodule
    rewards "r" s=0 | s=3 : 1; [wait] true : -1/2; endrewards
    """
    monkeypatch.setattr("symcheck.numerics.linear.methods.solve_linear", None)
    for strategy in (False, True):
        result = check_text(engine_of(slow, engine), 'R{"r"}max=? [ S ]', strategy=strategy)
        assert result.value == pytest.approx(0.5, rel=1e-6)
    assert len(result.strategies) == 1


def test_components_that_mix_slowly():
    # A walk of 300 states with a drift away from the end that pays; periodic, too.
    walk = """mdp
    module m
      s : [0..300];
      [] s=0 -> (s'=1);
      [] s>0 & s<300 -> 0.499:(s'=s+1) + 0.501:(s'=s-1);
      [] s>0 & s<300 -> 0.5:(s'=s+1) + 0.5:(s'=s-1);
      [] s=300 -> (s'=299);
    endmodule
    rewards "end" s=300 : 1; endrewards
    """
    assert ask('R{"end"}max=? [ S ]', model=walk) == pytest.approx(1 / 600, rel=1e-6)
    rho = 499 / 501
    weights = [
        0.501,
        *(rho**k for k in range(299)),
        0.499 * rho**298,
    ]  # balance of a birth and death chain, over 0.501
    assert ask('R{"end"}min=? [ S ]', model=walk) == pytest.approx(
        weights[-1] / sum(weights), rel=1e-6
    )


class Choices:
    """A random decision process, a command per choice, and the chains that its memoryless strategies leave."""

    def __init__(self, seed):
        rng = Random(seed)
        self.n = rng.randint(2, 4)
        self.commands = []
        for s in range(self.n):
            own = []
            for _ in range(rng.randint(1, 2)):
                weights = [rng.randint(1, 3) for _ in range(rng.randint(1, 2))]
                targets = [f"{w}/{sum(weights)}:(s'={rng.randrange(self.n)})" for w in weights]
                own.append(f" s={s} -> {' + '.join(targets)};")
            self.commands.append(own)
        self.rewards = "".join(f"s={s} : {rng.choice((0, 0, 1, 2, -1))};" for s in range(self.n))

    def text(self, kind, commands):
        body = "\n".join(f"[a{i}] {c}" for i, c in enumerate(commands))
        return f'{kind}\nmodule m\n s:[0..{self.n - 1}];\n{body}\nendmodule\nrewards "r" {self.rewards} [a0] true : 3; endrewards\n'

    @property
    def model(self):
        return self.text("mdp", [c for own in self.commands for c in own])

    def chains(self):
        """Every strategy as a chain; commands that are not chosen have a guard that is never met, so that actions keep their names."""
        for chosen in product(*(range(len(own)) for own in self.commands)):
            commands = [
                c if i == k else c.replace(" s=", " s<0 & s=", 1)
                for own, k in zip(self.commands, chosen, strict=True)
                for i, c in enumerate(own)
            ]
            yield self.text("dtmc", commands)


@SLOW
@given(seed=st.integers(0, 2**20))
def test_against_every_memoryless_strategy(seed):
    choices = Choices(seed)
    exact, engine = engine_of(choices.model, "exact"), engine_of(choices.model)
    for operator, query in (('R{"r"}', "S"), ("S", "s=0")):
        averages = [
            check_text(engine_of(t, "exact"), f"{operator}=? [ {query} ]").value
            for t in choices.chains()
        ]
        for direction, fold in (("min", min), ("max", max)):
            true = fold(averages)
            text = f"{operator} {direction}=? [ {query} ]"
            assert check_text(exact, text).value == true, f"{text}\n{choices.model}"
            low, high = (v[0] for v in check_text(engine, text).values.at(engine.initial))
            assert low - 1e-12 <= true <= high + 1e-12, (
                f"{text}: [{low}, {high}], not {true}\n{choices.model}"
            )
            assert high - low <= 1e-6 * abs(float(true)) + 1e-9
            assert isinstance(true, Fraction | int)


@pytest.mark.parametrize("seed", range(8))
def test_against_storm(seed, tmp_path):
    stormpy = pytest.importorskip("stormpy", reason="Storm's Python package is not installed")
    text = Choices(seed).model
    (tmp_path / "m.prism").write_text(text)
    program = stormpy.parse_prism_program(str(tmp_path / "m.prism"))
    engine = engine_of(text)
    for direction in ("min", "max"):
        for theirs, ours in (
            (f"LRA{direction}=? [ s=0 ]",) * 2,
            (f'R{{"r"}}{direction}=? [ LRA ]', f'R{{"r"}}{direction}=? [ S ]'),
        ):
            properties = stormpy.parse_properties(theirs, program)
            built = stormpy.build_model(program, properties)
            value = stormpy.model_checking(built, properties[0]).get_value(built.initial_states[0])
            assert check_text(engine, ours).value == pytest.approx(value, abs=2e-5), (
                f"{ours}\n{text}"
            )


@pytest.mark.parametrize("name", ["explicit", "hybrid"])
def test_an_average_far_below_rounding_has_wide_bounds(name: str) -> None:
    text = """mdp module m x : [0..1] init 1;
        [] x=1 -> 1e-17 : (x'=0) + 1-1e-17 : (x'=1);
        [] x=0 -> (x'=1);
        endmodule"""
    true = check_text(engine_of(text, "exact"), "Smin=? [ x=0 ]").value
    low, high = check_text(engine_of(text, name), "Smin=? [ x=0 ]").bounds
    assert low <= true <= high
