"""The search for initial states against the interpreter, which tries every valuation of the variables."""

from __future__ import annotations

from random import Random

import pytest

import symcheck
from symcheck.errors import InputError, ModelFault, UnsupportedError
from symcheck.explicit.initial import initial_states
from symcheck.semantics import interpreter
from symcheck.semantics.binding.bind import bind
from symcheck.semantics.expressions import evaluate as evaluator
from symcheck.semantics.model import BoundModel
from symcheck.syntax.parse import parse_model


def model(condition: str, variables: str = "", *, exact: bool = True) -> BoundModel:
    """A model of two ints, a bool and other variables, with a condition on initial states."""
    text = f"dtmc module m x:[0..3]; y:[-2..2]; b:bool; {variables} [] true -> true; endmodule init {condition} endinit"
    return bind(parse_model(text), {}, exact=exact)


def random_condition(rng: Random, depth: int) -> str:
    """Integers, real numbers, and remainders without a value."""
    if depth == 0:
        left, right = (
            rng.choice(
                [
                    "x",
                    "y",
                    "x+y",
                    "x*y",
                    "x*0.1+0.2",
                    "y/3",
                    "0.3",
                    "1",
                    "mod(5,x)",
                    "floor(x*0.7*10)",
                ]
            )
            for _ in "lr"
        )
        return rng.choice([f"{left}{rng.choice(['=', '<', '>=', '!='])}{right}", "b", "!b"])
    parts = [random_condition(rng, depth - 1) for _ in "lr"]
    return f"({parts[0]}{rng.choice(['&', '&', '|', '=>'])}{parts[1]})"


@pytest.mark.parametrize("seed", range(300))
def test_the_states_are_those_of_the_interpreter(seed: int) -> None:
    rng = Random(f"initial {seed}")
    bound = model(random_condition(rng, rng.choice([0, 1, 2, 3])))
    try:
        expected = interpreter.initial_states(bound)
    except InputError as fault:
        if "no state satisfies" not in str(fault):
            return  # conjuncts are evaluated in another order, see below
        with pytest.raises(ModelFault, match="no state satisfies"):
            initial_states(bound)
        return
    assert tuple(initial_states(bound)) == expected


def test_a_value_is_needed_only_where_no_other_conjunct_is_false() -> None:
    for condition in ("x>y & mod(3,x)=0 & y=-1+1", "mod(3,x)=0 & x>y & y=0"):
        for exact in (True, False):
            states = initial_states(model(condition, exact=exact))
            assert states == [(x, 0, b) for x in (1, 3) for b in (False, True)]
    with pytest.raises(ModelFault, match=r"x=0"):
        initial_states(model("mod(3,x)=0 & b"))


def test_exact_arithmetic_does_not_round() -> None:
    assert {s[0] for s in initial_states(model("x*0.1+0.2=0.3"))} == {1}
    assert {s[0] for s in initial_states(model("floor(x*0.7*10)=7"))} == {1}


@pytest.mark.parametrize("condition", ["a+b2=3 & c=b2 & 2*d=a", "a+b2+c+d=2"])
def test_exact_arithmetic_does_not_try_every_valuation(
    condition: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    variables = " ".join(f"{name}:[0..60];" for name in ("a", "b2", "c", "d"))
    text = f"dtmc module m {variables} [] true -> true; endmodule init {condition} endinit"
    evaluations = 0
    original = evaluator._evaluate

    def counted(*arguments: object) -> object:
        nonlocal evaluations
        evaluations += 1
        return original(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(evaluator, "_evaluate", counted)
    engine = symcheck.loads(text, exact=True).engine
    assert evaluations < 2000
    assert set(engine.valuations(engine.initial)) == {
        (a, b, c, d)
        for a in range(4)
        for b in range(4)
        for c in range(4)
        for d in range(4)
        if (a + b == 3 and c == b and 2 * d == a if "&" in condition else a + b + c + d == 2)
    }


@pytest.mark.parametrize("exact", [True, False])
def test_a_model_without_variables_has_one_state_or_none(exact: bool) -> None:
    text = "dtmc module m [] true -> true; endmodule init {} endinit"
    assert symcheck.loads(text.format("1<2"), exact=exact).check("P=? [ X true ]").value == 1
    with pytest.raises(ModelFault, match="no state satisfies"):
        symcheck.loads(text.format("2<1"), exact=exact).check("P=? [ X true ]")


def test_a_wide_variable_with_one_value_is_not_enumerated() -> None:
    text = f"dtmc module m x:[0..{2**61}]; [] true -> true; endmodule init x=7 endinit"
    for options in ({"exact": True}, {"engine": "explicit"}):
        assert symcheck.loads(text, **options).check("P=? [ X x=7 ]").value == 1
    with pytest.raises(UnsupportedError, match="use the explicit engine"):
        symcheck.loads(text, engine="mtbdd").check("P=? [ X x=7 ]")


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize(
    ("condition", "count"),
    [
        ("x*0.1+0.2=0.3", 5),
        ("log(x+1,2)=y", 3),
        ("floor(x*pow(2,0.5))=y", 4),
        ("x=0 | mod(y,x)=1", 10),
        ("9007199254740993*x=9007199254740993.0*y", 5),
    ],
)
def test_conditions_with_real_numbers_are_decided_alike_in_both_arithmetics(
    condition: str, count: int, exact: bool
) -> None:
    text = f"dtmc module m x:[0..4]; y:[0..4]; [] true -> true; endmodule init {condition} endinit"
    assert symcheck.loads(text, exact=exact).check("filter(count, true)").value == count
