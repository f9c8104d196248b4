"""Models with parameters: functions, regions, lifting, extremal values."""

from __future__ import annotations

import subprocess
import sys
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any

import parameters
import pytest

import symcheck
from symcheck.check.regions import volume
from symcheck.errors import InputError, NumericalError, UnsupportedError, UsageError
from symcheck.matrices.rational_functions import RationalFunction

ZEROCONF = """dtmc
const double p; const double q; const int N = 3;
module host
  s : [0..N+2];                       // probes without answer; N+1: error, N+2: a free address
  [] s=0 -> q : (s'=1) + 1-q : (s'=N+2);
  [] s>0 & s<=N -> p : (s'=s+1) + 1-p : (s'=0);
  [] s>N -> true;
endmodule
rewards "probes" s>0 & s<=N : 1; endrewards
"""
CHOICE = """mdp
const double p; const double q;
module m
  s : [0..3];
  [a] s=0 -> p : (s'=1) + 1-p : (s'=2);
  [b] s=0 -> q : (s'=1) + 1-q : (s'=2);
  [] s=2 -> 1/2 : (s'=0) + 1/2 : (s'=3);
  [] s=1 | s=3 -> true;
endmodule
rewards [a] true : p; [b] true : 1; endrewards
"""
QUEUE = """ctmc
const double x;
module queue
  n : [0..2];
  [] n<2 -> x : (n'=n+1);
  [] n>0 -> 2 : (n'=n-1);
endmodule
rewards true : n*x; endrewards
"""


PARABOLA = """dtmc const double p;  // reaches x=1 with probability 1/2 at p=1/2, else with more
module m x:[0..2];
  [] x=0 -> 1/2+(p-1/2)*(p-1/2) : (x'=1) + 1/2-(p-1/2)*(p-1/2) : (x'=2);
endmodule
rewards true : 1; endrewards"""

TIE = """mdp const double p;
module m x:[0..2];
  [a] x=0 -> p : (x'=1) + 1-p : (x'=2);
  [b] x=0 -> 1-p : (x'=1) + p : (x'=2);
endmodule"""


def function(text: str, ranges: str, formula: str) -> RationalFunction:
    found = symcheck.loads(text).parametric(ranges).check(formula).value
    assert isinstance(found, RationalFunction)
    return found


def test_the_function_of_zeroconf_is_that_of_the_literature() -> None:
    # Bohnenkamp et al. (2003): q p^N / (1 - q (1 - p^N)).
    error = function(ZEROCONF, "p,q", "P=? [ F s=N+1 ]")
    rng = Random(0)
    for _ in range(20):
        p, q = (Fraction(rng.randint(1, 99), 100) for _ in "pq")
        assert error(p=p, q=q) == q * p**3 / (1 - q * (1 - p**3))


@pytest.mark.parametrize(
    ("text", "formula", "expected"),
    [
        (ZEROCONF, "P=? [ X s=1 ]", "q"),
        (ZEROCONF, "P=? [ G s!=N+1 ]", "-(q-1)/(p^3*q-q+1)"),
        (ZEROCONF, "P=? [ F<=4 s=N+1 ]", "q*p^3"),
        (ZEROCONF, 'R{"probes"}=? [ F s>N ]', "q*(1+p+p^2)/(p^3*q-q+1)"),
        (ZEROCONF, 'R{"probes"}=? [ C<=2 ]', "q"),
        (ZEROCONF, "S=? [ s=N+2 ]", "(1-q)/(1-q*(1-p^3))"),
        (ZEROCONF, "1 - P=? [ F s=N+1 ] + p", "(1-q)/(1-q*(1-p^3)) + p"),
        (QUEUE, "S=? [ n=2 ]", "x^2/(x^2+2*x+4)"),
        (QUEUE, "R=? [ S ]", "x*(2*x+2*x^2)/(x^2+2*x+4)"),
        (QUEUE, "P=? [ n<2 U n=0 ]", "1"),
        (QUEUE, "R=? [ F n=2 ]", "1"),
    ],
)
def test_functions(text: str, formula: str, expected: str) -> None:
    from symcheck.engines.parametric.functions import function_of_text

    value = symcheck.loads(text).parametric("x" if text is QUEUE else "p,q").check(formula).value
    field = symcheck.loads(ZEROCONF).parametric("p,q,").check("P=? [ X s=1 ]").value.field
    if isinstance(value, RationalFunction):
        field = value.field
    assert function_of_text(expected, field, {}) == value


def test_expected_functions_are_compared_as_functions() -> None:
    model = symcheck.loads(ZEROCONF).parametric("p,q")
    right = "// RESULT: (1-q)/(p^3*q-q+1)\nP=? [ F s=N+2 ]"
    assert model.test(right).ok
    assert not model.test(right.replace("1-q", "1-p")).ok
    assert model.test("// RESULT: Error\nP=? [ F<=p s=N+2 ]").ok


def test_a_bounded_time_is_no_rational_function_of_rates() -> None:
    with pytest.raises(UnsupportedError, match="within a bound are not available"):
        symcheck.loads(QUEUE).parametric("x=1:2").check("P=? [ F<=2 n=2 ]")


def test_a_step_of_a_chain_in_continuous_time_has_a_function() -> None:
    model = symcheck.loads(QUEUE).parametric("x=1:2")
    assert str(model.check("filter(state, P=? [ X n=2 ], n=1)").function) == "x/(x+2)"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("s=0 ->", "s=0 & p<0.5 ->", "in a guard"),
        ("q : (s'=1)", "max(p,q) : (s'=1)", "under max"),
        ("q : (s'=1)", "(p>q ? q : q) : (s'=1)", "in a condition"),
        ("q : (s'=1)", "2^q : (s'=1)", "in an exponent"),
        ("(s'=N+2)", "(s'=(p>0 ? N+2 : 0))", "in an assignment"),
        ('rewards "probes" s>0 &', 'rewards "probes" p>0 &', "in the guard of a reward"),
        ("const int N = 3", 'const int N = 3; label "x" = p<q', "in a label"),
    ],
)
def test_places_of_parameters_that_are_refused(old: str, new: str, message: str) -> None:
    assert old in ZEROCONF
    with pytest.raises(InputError, match=f"parameter [pq] stands {message}") as caught:
        symcheck.loads(ZEROCONF.replace(old, new)).parametric("p,q")
    (fault,) = caught.value.diagnostics
    assert fault.code == "parameter"
    assert fault.span.text in ("p", "q")


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("filter(max, pow(p,0.5)*s)", "the power 1/2 is no rational function"),
        ("max(p,2) + P=? [ X s=1 ]", "parameter p stands under max"),  # and is no p^2
        ("filter(max, s^p)", "parameter p stands in an exponent"),
    ],
)
def test_formulas_in_which_values_are_no_functions(formula: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        symcheck.loads(ZEROCONF).parametric("p,q").check(formula)


def test_a_power_that_is_not_whole_is_underlined() -> None:
    text = ZEROCONF.replace("q : (s'=1) + 1-q", "pow(q,0.5) : (s'=1) + 1-pow(q,0.5)")
    with pytest.raises(InputError, match="the power 1/2 is no rational function") as caught:
        symcheck.loads(text).parametric("p,q").check("P=? [ F s=1 ]")
    assert caught.value.diagnostics[0].span.text == "pow(q,0.5)"


@pytest.mark.parametrize("kind", ["ma", "pomdp"])
def test_classes_of_models_without_parameters(kind: str) -> None:
    with pytest.raises(UnsupportedError, match="parameters are not available for"):
        symcheck.loads(CHOICE.replace("mdp", kind, 1)).parametric("p,q")


def test_ranges_of_variables_are_numbers() -> None:
    with pytest.raises(InputError):
        symcheck.loads(ZEROCONF.replace("[0..N+2]", "[0..ceil(p)+4]")).parametric("p,q")


@pytest.mark.parametrize(
    "ranges",
    ["r", "N=1:2", "p=0.5", "p=1:0", "", "p=x:1", "p,,q", "p,p=0.1:0.2", 3, [("p", 0, 1)]],
)
def test_faulty_ranges(ranges: Any) -> None:
    with pytest.raises((InputError, UsageError)):
        _ = symcheck.loads(ZEROCONF).parametric(ranges).bound


def test_ranges_are_a_text_a_mapping_or_a_list_of_names() -> None:
    model = symcheck.loads(ZEROCONF)
    expected = model.parametric("p=1/4:0.5,q").parameters
    assert model.parametric(["p=0.25:0.5", "q"]).parameters == expected
    assert model.parametric({"p": (0.25, "1/2"), "q": (0, 1)}).parameters == expected


def test_a_parameter_has_no_value() -> None:
    with pytest.raises(InputError, match="parameter p has a value, too"):
        _ = symcheck.loads(ZEROCONF, "p=0.3").parametric("p,q").bound


def test_sums_are_compared_as_functions() -> None:
    text = ZEROCONF.replace("1-q : (s'=N+2)", "1-p : (s'=N+2)")
    with pytest.raises(InputError, match="probabilities sum to -p"):
        symcheck.loads(text).parametric("p,q").check("P=? [ F s=1 ]")


def test_ranges_without_a_model_are_an_error() -> None:
    with pytest.raises(NumericalError, match="all probabilities positive"):
        symcheck.loads(ZEROCONF).parametric("p=2:3,q").check("P=? [ F s=1 ]")


def test_a_function_says_where_it_holds() -> None:
    text = ZEROCONF.replace("q : (s'=1) + 1-q", "2*q : (s'=1) + 1-2*q")
    regions = symcheck.loads(text).parametric("p,q").check("P=? [ X s=1 ]").regions
    assert [str(c) for c in regions.well_defined] == ["q - 1/2 < 0"]
    assert regions.at(p=0.5, q=0.25).value(p=0.5, q=0.25) == Fraction(1, 2)
    with pytest.raises(UsageError, match="no case"):
        regions.at(p=0.5, q=0.75)


def test_a_probability_that_is_0_in_some_states_leads_nowhere() -> None:
    # Reaching x=-1 would be a fault of the model.
    text = (
        "dtmc const double p; module m x : [0..2] init 2;"
        "[] true -> x/2*p : (x'=x-1) + 1-x/2*p : (x'=x); endmodule"
    )
    assert function(text, "p", "P=? [ F<=2 x=0 ]")(p=0.5) == Fraction(1, 2) * Fraction(1, 4)


def test_an_mdp_has_a_function_and_a_strategy_for_each_region() -> None:
    model = symcheck.loads(CHOICE).parametric("p,q").with_options(strategy=True, regions=0.95)
    regions = model.check("Pmax=? [ F s=1 ]").regions
    assert regions.share >= 0.95
    found = {c.strategy.actions[0]: c for c in regions.cases}
    assert found.keys() == {"a", "b"}
    for action, name in (("a", "p"), ("b", "q")):
        assert (
            found[action].value(p=0.3, q=0.7) == {"p": Fraction(6, 13), "q": Fraction(14, 17)}[name]
        )
        for box in found[action].boxes:
            corners = [(x, y) for x in box["p"] for y in box["q"]]
            assert all((x >= y) if action == "a" else (x <= y) for x, y in corners)


@pytest.mark.parametrize("lifting", [False, True])
@pytest.mark.parametrize(
    ("text", "formula"),
    [
        (ZEROCONF, "P<=0.1 [ F s=N+1 ]"),
        (ZEROCONF, "P>=0.9 [ G s!=N+1 ]"),
        (ZEROCONF, 'R{"probes"}<2 [ F s>N ]'),
        (CHOICE, "Pmax>=0.5 [ F s=1 ]"),
        (CHOICE, "P<0.5 [ F s=1 ]"),
        (CHOICE, "Pmin>0.4 [ F s=1 ]"),
        (CHOICE, "Pmin<0.5 [ G s!=1 ]"),
        (CHOICE, "Rmax<1.2 [ F s=1|s=3 ]"),
        (QUEUE, "R<=2 [ F n=2 ]"),
    ],
)
def test_regions_have_the_verdicts_of_the_exact_engine(
    text: str, formula: str, lifting: bool
) -> None:
    ranges = "x=0.1:2" if text is QUEUE else "p=0.01:0.99,q=0.01:0.99"
    model = symcheck.loads(text).parametric(ranges)
    regions = model.with_options(lifting=lifting, regions=0.8).check(formula).regions
    assert regions.share >= 0.8
    parts = [*(b for c in regions.cases for b in c.boxes), *regions.undecided]
    assert sum(map(volume, parts)) == volume(regions.box)
    rng = Random(formula)
    boxes = [(c.value, b) for c in regions.cases for b in c.boxes]
    for value, box in rng.sample(boxes, min(10, len(boxes))):
        point = {n: str(a + (b - a) * Fraction(rng.randint(1, 9), 10)) for n, (a, b) in box.items()}
        assert symcheck.loads(text, point, exact=True).check(formula).value is value


def test_lifting_refuses_what_is_not_multilinear() -> None:
    text = ZEROCONF.replace("q : (s'=1) + 1-q", "q^2 : (s'=1) + 1-q^2")
    model = symcheck.loads(text).parametric("p,q").with_options(lifting=True)
    with pytest.raises(UnsupportedError, match=r"linear in each parameter, and .* is q\^2"):
        model.check("P<=0.1 [ F s=N+1 ]")
    with pytest.raises(UnsupportedError, match="lifting bounds"):
        model.check("P<=0.1 [ G F s=N+1 ]")


def test_thresholds_may_be_parameters_and_formulas_nested() -> None:
    model = symcheck.loads(ZEROCONF).parametric("p=0.1:0.9,q=0.1:0.9")
    assert model.check("P<=q [ F s=N+1 ]").value is True
    nested = model.check("P=? [ F P>0.5 [ X s=N ] ]").regions
    for case in nested.cases:
        # From s=N-1, the next probe is lost with probability p.
        over = case.sample["p"] > Fraction(1, 2)
        assert (case.value != 0) == over


def test_extremal_values_and_feasible_points() -> None:
    model = symcheck.loads(ZEROCONF).parametric("p=0.1:0.9,q=0.1:0.9")
    greatest = model.extremum("P=? [ F s=N+1 ]", "max", 1e-4)
    p = q = Fraction(9, 10)
    limit = q * p**3 / (1 - q * (1 - p**3))
    assert greatest.value <= limit <= greatest.bound <= greatest.value + Fraction(1, 10_000)
    point = model.feasible("P>=0.8 [ F s=N+1 ]")
    constants = {n: str(v) for n, v in point.items()}
    assert symcheck.loads(ZEROCONF, constants, exact=True).check("P>=0.8 [ F s=N+1 ]").value
    assert model.feasible("P>=0.9 [ F s=N+1 ]") is None
    by_ties = symcheck.loads(CHOICE).parametric("p,q").extremum("Pmax=? [ F s=1 ]", "max")
    assert by_ties.bound == 1


PRODUCT = """dtmc const double p; const double q; module m x:[0..3];
  [] x=0 -> p:(x'=1)+1-p:(x'=2); [] x=1 -> q:(x'=3)+1-q:(x'=2); endmodule"""  # reaches 3: p*q
UNEQUAL = """mdp const double p; const double q; module m x:[0..3];
  [a] x=0 -> p:(x'=1) + 1-p:(x'=2); [b] x=0 -> q:(x'=1) + 1-q:(x'=3);
  [c] x=2 -> 0.5:(x'=1)+0.5:(x'=3); endmodule"""  # reaches 1: (p+1)/2 by a, q by b


@pytest.mark.parametrize("lifting", [False, True])
@pytest.mark.parametrize(
    ("text", "ranges", "formula"),
    [
        (PRODUCT, "p,q", "P>=0.99 [ F x=3 ]"),
        (PRODUCT, "p,q", "P>=0.9999 [ F x=3 ]"),
        (PRODUCT, "p,q", "P>=0.25 [ F x=3 ] & P<=0.2500001 [ F x=3 ]"),
        (PRODUCT, "p=0.1:0.3,q", "P>=0.25001 [ F x=3 ] & P<=0.25002 [ F x=3 ]"),
        (PRODUCT, "p=0.1:0.4,q=0.2:0.6", "P>=0.23 [ F x=3 ]"),
        (PRODUCT, "p=0.1:0.4,q=0.2:0.6", "P>=0.2399999 [ F x=3 ]"),
        (UNEQUAL, "p,q", "Pmin>=0.99 [ F x=1 ]"),
        (UNEQUAL, "p,q", "Pmax<0.51 [ F x=1 ]"),
    ],
)
def test_small_parts_of_the_ranges_have_feasible_points(
    text: str, ranges: str, formula: str, lifting: bool
) -> None:
    point = symcheck.loads(text, lifting=lifting).parametric(ranges).feasible(formula)
    assert point is not None
    constants = {name: str(value) for name, value in point.items()}
    assert symcheck.loads(text, constants, exact=True).check(formula).value is True


@pytest.mark.parametrize(
    ("text", "ranges", "formula"),
    [
        (PRODUCT, "p=0.1:0.4,q=0.2:0.6", "P>=0.24 [ F x=3 ]"),  # that of a corner outside
        (PRODUCT, "p,q", "P>=1 [ F x=3 ]"),
        (PRODUCT, "p,q", "P>=q [ F x=3 ]"),
        (PRODUCT, "p,q", "P<=0.3 [ F x=3 ] & P>=0.4 [ F x=3 ]"),
        (UNEQUAL, "p,q", "Pmax<=0.5 [ F x=1 ]"),
        (UNEQUAL, "p,q", "Pmin>=1 [ F x=1 ]"),
        (UNEQUAL, "p,q", "P<=0.4 [ F x=1 ]"),
    ],
)
def test_without_a_feasible_point_that_is_proved(text: str, ranges: str, formula: str) -> None:
    assert symcheck.loads(text).parametric(ranges).feasible(formula) is None


def test_a_number_is_not_feasible_and_arguments_of_extrema_are_checked() -> None:
    model = symcheck.loads(PRODUCT).parametric("p,q")
    with pytest.raises(UnsupportedError, match="true or false has feasible points, and this is p"):
        model.feasible("P=? [ F x=3 ]")
    with pytest.raises(UsageError, match="direction 'mx' is neither"):
        model.extremum("P=? [ F x=3 ]", "mx")  # type: ignore[arg-type]
    for gap in (0, -0.5, float("nan"), float("inf")):
        with pytest.raises(UsageError, match="expected a number above 0"):
            model.extremum("P=? [ F x=3 ]", "max", gap)


def test_derivatives_and_monotonicity() -> None:
    error = function(ZEROCONF, "p,q", "P=? [ F s=N+1 ]")
    slope = error.derivative("p")
    p = q = Fraction(1, 2)
    # The derivative of q p^3 / d with d = 1 - q + q p^3 is 3 q p^2 (1 - q) / d^2.
    assert slope(p=p, q=q) == 3 * q * p**2 * (1 - q) / (1 - q + q * p**3) ** 2
    from symcheck.numerics.bernstein import sign_on

    box = {n: (Fraction(1, 10), Fraction(9, 10)) for n in "pq"}
    assert sign_on([slope.top], slope.field, box) == 1  # the denominator is a square


def test_plots() -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from symcheck.view import plot_function, plot_regions

    result = (
        symcheck.loads(CHOICE)
        .parametric("p,q")
        .with_options(regions=0.8)
        .check("Pmax>=0.5 [ F s=1 ]")
    )
    drawn = {p.get_bbox().bounds for p in plot_regions(result.regions).patches}
    regions = result.regions
    boxes = [*regions.empty, *regions.undecided, *(b for c in regions.cases for b in c.boxes)]
    assert regions.undecided
    assert drawn == {
        (float(x), float(y), float(right - x), float(top - y))
        for (x, right), (y, top) in (box.values() for box in boxes)
    }
    error = function(ZEROCONF, "p,q", "P=? [ F s=N+1 ]")
    box = {"p": (Fraction(0), Fraction(1)), "q": (Fraction(0), Fraction(1))}
    assert plot_function(error, box).get_ylabel() == "q"
    one = function(QUEUE, "x=1:2", "S=? [ n=2 ]")
    assert len(plot_function(one, {"x": (Fraction(1), Fraction(2))}).lines) == 1


@pytest.mark.parametrize("number", range(40))
def test_random_models_against_the_exact_engine(number: int) -> None:
    rng = Random(f"test {number}")
    kind = rng.choice(parameters.MODELS)
    text = parameters.random_model(rng, kind)
    wrong, _ = parameters.difference(rng, text, parameters.random_property(rng, kind))
    assert wrong is None


@pytest.mark.parametrize(
    ("text", "formula", "value_there"),
    [
        (PARABOLA, "P>0.5 [ F x=1 ]", False),
        (PARABOLA, "P<=0.5 [ F x=1 ]", True),
        (TIE, "Pmax=? [ F x=1 ] > 0.5", False),
        (PARABOLA, "P=? [ F<=0 (x=0 & P<=0.5 [ F x=1 ]) ]", 1),
    ],
)
def test_a_point_between_boxes_is_an_exception_of_its_own(
    text: str, formula: str, value_there: object
) -> None:
    model = symcheck.loads(text).parametric("p")
    result = model.check(formula)
    assert result.value is None
    assert result.regions.at(p=0.5).value == value_there != result.regions.at(p=0.25).value
    at_half = symcheck.loads(text, "p=0.5", exact=True).check(formula)
    assert at_half.value == value_there


def test_a_single_point_is_feasible_and_attains_an_extremum() -> None:
    parabola = symcheck.loads(PARABOLA).parametric("p")
    assert parabola.feasible("P<=0.5 [ F x=1 ]") == {"p": Fraction(1, 2)}
    jump = parabola.extremum("P=? [ F<=0 (x=0 & P<=0.5 [ F x=1 ]) ]", "max")
    assert jump.value == jump.bound == 1


@pytest.mark.parametrize("formula", ["R=? [ F x=1 ]", "P>0 [ F x=1 ]"])
def test_what_is_no_number_has_no_extremum(formula: str) -> None:
    with pytest.raises(UnsupportedError, match="only finite numbers have extremal values"):
        symcheck.loads(PARABOLA).parametric("p").extremum(formula, "max")


def test_lifting_decides_all_initial_states_and_refuses_nested_operators() -> None:
    text = "dtmc const double p; module m x:[0..2]; [] x=0 -> p:(x'=1)+1-p:(x'=2); endmodule"
    starts = symcheck.loads(text + " init x<2 endinit", lifting=True).parametric("p")
    regions = starts.check("P>=0.5 [ F x=1 ]").regions
    assert regions.at(p=0.75).value is True
    assert regions.at(p=0.25).value is False
    inner = "P>=0.3 [ F x=1 ] & P<=0.7 [ F x=1 ]"  # false at both ends of the range
    with pytest.raises(UnsupportedError, match="nested"):
        starts.check(f"P>=1 [ F x=0 & {inner} ]")


@pytest.mark.parametrize("formula", ["P=? [ F x=1 ]^p", "2^P=? [ F x=1 ]"])
def test_powers_with_functions_as_exponents_are_refused(formula: str) -> None:
    with pytest.raises(UnsupportedError, match="no rational function"):
        symcheck.loads(PARABOLA).parametric("p").check(formula)


def test_infinities_are_reckoned_with_functions() -> None:
    model = symcheck.loads(PARABOLA).parametric("p")
    infinite = "R=? [ F x=1 ]"  # x=2 is not left
    assert model.check(f"{infinite} + P=? [ F x=1 ]").value == float("inf")
    assert model.check(f"P=? [ F x=1 ] / {infinite}").value == 0
    slope = model.check(f"{infinite} * (P=? [ F x=1 ] - 5/8)").regions
    assert slope.at(p=0.1).value == float("inf")
    assert slope.at(p=0.4).value == float("-inf")


def test_poles_of_rewards_are_no_part_of_the_regions() -> None:
    text = PARABOLA.replace("true : 1", "x=0 : 1/((p-1/2)*(p-1/2))")
    result = symcheck.loads(text).parametric("p").check("R>=2 [ F x>0 ]")
    assert result.value is True
    assert [str(c) for c in result.regions.well_defined] == ["(p - 1/2)*(p - 1/2) > 0"]
    with pytest.raises(UsageError, match="no case"):
        result.regions.at(p=0.5)


def test_a_formula_that_divides_by_0_at_a_point_has_no_case_there() -> None:
    formula = "P=? [ F x=1 ] / (p-1/2) > 2"
    regions = symcheck.loads(PARABOLA).parametric("p").check(formula).regions
    assert regions.at(p=0.4).value is False
    assert regions.at(p=0.6).value is True
    with pytest.raises(NumericalError, match="bounds are not within"):
        symcheck.loads(PARABOLA).parametric("p").extremum("P=? [ F x=1 ] / (p-1/2)", "max")
    step = "min(1, max(0, P=? [ F x=1 ] / (p-1/2)))"  # from 0 to 1, without a value at 1/2
    assert symcheck.loads(PARABOLA).parametric("p").extremum(step, "max").bound == 1


def test_how_values_compare_within_a_solution_is_no_case_of_its_own() -> None:
    """The rewards 2/x and 5/7 of two steps are the same where x is 14/5."""
    text = """ctmc const double x;
    module m s : [0..2]; [] s=0 -> x:(s'=1); [] s=1 -> 7:(s'=2); [] s=2 -> true; endmodule
    rewards s=0 : 2; s=1 : 5; endrewards"""
    result = symcheck.loads(text).parametric("x=1:10").check("R=? [ F s=2 ]")
    assert str(result.value) == "(5*x+14)/(7*x)"
    assert not result.regions.undecided


def test_decimals_beside_functions_are_what_they_look_like() -> None:
    model = symcheck.loads(PRODUCT).parametric("p,q")
    f = model.check("P=? [ X x=1 ]").function
    f.field.sample({"p": Fraction(1, 10), "q": Fraction(1, 2)})
    assert not f < 0.1
    assert f <= 0.1  # which is 1/10, and no binary fraction
    assert (f < 0.001) == (f < Fraction(1, 1000)) is False
    assert f * 0 + 0.1 == Fraction(1, 10)
    assert f * 0.5 == f / 2
    assert 0.5 - f == Fraction(1, 2) - f
    assert f - f + 0.5 == 0.5
    assert f < float("inf")
    assert f > float("-inf")
    with pytest.raises(UsageError, match="NaN"):
        _ = f < float("nan")
    with pytest.raises(UnsupportedError, match="whole powers"):
        _ = f**0.5


def test_a_function_has_one_hash_that_equal_functions_have() -> None:
    model = symcheck.loads(PRODUCT).parametric("p,q")
    f = model.check("P=? [ F x=3 ]").function
    known = {f: 1}
    f.field.sample({"p": Fraction(1, 3), "q": Fraction(1, 7)})
    assert f in known
    other = symcheck.loads(PRODUCT).parametric("p,q").check("P=? [ F x=3 ]").function
    assert other.field is not f.field
    assert other in known
    assert hash(f - f + 2) == hash(2)


def test_functions_of_several_models_are_compared_and_added() -> None:
    zeroconf = symcheck.loads(ZEROCONF).parametric("p,q").check("P=? [ F s=N+1 ]").function
    text = PRODUCT.replace("1-q:(x'=2)", "1-q:(x'=0)")  # divides by another factor
    other = symcheck.loads(text).parametric("p,q").check("P=? [ F x=3 ]").function
    assert zeroconf != other
    point = {"p": Fraction(1, 3), "q": Fraction(1, 4)}
    assert (zeroconf + other)(**point) == zeroconf(**point) + other(**point)
    one = symcheck.loads(QUEUE).parametric("x=1:2").check("S=? [ n=2 ]").function
    assert one != zeroconf
    with pytest.raises(UsageError, match="functions of x and p, q differ"):
        _ = one + zeroconf


def test_points_name_every_parameter_and_no_other() -> None:
    model = symcheck.loads(PRODUCT).parametric("p=0.1:0.4,q=0.2:0.6")
    result = model.check("P=? [ F x=3 ]")
    f = result.function
    assert f(p="1/3", q=0.3) == Fraction(1, 10)
    with pytest.raises(UsageError, match="z is no parameter; there are p, q"):
        f(p=0.5, q=0.5, z=1)
    with pytest.raises(UsageError, match="parameter q has no value"):
        f(p=0.5)
    with pytest.raises(UsageError, match=r"p='abc'.* is no finite number"):
        f(p="abc", q=1)
    with pytest.raises(UsageError, match="zz is no parameter"):
        f.derivative("zz")
    with pytest.raises(UsageError, match=r"p is not within the open ranges p=1/10:2/5, q=1/5:3/5"):
        result.regions.at(p=0.4, q=0.3)
    with pytest.raises(UsageError, match="q has no value"):
        result.regions.at(p=0.3)


@pytest.mark.parametrize(
    ("formula", "value"),
    [
        ("P=? [ F x=0 ]", 1),
        ("P=? [ F x=5 ]", 0),
        ("P=? [ G F x=0 ]", 0),
        ("filter(count, x=1)", 1),
        ("filter(state, P=? [ F x=3 ], x=3)", 1),
    ],
)
def test_numbers_that_the_graph_decides_are_functions(formula: str, value: int) -> None:
    result = symcheck.loads(PRODUCT).parametric("p,q").check(formula)
    assert result.function == value == result.function(p=0.5, q=0.5)


def test_truth_values_and_infinities_are_no_functions() -> None:
    for formula in ("P>0 [ F x=1 ]", "R=? [ F x=1 ]"):
        result = symcheck.loads(PARABOLA).parametric("p").check(formula)
        assert not hasattr(result, "function")


def test_sympy_is_named_where_it_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sympy", None)
    with pytest.raises(UnsupportedError, match="needs sympy") as caught:
        function(PRODUCT, "p,q", "P=? [ F x=3 ]").to_sympy()
    assert caught.value.hint == "pip install sympy"


def test_a_search_that_ends_early_says_which_share_it_has_reached() -> None:
    model = symcheck.loads(UNEQUAL).parametric("p,q").with_options(regions=0.9999)
    result = model.check("Pmax=? [ F x=1 ]")
    (warning,) = [w for w in result.warnings if "boxes" in w]
    assert f"{result.regions.share:.2%} of the volume are decided, and 99.99% were" in warning
    assert not any(
        "boxes" in w for w in model.with_options(regions=0.9).check("P<1 [ X x=1 ]").warnings
    )


def test_cases_are_counted_as_they_are_listed() -> None:
    text = "mdp const double p; const double q; module m x:[0..2];"
    text += "[a] x=0 -> p:(x'=1)+1-p:(x'=2); [b] x=0 -> q:(x'=1)+1-q:(x'=2); endmodule"
    result = symcheck.loads(text).parametric("p,q").check("Pmax>=0.5 [ F x=1 ]")
    assert len(result.regions.cases) > 2
    assert result.explanation.startswith("2 cases")
    assert len(str(result.regions).splitlines()) == 3


def test_one_strategy_for_each_case_is_said(tmp_path: Path) -> None:
    model = symcheck.loads(UNEQUAL).parametric("p,q").with_options(strategy=True, regions=0.9)
    result = model.check("Pmax=? [ F x=1 ]")
    assert "no strategy: each of 2 cases has one (Python: result.regions.cases)" in result.warnings
    with pytest.raises(AttributeError, match="each of 2 cases has one"):
        _ = result.strategy


def test_a_value_by_regions_is_exported_as_what_it_is(tmp_path: Path) -> None:
    file, results = tmp_path / "unequal.nm", tmp_path / "results.csv"
    file.write_text(UNEQUAL)
    words = [str(file), "-param", "p,q", "-pf", "Pmax=? [ F x=1 ]", "-exportresults", str(results)]
    subprocess.run([sys.executable, "-m", "symcheck", *words], check=True, capture_output=True)
    row = results.read_text().splitlines()[1]
    assert row.endswith("the value differs by regions: 24.51% q; 74.50% (p+1)/2; 0.99% undecided")
