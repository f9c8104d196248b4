"""All evaluators of expressions agree on the whole range of ints, on values and on errors.

The scalar evaluator is the reference. The others are the vectorised evaluator, the compiled register machine, and the
diagrams (tabulated, composed and learned).
"""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import symcheck
from checking import check_text, engine_of
from kernels.columns import run_masked
from symbolic.oracle import at, bound
from symcheck.errors import InputError, ModelFault
from symcheck.explicit.build import explore as explore_explicitly
from symcheck.explicit.compile import compile_expression
from symcheck.options import Options
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.expressions.vectorised import evaluate_columns
from symcheck.semantics.model import BoundModel
from symcheck.symbolic.build import build
from symcheck.symbolic.matrix.transitions import transitions
from symcheck.symbolic.model import StateSpace
from symcheck.symbolic.reachability.search import reach
from symcheck.symbolic.tuning import EncodingLimits
from symcheck.syntax.ast import Type
from symcheck.syntax.operators import Function, Operator, Signature
from symcheck.syntax.parse import parse_expression
from syntax.operations import applications

BOUNDARIES = (
    *(0, 3, 2**31, 2**32, 3037000499, 2**53, 2**62, 3**39, 2**63 - 2),
    *(-(2**31), -(2**53), -(2**62), -(2**63) + 2),
)
WAYS = {
    "tabulated": EncodingLimits(),
    "composed": EncodingLimits(table_bits=0),
    "on the fly": EncodingLimits(table_bits=0, wide_table_bits=0, max_nodes=0, max_leaves=0),
}
WIDTH = 2
"""Each variable holds the ints up to so far from a boundary."""

_int = st.recursive(
    st.sampled_from(["x", "y", "1", "2", "-1", "7", "9007199254740993", "9223372036854775807"]),
    lambda inner: st.one_of(
        st.builds("({} {} {})".format, inner, st.sampled_from("+-*"), inner),
        *(
            st.builds(
                "{}({})".format,
                st.just(function),
                st.lists(inner, min_size=count, max_size=count).map(",".join),
            )
            for function, count in applications(Signature.ARITHMETIC, Signature.INTEGER)
            if isinstance(function, Function)
        ),
        st.builds("(-{})".format, inner),
        st.builds("({}={}?{}:{})".format, inner, inner, inner, inner),
        *(
            st.builds("{}({}/2)".format, st.just(function), inner)
            for function, _ in applications(Signature.ROUNDING)
        ),
    ),
    max_leaves=6,
)
_comparison = st.builds(
    "({} {} {})".format, _int, st.sampled_from([o for o in Operator if o.is_comparison]), _int
)
_bool = st.one_of(
    _comparison,
    st.builds(
        "({} {} {})".format,
        _comparison,
        st.sampled_from([o for o in Operator if o.is_logical]),
        _comparison,
    ),
)


@cache
def model_around(x: int, y: int) -> BoundModel:
    def declaration(name: str, value: int) -> str:
        return f"{name} : [{value - WIDTH + 1}-1..{min(value + WIDTH, 2**63 - 1)}];"

    return bound(
        f"dtmc module m {declaration('x', x)} {declaration('y', y)} [] true -> true; endmodule"
    )


def space_of(model: BoundModel, limits: EncodingLimits) -> StateSpace:
    symbolic = build(model, Options(), limits=limits)
    valid = [symbolic.translator.valid(v) for v in symbolic.encoding.variables]
    everything = symbolic.manager.conjunction(valid)
    return StateSpace(symbolic, everything, symbolic.manager.false, 25, "none", 0.0, ())


def scalar(expression, state):
    try:
        return evaluate(expression, dict(zip("xy", state, strict=True)))
    except InputError:
        return None


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(BOUNDARIES), st.sampled_from(BOUNDARIES), st.one_of(_int, _bool))
@example(3, 3, "pow(5,pow(x,3)) = 7450580596923828125")
@example(2**53, 2**53, "x = 9007199254740993")
@example(2**53, 3, "x + y")
@example(2**62, 2**62, "x + y")
@example(2**62, -(2**62), "x - y")
@example(2**63 - 2, 3, "mod(x, y - 4)")
@example(-(2**63) + 2, 3, "-x")
@example(-(2**63) + 2, 0, "x * y - 1")
@example(2**32, 2**31, "x * y")
@example(2**53, 0, "(x + (y + (-x)))")
@example(2**53, 0, "y = 0 | pow(y, x) = 1")
@example(2**62, 0, "y = 0 | x + x > 0")
@example(-(2**63) + 2, 0, "y = 0 | -x > 0")
@example(2**62, 0, "(y = 0 ? 1 : x * y) > 1")
def test_evaluators_agree_on_the_whole_range_of_ints(x, y, text):
    model, expression = model_around(x, y), parse_expression(text)
    values = [range(int(v.low), int(v.high) + 1) for v in model.variables]
    states = list(product(*values))
    expected = [scalar(expression, s) for s in states]
    columns = {
        n: np.array(c, np.int64) for n, c in zip("xy", zip(*states, strict=True), strict=True)
    }

    lanes = evaluate_columns(expression, columns).spread((len(states),))
    faults = np.zeros(len(states), bool) if lanes.faults is None else lanes.faults
    assert [
        None if f else v for f, v in zip(faults, lanes.values.tolist(), strict=True)
    ] == expected

    code = compile_expression(expression, model)
    found, valid = run_masked(code, dict(enumerate(columns.values())))
    found, valid = np.broadcast_to(found, len(states)), np.broadcast_to(valid, len(states))
    assert [v if ok else None for ok, v in zip(valid, found.tolist(), strict=True)] == expected

    for limits in WAYS.values():
        space = space_of(model, limits)
        translator = space.symbolic.translator
        if code.type is Type.BOOL:
            diagram = translator.boolean_on(expression, space.states)
        else:
            diagram = translator.number_on(expression, space.states)
        faults = translator.faults(expression)
        for state, value in zip(states, expected, strict=True):
            assert at(space, faults, state) == (value is None)
            if value is not None:
                assert at(space, diagram, state) == float(value)


@pytest.mark.parametrize("engine", ["explicit", "mtbdd", "hybrid", "sparse"])
def test_engines_agree_on_errors(engine, tmp_path):
    file = tmp_path / "countdown.pm"
    file.write_text(
        "dtmc module m x : [0..3] init 3; [] x>0 -> (x'=x-1); [] x=0 -> true; endmodule"
    )
    model = symcheck.load(file, engine=engine)
    with pytest.raises(InputError, match="beyond 64 bits"):
        model.check("P=? [ F x*4611686018427387904 = 0 ]")
    with pytest.raises(InputError, match=r"mod\(1, 0\) has no value"):
        model.check("P=? [ F mod(1,x) = 1 ]")
    assert model.check("P=? [ F x=0 | mod(1,x) = 1 ]").value == 1
    assert model.check("P=? [ F pow(5,pow(x,3)) = 7450580596923828125 ]").value == 1


@pytest.mark.parametrize("engine", ["explicit", "mtbdd", "hybrid", "sparse"])
@pytest.mark.parametrize("part", ["guard", "update", "reward"])
def test_engines_agree_on_errors_of_models(engine, part, tmp_path):
    guard, value, reward = (
        "mod(1, x) = 1" if part == wanted else other
        for wanted, other in (("guard", "false"), ("update", "true"), ("reward", "x > 0"))
    )
    file = tmp_path / "faulty.pm"
    file.write_text(
        f"dtmc module m x : [0..3] init 3; b : bool; [] x>0 -> (x'=x-1); [] {guard} -> (b'=true);"
        f"[] x=0 -> (b'={value}); endmodule rewards {reward} : 1; endrewards"
    )
    with pytest.raises(ModelFault, match=r"mod\(1, 0\) has no value"):
        symcheck.load(file, engine=engine).check("R=? [ F x=0 ]")


ENGINES = ["explicit", "exact", "sparse", "hybrid", "mtbdd"]
FAULTS = {
    "pow(10, 18 + x)": "int-overflow",
    "mod(3, x - 1)": "mod-zero",
    "pow(2, -x)": "pow-negative",
    "floor(x * 1.0E+30)": "int-overflow",
    "round(x * 1.0E+30) / 2": "int-overflow",
    "x / 0": "reward-not-finite",
    "(x - 1) / (x - 1)": "reward-not-finite",
    "log(-x, 2)": "reward-not-finite",
    "pow(1.0E+200, x + 1)": "reward-not-finite",
}
"""Rewards without a finite value at x=1, by the code of the fault."""


@pytest.mark.parametrize("kind", ["dtmc", "ctmc", "mdp"])
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("place", ["x=1", "[a] x=1", "[b] x>0"])
def test_a_faulty_reward_is_told_at_its_place_with_a_state(kind, engine, place):
    # Between x=0 and x=1, so that the fault is not met in the initial state.
    ways = "R=?" if kind != "mdp" else "Rmax=?"
    for value, code in FAULTS.items():
        if engine == "exact" and value == "pow(1.0E+200, x + 1)":
            continue  # it has a rational value
        text = (
            f"{kind} module m x:[0..2]; [c] x=0 -> (x'=1); [a] x=1 -> (x'=2); endmodule "
            "module n y:[0..1]; [b] y=0 -> (y'=1); [a] true -> true; endmodule "
            f"rewards {place} : {value}; endrewards"
        )
        with pytest.raises(ModelFault) as found:
            check_text(engine_of(text, engine), f"{ways} [ F x=2 & y=1 ]")
        (fault,) = found.value.diagnostics
        assert fault.code == code
        assert "for example in state (x=1,y=" in fault.message
        assert fault.span.text in value or value in fault.span.text


@pytest.mark.parametrize("kind", ["dtmc", "ctmc", "mdp"])
@pytest.mark.parametrize("engine", ENGINES)
def test_a_reward_without_a_value_is_no_fault_where_no_step_earns_it(kind, engine):
    # x=2 is not reached; in x=1 the action is not enabled, or carries no probability.
    zero = "0" if kind == "ctmc" else "0:(x'=0) + 1"
    text = (
        f"{kind} module m x:[0..2]; [a] x=0 -> (x'=1); [b] x=1 -> true; [d] x=1 -> {zero}:true;"
        " endmodule rewards [a] true : mod(2, 3*(1-x)); [d] x=2 : mod(3, 0); x=2 : pow(10, 19);"
        f" {'[d] true : mod(3, 0);' if kind == 'ctmc' else ''} x=0 : x!=0 ? mod(3, 0) : 3; "
        "endrewards"
    )
    ways = "R=?" if kind != "mdp" else "Rmax=?"
    assert check_text(engine_of(text, engine), f"{ways} [ F x=1 ]").value == 3 + 2


@pytest.mark.parametrize("engine", ENGINES)
def test_a_faulty_rate_is_told_where_the_command_is_enabled(engine):
    text = (
        "ctmc module m x:[0..2]; [] x=0 -> (x'=1); [] x=1 -> pow(10, 18 + x):(x'=2);"
        " [] x=2 -> true; endmodule"
    )
    with pytest.raises(ModelFault, match=r"beyond 64 bits, for example in state \(x=1\)"):
        engine_of(text, engine)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_faulty_condition_on_initial_states_is_told(engine):
    text = "dtmc module m x:[0..2]; [] true -> true; endmodule init mod(3, x - 1) = 0 endinit"
    with pytest.raises(ModelFault, match=r"mod\(3, 0\) has no value, for example in state \(x=1\)"):
        engine_of(text, engine)
    guarded = text.replace("mod(3, x - 1) = 0", "x != 1 & mod(3, x - 1) = 0")
    assert engine_of(guarded, engine).states == 2


@pytest.mark.parametrize("engine", ENGINES)
def test_rewards_beyond_doubles_are_refused_not_infinite(engine):
    sums = (
        "dtmc module m x:[0..1]; [] x=0 -> (x'=1); [] x=1 -> true; endmodule "
        "rewards x=0 : 1e308; x=0 : 1e308; endrewards"
    )
    products = (
        "ctmc module m x:[0..1]; [a] x=0 -> 1e200:(x'=1); [b] x=1 -> true; endmodule "
        "rewards [a] true : 1e200; endrewards"
    )
    for text in (sums, products):
        if engine == "exact":
            assert check_text(engine_of(text, engine), "R=? [ F x=1 ]").value in (
                2 * 10**308,
                10**200,
            )
            continue
        with pytest.raises(ModelFault, match=r"Infinity, for example in state \(x=0\)"):
            check_text(engine_of(text, engine), "R=? [ F x=1 ]")


GUARDS = ["true", "x>=1", "y=0 | x>1", "pow(2,x)>y", "mod(7,x)=0", "x=0 | mod(7,x)=0"]


@settings(max_examples=50, deadline=None)
@given(_int, st.sampled_from(GUARDS), st.sampled_from(sorted(WAYS)), st.sampled_from(["", "[a] "]))
def test_diagrams_meet_the_faults_of_random_rewards(value, guard, way, action):
    text = (
        "mdp module m x:[0..3]; y:[-2..2]; [a] x<3 -> 1/2:(x'=x+1)&(y'=1-x) + 1/2:(x'=x+1); "
        f"[b] x=3 -> true; endmodule rewards {action}{guard} : {value}; endrewards"
    )
    try:
        model = bound(text)
    except InputError:  # a fault of a constant part
        return
    expected = faulty = None
    try:
        expected = explore_explicitly(model, Options())
    except ModelFault as fault:
        faulty = fault
    limits = WAYS[way]
    made = transitions(
        reach(build(model, Options(), limits=limits), schedule="frontier"), Options()
    )
    if faulty is not None:
        with pytest.raises(ModelFault) as found:
            made.state_rewards[0], made.transition_rewards[0]
        assert {d.code for d in found.value.diagnostics} == {d.code for d in faulty.diagnostics}
        return
    found = [at(made.space, made.state_rewards[0], s) for s in expected.states]
    assert found == expected.state_rewards[0].tolist()
    states = iter(expected.states)
    for state, reward in zip(states, expected.choice_rewards[0].tolist(), strict=True):
        rewards = [at(made.space, r, state) for r in made.transition_rewards[0]]
        assert sum(rewards) == reward
