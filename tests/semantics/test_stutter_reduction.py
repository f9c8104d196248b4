"""Stutter reduction keeps the values of the properties that do not count steps."""

from __future__ import annotations

from random import Random

import pytest

from semantics.test_reset_dead_variables import _value, count, phased
from symcheck.check.checker import check
from symcheck.check.property_instance import PropertyInstance, reduced
from symcheck.engines.registry import build
from symcheck.errors import SymcheckError
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind, bind_properties
from symcheck.semantics.model import BoundModel
from symcheck.semantics.reduction.reset_dead_variables import Reduction, observe, reduce
from symcheck.semantics.reduction.stutter_reduction import counts_steps
from symcheck.syntax.parse import parse_model, parse_properties

LOOP = """dtmc
module m
  pc : [0..5]; x : [0..7] init 1; t : [0..20]; u : [0..9];
  [] pc=0 -> 0.5 : (x'=min(x+1,7)) & (pc'=1) + 0.5 : (x'=max(x-1,0)) & (pc'=1);
  [] pc=1 -> (t'=2*x+3) & (pc'=2);
  [] pc=2 -> (u'=mod(t,5)) & (t'=0) & (pc'=3);
  [] pc=3 & u<4 & x>0 -> (pc'=0);
  [] pc=3 & (u=4 | x=0) -> (pc'=4);
  [] pc=4 -> (pc'=5);
  [] pc=5 -> true;
endmodule
label "high" = x>4;
label "two" = pc=2;
"""
EXPLICIT = Options(engine="explicit")


def reduction(text: str, asked: str) -> tuple[BoundModel, Reduction]:
    model = bind(parse_model(text), {})
    bound = bind_properties(parse_properties(asked), model)
    return model, reduce(model, observe(model, [p.formula for p in bound.properties], bound.labels))


def answer(model: BoundModel, asked: str) -> object:
    bound = bind_properties(parse_properties(asked), model)
    return check(
        build(model, EXPLICIT), bound.properties[0].formula, EXPLICIT, labels=bound.labels
    ).value


@pytest.mark.parametrize(
    ("asked", "passed"),
    [
        ('P=? [ F "high" ]', 3),  # pc=1, 2 and 4; pc=5 is a loop, and pc=3 has a choice
        ('P=? [ "high" U x=0 ]', 3),
        ("P=? [ G (F x=3) ]", 3),
        ('P=? [ F "two" & x=3 ]', 1),  # only pc=4
        ("P=? [ F t=9 ]", 1),
        ("P=? [ F pc=4 ]", 2),
        ('E [ F "deadlock" ]', 2),  # pc=3 might be one, as far as guards tell
        ("P=? [ F<=5 x=3 ]", 0),
        ("P=? [ X x=2 ]", 0),
        ("P=? [ F (X x=2) ]", 0),
        ("S=? [ x=2 ]", 0),
        ("filter(max, P=? [ F x=3 ])", 0),
    ],
)
def test_what_is_passed_over(asked: str, passed: int) -> None:
    model, found = reduction(LOOP, asked)
    assert found.eliminated == passed
    assert (count(found.model) < count(model)) == (passed > 0 or "x" not in asked)
    assert answer(found.model, asked) == pytest.approx(answer(model, asked), abs=1e-9)


def test_which_formulas_count_steps() -> None:
    model = bind(parse_model(LOOP), {})

    def counting(asked: str) -> bool:
        return counts_steps(bind_properties(parse_properties(asked), model).properties[0].formula)

    assert not any(
        map(
            counting,
            (
                'P>0.5 [ F "high" ]',
                'P=? [ ("high" W x=2) & !(x=1 R "high") ]',
                "A [ G (E [ F x=1 ]) ]",
            ),
        )
    )
    assert all(
        map(
            counting,
            ("P=? [ F>=2 x=1 ]", "P=? [ F P>=1 [ X x=1 ] ]", "P=? [ G (x=1 => (F<=3 x=2)) ]"),
        )
    )


def test_runs_keep_their_length_where_it_is_asked_for() -> None:
    model = bind(parse_model(LOOP), {})
    instances = [PropertyInstance(parse_properties('P=? [ F "high" ]'), 0, {})]
    assert reduced(model, instances).eliminated == 0
    assert reduced(model, instances, keep_steps=False).eliminated == 3
    assert reduced(model, [], keep_steps=False).eliminated == 0


@pytest.mark.parametrize("overwritten", [False, True])
def test_a_value_out_of_range_on_the_way_is_still_found(overwritten: bool) -> None:
    last = "(y'=0) & " if overwritten else ""
    text = f"""dtmc module m pc : [0..3]; x : [0..3]; y : [0..5];
    [] pc=0 -> 0.5 : (x'=2) & (pc'=1) + 0.5 : (x'=3) & (pc'=1);
    [] pc=1 -> (y'=x+3) & (pc'=2); [] pc=2 -> {last}(pc'=3); [] pc=3 -> true; endmodule"""
    _, found = reduction(text, "P=? [ F x=2 ]")
    with pytest.raises(SymcheckError, match="y would become 6"):
        count(found.model)


def test_a_cycle_of_steps_that_nothing_observes_stays() -> None:
    text = """dtmc module m pc : [0..3]; x : [0..3];
    [] pc=0 -> 0.5 : (x'=2) & (pc'=1) + 0.5 : (x'=3) & (pc'=3);
    [] pc=1 -> (pc'=2); [] pc=2 -> (pc'=1); [] pc=3 -> true; endmodule"""
    model, found = reduction(text, "P=? [ G x<3 ]")
    assert found.eliminated == 0
    assert answer(found.model, "P=? [ G x<3 ]") == answer(model, "P=? [ G x<3 ]") == 0.5


def test_a_step_before_a_deadlock_is_seen_where_deadlocks_are_asked_for() -> None:
    text = """dtmc module m pc : [0..3]; x : [0..3];
    [] pc=0 -> 0.5 : (x'=2) & (pc'=1) + 0.5 : (x'=3) & (pc'=1); [] pc=1 -> (pc'=2); [] pc=2 & x=2 -> (pc'=0); endmodule"""
    assert reduction(text, "P=? [ F x=3 ]")[1].eliminated == 1
    model, found = reduction(text, 'P=? [ x<3 U "deadlock" ]')
    assert found.eliminated == 0
    assert answer(found.model, 'P=? [ x<3 U "deadlock" ]') == answer(
        model, 'P=? [ x<3 U "deadlock" ]'
    )


def test_what_another_module_takes_part_in_stays() -> None:
    text = """dtmc module m pc : [0..2]; [] pc=0 -> (pc'=1); [a] pc=1 -> (pc'=2); [] pc=2 -> (pc'=0); endmodule
    module n y : [0..1]; [a] y=0 -> (y'=1); [a] y=1 -> (y'=0); endmodule"""
    model, found = reduction(text, "P=? [ F y=1 ]")
    assert answer(found.model, "P=? [ F y=1 ]") == answer(model, "P=? [ F y=1 ]") == 1.0


def chained(rng: Random, kind: str) -> str:
    """A loop of phases most of which do one thing for certain."""
    phases, data = rng.randint(3, 6), ["x", "y", "z"]
    lines = [
        kind,
        "module m",
        f"  s : [0..{phases}];",
        *(f"  {n} : [0..3] init {rng.randint(0, 3)};" for n in data),
    ]
    for s in range(phases + 1):
        split = rng.random() < 0.35
        for condition in (
            (f" & {rng.choice(data)}>1", f" & {rng.choice(data)}<=1") if split else ("",)
        ):
            parts = []
            for _ in range(rng.choice((1, 1, 1, 2))):
                new = [
                    f"({n}'={_value(rng, data, 3)})"
                    for n in rng.sample(data, rng.choice((0, 1, 2)))
                ]
                to = rng.choice((s, s + 1, s + 1, s + 1, rng.randint(0, phases)))
                parts.append("&".join([*new, f"(s'={to if to <= phases else 0})"]))
            lines.append(
                f"  [] s={s}{condition} -> "
                + " + ".join(f"{1 / len(parts)}:{p}" for p in parts)
                + ";"
            )
    return "\n".join(
        [
            *lines,
            "endmodule",
            f'label "a" = x>{rng.randint(0, 2)};',
            f'label "b" = s={rng.randint(0, phases)} & y=z;',
        ]
    )


ASKED = (
    'P{}=? [ F "a" & "b" ]',
    'P{}=? [ "a" U "b" ]',
    'P{}=? [ G (F "a") ]',
    'P{}=? [ ("a" U "b") | (G !"a") ]',
    'P{}=? [ F ("a" & ("b" R "a")) ]',
    'E [ F "deadlock" ]',
    'A [ G (E [ F "b" ]) ]',
    'P{}=? [ "a" W "deadlock" ]',
)


@pytest.mark.parametrize("seed", range(60))
def test_random_loops_keep_their_values(seed: int) -> None:
    rng = Random(seed)
    kind = rng.choice(("dtmc", "mdp"))
    text = chained(rng, kind) if rng.random() < 0.8 else phased(rng, kind)
    asked = rng.choice(ASKED).format("" if kind == "dtmc" else rng.choice(("min", "max")))
    model, found = reduction(text, asked)
    try:
        expected = answer(model, asked)
    except SymcheckError as error:
        with pytest.raises(type(error)):
            answer(found.model, asked)
        return
    assert answer(found.model, asked) == pytest.approx(expected, abs=1e-7), (text, asked)
