"""Values of partially observed models: bounds contain the truth, and are exact where all beliefs are known."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from itertools import pairwise
from math import inf
from pathlib import Path
from random import Random

import beliefs
import pytest

import symcheck
from oracles.beliefs import drawn
from symcheck.errors import InputError, ModelFault, NumericalError, UnsupportedError

MODELS = Path(__file__).parents[3] / "models"

# A coin that nobody sees is bet on.
BET = """pomdp
observables phase endobservables
module coin
  side : [0..1]; phase : [0..3];
  [toss] phase=0 -> 0.3:(side'=0) & (phase'=1) + 0.7:(side'=1) & (phase'=1);
  [zero] phase=1 -> (phase'=side=0 ? 2 : 3);
  [one] phase=1 -> (phase'=side=1 ? 2 : 3);
  [again] phase>1 -> true;
endmodule
rewards [zero] true : 5; [one] side=1 : 1; endrewards
label "won" = phase=2;
label "end" = phase>1;
"""

# Neither a finite number of tries nor a finite belief process: each try says a little.
SIGNAL = """pomdp
const double p;
observables phase, heard endobservables
module m
  side : [0..1]; phase : [0..3]; heard : [0..1];
  [hide] phase=0 -> 0.5:(side'=0) & (phase'=1) + 0.5:(side'=1) & (phase'=1);
  [listen] phase=1 -> p:(heard'=side) + 1-p:(heard'=1-side);
  [zero] phase=1 -> (phase'=side=0 ? 2 : 3) & (heard'=0);
  [one] phase=1 -> (phase'=side=1 ? 2 : 3) & (heard'=0);
  [again] phase>1 -> true;
endmodule
label "won" = phase=2;
"""


def bound(text: str, query: str, **options: object) -> tuple[float, float]:
    """The bounds of a query."""
    return symcheck.loads(text, **options).check(query).bounds


class TestExactValues:
    @pytest.mark.parametrize(
        ("query", "value"),
        [
            ('Pmax=? [ F "won" ]', Fraction(7, 10)),
            ('Pmin=? [ F "won" ]', Fraction(3, 10)),
            ('Pmax=? [ G !"won" ]', Fraction(7, 10)),
            ('Rmax=? [ F "end" ]', 5),
            ('Rmin=? [ F "end" ]', Fraction(7, 10)),
            ('Rmin=? [ F "won" ]', inf),
            ('Pmax=? [ F<=1 "won" ]', 0),
            ('Pmax=? [ F<=2 "won" ]', Fraction(7, 10)),
            ('Pmin=? [ F[2,3] "won" ]', Fraction(3, 10)),
            ("Pmax=? [ X phase=1 ]", 1),
            ("Pmax=? [ phase<2 U phase=3 ]", Fraction(7, 10)),
        ],
    )
    @pytest.mark.parametrize("exact", [False, True])
    def test_a_hidden_coin(self, query, value, exact):
        result = symcheck.loads(BET, exact=exact).check(query)
        if exact:
            assert result.value == value
            assert str(result.accuracy) == "exact"
        else:
            low, high = result.bounds
            assert low * (1 - 1e-12) - 1e-12 <= value <= high * (1 + 1e-12) + 1e-12
            assert high - low <= 1e-9 or value == inf

    def test_thresholds_at_the_value_are_decided(self):
        model = symcheck.loads(BET)
        for query, verdict in {
            'Pmax>=0.7 [ F "won" ]': True,
            'Pmax>0.7 [ F "won" ]': False,
            'Pmin<=0.3 [ F "won" ]': True,
            'Pmin<0.3 [ F "won" ]': False,
            'P<=0.7 [ F "won" ]': True,
            'P>=0.3 [ F "won" ]': True,
            'Rmin<=0.7 [ F "end" ]': True,
            'Rmin<0.7 [ F "end" ]': False,
        }.items():
            assert bool(model.check(query)) is verdict, query

    @pytest.mark.parametrize("p", ["1e-300", "1e-16", "1-1e-16"])
    def test_extreme_numbers(self, p):
        text = BET.replace("0.3:", f"{p}:").replace("0.7:", f"1-({p}):")
        true = 1 - Fraction(p[2:]) if p.startswith("1-") else Fraction(p)
        exact = symcheck.loads(text, exact=True)
        assert exact.check('Pmax=? [ F "won" ]').value == max(true, 1 - true)
        assert exact.check('Pmin=? [ F "won" ]').value == min(true, 1 - true)
        for query in ('Pmax=? [ F "won" ]', 'Pmin=? [ F "won" ]'):
            low, high = bound(text, query)
            value = exact.check(query).value
            assert low * (1 - 1e-12) <= value <= high * (1 + 1e-12)


class TestBounds:
    def test_the_tiger(self):
        low, high = bound((MODELS / "tiger/tiger.prism").read_text(), 'R{"cost"}min=? [ F "open" ]')
        assert low <= 1182 / 247 <= high
        assert high - low < 1e-5

    @pytest.mark.parametrize("p", [Fraction(1, 2), Fraction(3, 4), Fraction(999, 1000)])
    def test_listening_for_ever(self, p):
        """What is approached is not attained: the value is 1, unless nothing is heard."""
        model = symcheck.loads(SIGNAL, constants={"p": str(p)})
        low, high = model.check('Pmax=? [ F "won" ]').bounds
        value = 1 if p > 0.5 else 0.5
        assert low - 1e-9 <= value <= high + 1e-9
        assert high - low < 1e-5
        if p > 0.5:
            with pytest.raises(NumericalError, match=r"undecided: the value .* lies between"):
                model.check('Pmax>=1 [ F "won" ]')

    def test_bounds_never_become_worse(self):
        model = symcheck.loads(SIGNAL, constants={"p": "0.6"})
        found = [
            model.with_options(beliefs=n, grid_resolution=r).check('Pmax=? [ F "won" ]').bounds
            for n, r in ((2, 1), (20, 2), (200, 4), (2000, 8))
        ]
        for (low, high), (lower, higher) in pairwise(found):
            assert low <= lower + 1e-9
            assert higher <= high + 1e-9
        assert found[0][1] - found[0][0] > 0.01  # it is a matter of work

    def test_a_wide_gap_is_told(self):
        model = symcheck.loads(SIGNAL, constants={"p": "0.6"}, beliefs=2, grid_resolution=1)
        result = model.check('Pmax=? [ F "won" ]')
        (told,) = (w for w in result.warnings if "is not promised" in w)
        assert "apart, relative to their value, further than asked for" in told
        absolute = model.with_options(relative=False).check('Pmax=? [ F "won" ]')
        low, high = absolute.bounds
        (told,) = (w for w in absolute.warnings if "is not promised" in w)
        assert f"the bounds are {high - low:.1E} apart, further" in told
        assert "certified" in str(result.accuracy)

    @pytest.mark.parametrize("seed", range(25))
    def test_random_models_against_trees_of_beliefs(self, seed, monkeypatch):
        # With a third of the beliefs, the same thresholds of these models are decided.
        monkeypatch.setitem(beliefs.OPTIONS, "beliefs", 100)
        counts: Counter[str] = Counter()
        assert not list(beliefs.contradictions(drawn(Random(seed)), 3, counts))
        assert counts["decided"] + counts["undecided"]


class TestQualitative:
    def test_almost_surely_by_sets_of_states(self):
        maze = symcheck.load(MODELS / "maze/maze.prism", constants={"slip": "0.1"})
        assert maze.check('Pmax=? [ F "target" ]').value == 1
        assert maze.check('Pmax>=1 [ F "target" ]')
        assert str(maze.check('Pmax=? [ F "target" ]').accuracy) == "exact"

    def test_what_is_unavoidable(self):
        text = BET.replace("phase>1 -> true", "phase>1 -> (phase'=2)")
        model = symcheck.loads(text)
        assert model.check('Pmin=? [ F "won" ]').value == 1
        assert model.check('P>=1 [ F "won" ]')
        # The error was paid for: no strategy earns for ever.
        assert model.check('Rmax=? [ F "won" ]').value < inf

    def test_what_can_be_avoided_for_certain(self):
        assert symcheck.loads(SIGNAL, constants={"p": "0.6"}).check('Pmin=? [ F "won" ]').value == 0
        assert symcheck.loads(BET).check('Rmax=? [ F "won" ]').value == inf


class TestRefusals:
    def test_states_that_are_not_observable(self):
        with pytest.raises(InputError, match=r"must be observable: \(side=1,phase=.\) is among"):
            symcheck.loads(BET).check("Pmax=? [ F side=1 ]")

    @pytest.mark.parametrize(
        ("query", "marked"),
        [
            ("Pmax=? [ F side=1 ]", "side=1"),
            ("Pmax=? [ G<=3 side!=1 ]", "side!=1"),
            ('Pmin>0.1 [ side=1 U "won" ]', "side=1"),
            ("Pmin=? [ X phase=1 & side=1 ]", "phase=1 & side=1"),
            ('Rmin=? [ F "won" & side=0 ]', '"won" & side=0'),
        ],
    )
    def test_the_hidden_condition_is_underlined(self, query, marked):
        with pytest.raises(InputError) as caught:
            symcheck.loads(BET).check(query)
        (fault,) = caught.value.diagnostics
        assert fault.span.text == marked
        assert 'observable "name" = condition;' in fault.hint

    def test_different_actions(self):
        text = BET.replace("[one] phase=1", "[one] phase=1 & side=1")
        with pytest.raises(ModelFault, match=r"same observation have different actions: .*\[one\]"):
            symcheck.loads(text).check('Pmax=? [ F "won" ]')

    @pytest.mark.parametrize(
        "query",
        ['Pmax=? [ F G "won" ]', 'Smax=? [ "won" ]', "Rmax=? [ C<=3 ]", 'E [ F "won" ]',
         'multi(Pmax=? [ F "won" ], P>=0.1 [ F "end" ])', 'Pmax=? [ true U>=2 "won" ]'],
    )  # fmt: skip
    def test_what_is_not_built(self, query):
        with pytest.raises(UnsupportedError, match="partially observable decision processes"):
            symcheck.loads(BET).check(query)

    @pytest.mark.parametrize("engine", ["sparse", "hybrid", "mtbdd"])
    def test_diagrams(self, engine):
        with pytest.raises(UnsupportedError, match="decision diagrams are not available"):
            symcheck.loads(BET, engine=engine).check('Pmax=? [ F "won" ]')

    def test_infinitely_many_beliefs_have_no_exact_value(self):
        model = symcheck.loads(SIGNAL, constants={"p": "0.6"}, exact=True, beliefs=50)
        with pytest.raises(NumericalError, match="only finitely many beliefs have exact values"):
            model.check('Pmax=? [ F "won" ]')
