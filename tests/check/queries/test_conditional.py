"""Conditional probabilities: by hand, by all strategies with memory one by one, and by Storm."""

from __future__ import annotations

import itertools
from fractions import Fraction
from itertools import islice
from math import isnan

import pytest

import symcheck
from checking import check_text, engine_of
from generate import bound_models
from symcheck.errors import InputError, UnsupportedError

ENGINES = ("explicit", "sparse", "hybrid", "mtbdd", "exact")

DICE = """
dtmc
module dice
  s : [0..2];  // dice thrown
  x : [0..6];
  y : [0..6];
  [] s=0 -> 1/6:(x'=1)&(s'=1) + 1/6:(x'=2)&(s'=1) + 1/6:(x'=3)&(s'=1)
          + 1/6:(x'=4)&(s'=1) + 1/6:(x'=5)&(s'=1) + 1/6:(x'=6)&(s'=1);
  [] s=1 -> 1/6:(y'=1)&(s'=2) + 1/6:(y'=2)&(s'=2) + 1/6:(y'=3)&(s'=2)
          + 1/6:(y'=4)&(s'=2) + 1/6:(y'=5)&(s'=2) + 1/6:(y'=6)&(s'=2);
endmodule
"""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("F x=6 || F s=2 & x+y>=10", Fraction(3, 6)),  # (6,4) (6,5) (6,6) of six
        ("F x=6 & y=6 || F x=6 | y=6", Fraction(1, 11)),
        ("F x=6 || X x>3", Fraction(1, 3)),
        ("F<=1 x=6 || F[2,2] y=6", Fraction(1, 6)),
        ("(F x=6) & (F y=1) || G x!=5", Fraction(1, 30)),
        ("G y!=6 || F x=6 & s=1", Fraction(5, 6)),
        ("X X y=6 || (F x=6) | (F y=6)", Fraction(6, 11)),
    ],
)
def test_two_dice(engine, path, value):
    model = engine_of(DICE, engine)
    result = check_text(model, f"P=? [ {path} ]").value
    assert result == (value if engine == "exact" else pytest.approx(float(value), rel=1e-9))
    assert check_text(model, f"P>={value} [ {path} ]").value is True
    assert check_text(model, f"P>{value} [ {path} ]").value is False


def test_a_ctmc():
    race = """
    ctmc
    module race
      x : [0..3];
      [] x=0 -> 3 : (x'=1) + 1 : (x'=2);
      [] x=1 -> 4 : (x'=3);
      [] x=2 -> 1 : (x'=3) + 1 : (x'=0);
    endmodule
    """
    # From 0 to 2 with 1/4, and back with 1/2: without a visit of 2, 3/4.
    assert symcheck.loads(race).check("P=? [ F x=2 || F x=3 ]").value == pytest.approx(1 / 4)
    with pytest.raises(UnsupportedError, match="time"):
        symcheck.loads(race).check("P=? [ F<=1 x=2 || F x=3 ]")


BRANCH = """
mdp
module m
  s : [0..6] init 0;
  [left] s=0 -> 1/2 : (s'=1) + 1/2 : (s'=2);
  [right] s=0 -> 1/10 : (s'=1) + 9/10 : (s'=3);
  [wait] s=0 -> true;
  [up] s=1 -> 1/4 : (s'=4) + 3/4 : (s'=5);
  [down] s=1 -> (s'=5);
  [on] s=2 -> 1/2 : (s'=4) + 1/2 : (s'=6);
  [] s=3 -> true;
  [] s=4 -> 2/3 : (s'=5) + 1/3 : (s'=6);
  [] s>=5 -> true;
endmodule
label "a" = s=4;
label "b" = s=5;
"""


@pytest.mark.parametrize("engine", ENGINES)
def test_an_mdp(engine):
    model = engine_of(BRANCH, engine)
    # left, up: a & b with (1/8 + 1/4) 2/3, b with 3/8 besides. right, up: 1/40 · 2/3 and 3/40.
    greatest = Fraction(2, 5)
    value = check_text(model, 'Pmax=? [ F "a" || F "b" ]').value
    assert value == (greatest if engine == "exact" else pytest.approx(float(greatest), rel=1e-6))
    # right, down meets b without a.
    assert check_text(model, 'Pmin=? [ F "a" || F "b" ]').value == 0
    assert check_text(model, 'Pmax=? [ G !"a" || F "b" ]').value == 1
    assert check_text(model, 'P<=2/5 [ F "a" || F "b" ]').value is True
    assert check_text(model, 'P<2/5 [ F "a" || F "b" ]').value is False
    least = Fraction(3, 5)
    value = check_text(model, 'Pmin=? [ G !"a" || F "b" ]').value
    assert float(value) == pytest.approx(float(least), rel=1e-6)


@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
def test_a_condition_of_probability_zero_is_an_error(kind):
    model = symcheck.loads(BRANCH if kind == "mdp" else DICE.replace("y>6", "false"))
    text = 'Pmax=? [ F "a" || F s=3 & s=4 ]' if kind == "mdp" else "P=? [ F x=1 || F y>7 ]"
    with pytest.raises(InputError, match="undefined in state"):
        model.check(text)
    if kind == "mdp":
        with pytest.raises(InputError, match="undefined in state"):
            model.check('filter(max, Pmax=? [ F "a" || F "b" ])')
        assert isnan(model.check('Pmax=? [ F "a" || F "b" ]').values[{"s": 3}])


@pytest.mark.parametrize("engine", ENGINES)
def test_a_condition_that_no_state_can_meet_is_an_error_for_g_too(engine):
    with pytest.raises(InputError, match="undefined in state"):
        check_text(engine_of(BRANCH, engine), 'Pmax=? [ G "deadlock" || F s=3 & s=4 ]')


def models(kind: str, count: int) -> list[str]:
    return [m.text for m in islice(bound_models("conditional", kind), count)]


def by_strategies(text: str) -> tuple[Fraction, Fraction] | None:
    """Least and greatest P(F a | F b) over strategies that remember which of a and b were met.

    They suffice for the optimum (Baier et al. 2014). None if no strategy reaches b.
    """
    engine = engine_of(text, "exact")
    a, b = (check_text(engine, f'"{name}"').satisfying.mask for name in ("a", "b"))
    matrix = engine.system(engine.all).matrix
    groups = matrix.groups
    start = int(engine.numbers(engine.initial)[0])
    rows = {
        r: [
            (int(matrix.indices[e]), Fraction(matrix.data[e]))
            for e in range(matrix.indptr[r], matrix.indptr[r + 1])
        ]
        for r in range(matrix.rows)
    }

    def seen(state: int, memory: tuple[bool, bool]) -> tuple[bool, bool]:
        return memory[0] or bool(a[state]), memory[1] or bool(b[state])

    first = (start, seen(start, (False, False)))
    pairs, waiting = {first}, [first]
    while waiting:
        state, memory = waiting.pop()
        for r in range(groups[state], groups[state + 1]):
            for t, _ in rows[r]:
                pair = (t, seen(t, memory))
                if pair not in pairs:
                    pairs.add(pair)
                    waiting.append(pair)
    open_pairs = sorted(p for p in pairs if p[1] != (True, True))
    choices = [range(groups[s], groups[s + 1]) for s, _ in open_pairs]
    count = 1
    for c in choices:
        count *= len(c)
    if count > 3000:
        return None
    found = []
    for chosen in itertools.product(*choices):
        policy = dict(zip(open_pairs, chosen, strict=True))
        value = _joint(policy, rows, seen, first)
        if value is not None:
            found.append(value)
    return (min(found), max(found)) if found else None


def _joint(policy, rows, seen, first) -> Fraction | None:
    """P(F a & F b) / P(F b) of the chain of a strategy, by elimination."""
    import numpy as np

    index = {p: i for i, p in enumerate(policy)}
    n = len(index)
    if first not in index:
        return Fraction(1)
    step = np.zeros((n, n))
    both = np.zeros(n)
    for pair, r in policy.items():
        for t, p in rows[r]:
            after = (t, seen(t, pair[1]))
            if after in index:
                step[index[pair], index[after]] += float(p)
            else:
                both[index[pair]] += float(p)
    # Total probability of (both) and of b first, by many steps of the chain.
    power = np.linalg.matrix_power(step, 1 << 16)
    series, term = np.eye(n), step
    for _ in range(16):
        series, term = series + term @ series, term @ term
    joint = (series @ both)[index[first]]
    ends_b = sum(power[index[first], i] for p, i in index.items() if p[1][1])
    total = joint + ends_b
    return None if total < 1e-9 else Fraction(joint / total)


@pytest.mark.parametrize("text", models("mdp", 25))
def test_mdps_agree_with_all_strategies(text):
    expected = by_strategies(text)
    if expected is None:
        pytest.skip("too many strategies, or the condition is never met")
    for direction, value in zip(("min", "max"), expected, strict=True):
        formula = f'P{direction}=? [ F "a" || F "b" ]'
        for engine in ("explicit", "hybrid", "exact"):
            result = check_text(engine_of(text, engine), formula)
            assert float(result.value) == pytest.approx(float(value), abs=1e-5), (formula, engine)


@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
def test_values_are_storms(kind, tmp_path):
    stormpy = pytest.importorskip("stormpy", reason="Storm's Python package is not installed")
    compared = 0
    for source in models(kind, 25):
        file = tmp_path / "model.prism"
        file.write_text(source)
        program = stormpy.parse_prism_program(str(file))
        for direction in ("min", "max") if kind == "mdp" else ("",):
            text = f'P{direction}=? [ F "a" || F "b" ]'
            try:
                ours = check_text(engine_of(source), text).value
            except InputError:
                continue  # undefined
            properties = stormpy.parse_properties(text, program)
            built = stormpy.build_model(program, properties)
            theirs = stormpy.model_checking(built, properties[0], only_initial_states=True)
            value = theirs.get_value(built.initial_states[0])
            assert ours == pytest.approx(value, abs=1e-4), (text, source)
            compared += 1
    assert compared >= 10


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('Pmax=? [ X "a" || F "b" ]', "F a || F b"),
        ('Pmax=? [ F "a" || G "b" ]', "F a || F b"),
        ('Pmax=? [ F<=3 "a" || F "b" ]', "F a || F b"),
    ],
)
def test_what_is_not_supported_says_what_is(text, message):
    with pytest.raises(UnsupportedError) as error:
        symcheck.loads(BRANCH).check(text)
    assert message in str(error.value)


# ------------------------------------------------------------------------------ tiny probabilities

TREE = """{kind}
module tree
  s : [0..6];
  [] s=0 -> {p}:(s'=1) + 1-{p}:(s'=5);
  {more}
  [] s=1 -> {q}:(s'=2) + 1-{q}:(s'=5);
  [] s=2 -> {r}:(s'=3) + {rest}:(s'=4);
endmodule
label "a" = s=3;
label "b" = s=2;
label "never" = s=6;
"""
"""The condition s=2 has the probability p q, and the target s=3 given it the probability r."""


def close(result, value: Fraction) -> bool:
    """Whether a result states an accuracy that is true, relative, and as good as requested."""
    found = Fraction(result.value)
    lower, upper = result.bounds
    assert lower <= value <= upper
    return abs(found - value) <= Fraction(1, 10**6) * abs(value)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
@pytest.mark.parametrize(
    ("p", "q", "r"),
    [
        ("1e-200", "1e-200", "0.25"),  # the condition underflows
        ("1e-300", "1e-100", "1e-9"),
        ("1e-200", "1", "1e-150"),  # the numerator does
        ("1e-300", "0.5", "1e-300"),
        ("0.5", "0.5", "1e-9"),  # 1 minus a probability
        ("1e-12", "0.5", "1e-13"),
        ("1e-16", "1", "0.999999999999"),
    ],
)
def test_quotients_of_tiny_values_are_accurate(engine, kind, p, q, r):
    more = "[] s=0 -> 1e-5:(s'=3) + 1-1e-5:(s'=5);" if kind == "mdp" else ""
    rest = "1e-12" if r == "0.999999999999" else f"1-{r}"
    model = symcheck.loads(
        TREE.format(kind=kind, p=p, q=q, r=r, rest=rest, more=more), engine=engine
    )
    value = Fraction(r)
    for operator in ("P",) if kind == "dtmc" else ("Pmin", "Pmax"):
        asked = f'{operator}=? [ F "a" || F "b" ]', f'{operator}=? [ G !"a" || F "b" ]'
        for text, expected in zip(asked, (value, 1 - value), strict=True):
            result = model.check(text)
            assert close(result, expected), (text, result)
            assert not result.warnings
    assert model.check('P>0 [ F "a" || F "b" ]').value is True
    assert model.check('P<1 [ F "a" || F "b" ]').value is True
    assert model.check(f'P>={r} [ F "a" || F "b" ]').value is True
    assert model.check(f'P>{r} [ F "a" || F "b" ]').value is False


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
def test_a_condition_that_underflows_is_not_one_of_probability_zero(engine, kind):
    text = TREE.format(kind=kind, p="1e-300", q="1e-300", r="1e-300", rest="1-1e-300", more="")
    model = symcheck.loads(text, engine=engine)
    operator = "P" if kind == "dtmc" else "Pmax"
    assert close(model.check(f'{operator}=? [ F "a" || F "b" ]'), Fraction("1e-300"))
    with pytest.raises(InputError, match="undefined"):
        model.check(f'{operator}=? [ F "a" || F "never" ]')


def test_a_quotient_that_no_arithmetic_gives_says_how_wide_its_bounds_are(monkeypatch):
    monkeypatch.setattr("symcheck.numerics.rational_limits.CONDITIONAL_STATES", 3)
    text = TREE.format(kind="dtmc", p="1e-200", q="1e-200", r="0.25", rest="0.75", more="")
    result = symcheck.loads(text).check('P=? [ F "a" || F "b" ]')
    assert result.accuracy.lower <= 0.25 <= result.accuracy.upper
    assert any("the condition is improbable" in w for w in result.warnings)
