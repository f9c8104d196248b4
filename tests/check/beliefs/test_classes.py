"""What partially observed models offer beside values, and timed ones."""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from pathlib import Path

import pytest

import symcheck
from symcheck.cli import main
from symcheck.errors import InputError, UnsupportedError

TIGER = str(Path(__file__).parents[3] / "models/tiger/tiger.prism")

# Waiting is seen, and tells nothing: the player bets on a hidden coin when the clock shows 2.
TIMED = """popta
observables x, phase endobservables
module m
  x : clock;
  side : [0..1]; phase : [0..3];
  invariant (phase=0 => x<=1) & (phase=1 => x<=2) endinvariant
  [toss] phase=0 & x>=1 -> 0.3:(side'=0) & (phase'=1) + 0.7:(side'=1) & (phase'=1);
  [zero] phase=1 & x=2 -> (phase'=side=0 ? 2 : 3);
  [one] phase=1 & x=2 -> (phase'=side=1 ? 2 : 3);
endmodule
label "won" = phase=2;
"""


class TestTimed:
    @pytest.mark.parametrize("exact", [False, True])
    def test_digital_clocks(self, exact):
        model = symcheck.loads(TIMED, exact=exact)
        assert float(model.check('Pmax=? [ F "won" ]').value) == pytest.approx(0.7, abs=1e-12)

    def test_bounds_on_time_need_no_clock_that_is_seen(self):
        # A strategy remembers when it let time pass.
        model = symcheck.loads(TIMED, exact=True)
        assert model.check('Pmax=? [ F<=2 "won" ]').value == Fraction(7, 10)
        assert model.check('Pmax=? [ F<2 "won" ]').value == 0
        assert model.check('Pmin=? [ F<=2 "won" ]').value == Fraction(3, 10)

    def test_strict_constraints_are_refused_without_pointing_at_zones(self):
        strict = TIMED.replace("phase=0 & x>=1", "phase=0 & x>0")
        with pytest.raises(UnsupportedError, match="zones, which would take it, are not available"):
            symcheck.loads(strict).check('Pmax=? [ F "won" ]')

    def test_a_clock_that_is_not_seen(self):
        hidden = TIMED.replace("observables x, phase", "observables phase")
        with pytest.raises(InputError, match="different actions"):
            symcheck.loads(hidden).check('Pmax=? [ F "won" ]')

    def test_what_is_seen_of_a_clock_counts(self):
        # The coin is hidden, and x tells it: when y is 5, x is 5 or 6.
        text = """popta
          observables l, y, won, near endobservables
          formula near = x<6;
          module m
            l : [0..2]; c : [0..1]; won : bool; x : clock; y : clock;
            invariant (l=0 => y<=1 & x<=9) & (l=1 => y<=5) endinvariant
            [] l=0 & y=1 -> 1/2 : (l'=1) & (x'=0) & (y'=0) + 1/2 : (l'=1) & (c'=1) & (y'=0);
            [a] l=1 & y=5 -> (l'=2) & (won'=(c=0));
            [b] l=1 & y=5 -> (l'=2) & (won'=(c=1));
          endmodule"""
        value = {6: 1, 5: 1, 7: Fraction(1, 2)}
        for (bound, expected), invariant in product(value.items(), ("", " & x<=9")):
            seen = text.replace("x<6", f"x<{bound}").replace(" & x<=9", invariant)
            model = symcheck.loads(seen, exact=True)
            assert model.check("Pmax=? [ F won ]").value == expected
        diagonal = symcheck.loads(text.replace("x<6", "x-y<1"))
        with pytest.raises(UnsupportedError, match="compares two clocks"):
            diagonal.check("Pmax=? [ F won ]")

    def test_a_clock_that_is_seen_counts_where_nothing_compares_it(self):
        # Before it is compared with 9, it is reset. If it is not reset with the coin, it is 1.
        text = """popta
          observables l, y, won, x endobservables
          module m
            l : [0..3]; c : [0..1]; won : bool; x : clock; y : clock;
            invariant (l=0 => y<=1) & (l=1 => y<=5) & (l=3 => x<=9) endinvariant
            [] l=0 & y=1 -> 1/2 : (l'=1) & (x'=0) & (y'=0) + 1/2 : (l'=1) & (c'=1) & (y'=0);
            [a] l=1 & y=5 -> (l'=2) & (won'=(c=0));
            [b] l=1 & y=5 -> (l'=2) & (won'=(c=1));
            [] l=2 -> (l'=3) & (x'=0);
            [] l=3 -> (l'=2) & (x'=0);
          endmodule"""
        assert symcheck.loads(text, exact=True).check("Pmax=? [ F won ]").value == 1
        unseen = text.replace("won, x", "won").replace("[] l=2", "[] l=3")
        assert symcheck.loads(unseen, exact=True).check("Pmax=? [ F won ]").value == Fraction(1, 2)


def test_random_paths(capsys):
    assert main([TIGER, "-simpath", "3", "stdout"]) == 0
    assert "hide" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("call", "refused"),
    [
        (lambda m: m.estimate('Pmax=? [ F<=3 "free" ]'), "estimates from random paths"),
        (lambda m: m.check('Pmax=? [ F "free" ]').certificate(), "certificates"),
        (lambda m: m.check('Pmax<0.1 [ F<=3 "free" ]').counterexample(), "counterexamples"),
        (lambda m: symcheck.export(m, "stdout.jani"), "JANI files"),
    ],
)
def test_what_is_refused_by_name(call, refused):
    with pytest.raises(UnsupportedError, match=f"{refused} are not available for partially"):
        call(symcheck.load(TIGER))


def test_an_infinite_reward_without_a_strategy_is_not_said_to_be_that_of_all():
    # Waiting earns for ever, and opening a door does not.
    tiger = symcheck.load(TIGER, strategy=True)
    result = tiger.check('R{"cost"}max=? [ F "open" ]')
    assert result.value == float("inf")
    assert any("no strategy is built for an infinite reward" in w for w in result.warnings)
