"""Observables: how they are written, what they are named, and their faults."""

from __future__ import annotations

import pytest

import symcheck
from symcheck.errors import InputError, SyntaxFault
from symcheck.syntax.parse import parse_model
from symcheck.syntax.printer import pretty

TEXT = """pomdp
observables x, b endobservables
observable "near" = x + y < 3;
observable "sum" = x + y;
module m
  x : [0..3]; y : [0..3]; b : bool;
  [go] true -> 0.5:(x'=min(x+1,3)) + 0.5:(y'=min(y+1,3));
endmodule
observables endobservables
"""


def test_both_forms_are_read_and_printed():
    program = parse_model(TEXT)
    assert [o.name for o in program.observables] == [None, None, "near", "sum"]
    assert parse_model(pretty(program)) == program


def test_conditions_are_labels_unless_a_label_has_the_name():
    model = symcheck.loads(TEXT)
    assert model.check('Pmax=? [ F<=1 !"near" ]').value == 0
    assert 'label "near"' not in pretty(parse_model(TEXT))
    shadowed = symcheck.loads(TEXT + 'label "near" = x=3;')
    assert shadowed.bound.labels["near"] != model.bound.labels["near"]


def test_numbers_are_no_labels():
    with pytest.raises(InputError, match='unknown label or property "sum"'):
        symcheck.loads(TEXT).check('Pmax=? [ F "sum" ]')


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (TEXT.replace("x, b", "x, z"), "z"),
        (TEXT.replace('"sum"', '"near"'), 'there is a label "near" already'),
        (TEXT.replace("x + y < 3", "x & y"), "int"),
    ],
)
def test_faults(text, message):
    with pytest.raises(InputError, match=message):
        symcheck.loads(text).engine  # noqa: B018


def test_a_block_that_does_not_end():
    with pytest.raises(SyntaxFault, match="endobservables"):
        parse_model("pomdp observables x module m x : bool; endmodule")


def test_without_observables_nothing_is_seen():
    """Both coins are alike, so no strategy is better than chance."""
    blind = """pomdp module m s : [0..2]; d : bool;
      [toss] !d -> 0.4:(s'=0)&(d'=true) + 0.6:(s'=1)&(d'=true);
      [toss] d -> true; endmodule"""
    assert symcheck.loads(blind).check("Pmax=? [ F<=1 true ]").value == 1
