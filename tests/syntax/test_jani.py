"""Models and properties in the JANI format."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import pytest

import symcheck
from symcheck.cli import main
from symcheck.errors import SyntaxFault, UnsupportedError
from symcheck.syntax.jani.read import read_jani
from syntax.jani_models import (
    CONSTANTS,
    MODELS,
    automaton,
    binary,
    edge,
    filtered,
    model,
    text,
    variable,
)

ENGINES = ["explicit", "sparse", "hybrid", "mtbdd", "exact"]


def loaded(tmp_path, found, constants=None, **options):
    path = tmp_path / "model.jani"
    path.write_text(text(found) if isinstance(found, dict) else found)
    return symcheck.load(path, constants, **options), path


def values(tmp_path, found, constants=None, **options):
    checked, path = loaded(tmp_path, found, constants, **options)
    return {bound.name: result.value for bound, result in checked.check_all(path)}


@pytest.mark.parametrize("engine", ENGINES)
def test_the_die_has_its_values_on_every_engine(tmp_path, engine):
    found = values(tmp_path, MODELS["die"], engine=engine)
    assert found == {
        "six": pytest.approx(1 / 6),
        "length": pytest.approx(11 / 3),
        "soon": True,
        "three": pytest.approx(13 / 4),
    }


def test_locations_are_states_and_transient_variables_labels_and_rewards(tmp_path):
    die, _ = loaded(tmp_path, MODELS["die"])
    assert die.engine.states == 13
    assert die.check('P=? [ F "done" & d=3 ]').value == pytest.approx(1 / 6)
    assert die.check('R{"tosses"}=? [ F d>0 ]').value == pytest.approx(11 / 3)


def test_results_are_exact_where_the_numbers_are(tmp_path):
    assert values(tmp_path, MODELS["die"], exact=True)["six"] == Fraction(1, 6)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_receiver_reads_what_its_sender_assigns_before(tmp_path, engine):
    # The sum of 1s and 2s reaches exactly 4 with probability 1 - 5/16.
    assert values(tmp_path, MODELS["value_passing"], engine=engine)["four"] == pytest.approx(
        11 / 16
    )


def test_actions_that_share_a_result_and_differ_in_reward_are_distinguished(tmp_path):
    checked, _ = loaded(tmp_path, MODELS["handshake"])
    assert set(checked.bound.actions) == {"make", "put", "get", "get_2"}


def test_results_of_vectors_name_the_actions(tmp_path):
    one = automaton(
        "one", ["l"], [edge("l", ("l", {"x": 1}), action="a", guard=binary("=", "x", 0))]
    )
    other = automaton(
        "other", ["l"], [edge("l", ("l", {"y": 1}), action="b", guard=binary("=", "y", 0))]
    )
    parts = {"variables": [variable("x", 0, 1), variable("y", 0, 1)]}
    apart, _ = loaded(
        tmp_path,
        model("mdp", [one, other], syncs=[(["a", None], "c"), ([None, "b"], "c")], **parts),
    )
    assert apart.engine.states == 4
    assert apart.bound.actions == ("c",)
    together, _ = loaded(tmp_path, model("mdp", [one, other], syncs=[(["a", "b"], None)], **parts))
    assert together.engine.states == 2
    assert together.bound.actions == ()
    blocked, _ = loaded(tmp_path, model("mdp", [one, other], syncs=[(["a", None], "a")], **parts))
    assert blocked.engine.states == 2


def test_initial_states_are_those_of_the_restrictions(tmp_path):
    found = model(
        "dtmc",
        [automaton("m", ["a", "b", "c"], [edge(x, (x, {})) for x in "abc"], initial=["a", "c"])],
        variables=[variable("x", 0, 3, None), variable("y", 0, 3, 2)],
        **{"restrict-initial": {"exp": binary("<", "x", "y")}},
    )
    checked, _ = loaded(tmp_path, found)
    assert checked.check('filter(count, "init")').value == 4
    assert checked.check('filter(count, "init" & y=2 & m_location!=1)').value == 4


def test_functions_and_derived_operators_are_expanded(tmp_path):
    double = {
        "name": "double",
        "type": "int",
        "parameters": [{"name": "k", "type": "int"}],
        "body": binary("*", "k", 2),
    }
    called = {
        "op": "call",
        "function": "double",
        "args": [{"op": "abs", "exp": binary("-", "x", 3)}],
    }
    sign = {"op": "sgn", "exp": binary("-", {"op": "trc", "exp": binary("/", "x", 3)}, 1)}
    ends = {
        "op": "Pmax",
        "exp": {
            "op": "F",
            "exp": binary("∧", binary("⇒", binary("<", "x", 2), False), binary("=", sign, -1)),
        },
    }
    found = model(
        "dtmc",
        [automaton("m", ["l"], [edge("l", ("l", {"x": binary("min", called, 9)}))])],
        variables=[variable("x", 0, 9, 1)],
        properties={"end": filtered(ends)},
        functions=[double],
    )
    checked, path = loaded(tmp_path, found)
    # 1 -> 2|1-3| = 4 -> 2 -> 2, whose third, cut, is less than 1
    assert sorted(s["x"] for s in checked.states) == [1, 2, 4]
    assert [result.value for _, result in checked.check_all(path)] == [1.0]


def test_rewards_of_destinations_are_weighted(tmp_path):
    flip = edge("l", ("l", {"won": 3}, 0.25), ("l", {"won": -1}, 0.75))
    reward = {"op": "Emax", "exp": "won", "accumulate": ["steps"], "step-instant": 8}
    bounded = {
        "op": "F",
        "exp": True,
        "reward-bounds": [{"exp": "won", "accumulate": ["steps"], "bounds": {"upper": 2}}],
    }
    found = model(
        "dtmc",
        [automaton("m", ["l"], [flip])],
        variables=[variable("won", kind="real", transient=True)],
        properties={"sum": filtered(reward), "bounded": filtered({"op": "Pmax", "exp": bounded})},
    )
    file = read_jani(text(found))
    assert "depend on the destination" in str(file.faults[1])
    checked, _ = loaded(tmp_path, found)
    properties = replace(file.properties, properties=file.properties.properties[:1])
    assert next(checked.check_all(properties))[1].value == pytest.approx(0.0)


def test_what_accumulates_is_what_is_asked(tmp_path):
    """Rewards of states (3 per unit of time) and of transitions (1 each) of a CTMC that leaves at rate 2."""
    kinds = {"time": 1.5, "steps": 1.0, "exit": 3.0}
    asked = {k: [k] for k in kinds} | {"both": ["time", "steps"]}
    found = model(
        "ctmc",
        [automaton("m", [("l", {"cost": 3}), "end"], [edge("l", ("end", {"cost": 1}), rate=2)])],
        variables=[variable("cost", kind="real", transient=True)],
        properties={
            n: filtered({"op": "Emax", "exp": "cost", "accumulate": a, "time-instant": 50})
            for n, a in asked.items()
        },
    )
    found = values(tmp_path, found)
    assert found == pytest.approx(kinds | {"both": 2.5}, abs=1e-6)


@pytest.mark.parametrize("engine", ["explicit", "hybrid", "mtbdd"])
def test_long_run_averages_without_accumulation_count_what_edges_earn(tmp_path, engine):
    """Two states with the rates 2 and 3: each edge is taken 6/5 times per unit of time.

    The state `l` has the share 3/5. Its edge assigns 1 to `jobs` and 5 to `cost`, which is 3 in it.
    """
    there = edge("l", ("k", {"jobs": 1, "cost": 5}), rate=2)
    asked = {
        "jobs": "jobs",
        "cost": "cost",
        "sum": binary("+", binary("*", 2, "jobs"), binary("+", 7, "cost")),
    }
    found = model(
        "ctmc",
        [automaton("m", [("l", {"cost": 3}), "k"], [there, edge("k", ("l", {}), rate=3)])],
        variables=[variable(n, kind="real", transient=True) for n in ("jobs", "cost")],
        properties={n: filtered({"op": "Smin", "exp": e}) for n, e in asked.items()},
    )
    jobs, cost = 6 / 5, 3 * 3 / 5 + 5 * 6 / 5
    expected = {"jobs": jobs, "cost": cost, "sum": 2 * jobs + 7 + cost}
    assert values(tmp_path, found, engine=engine) == pytest.approx(expected)


def test_long_run_averages_in_discrete_time_count_what_edges_earn(tmp_path):
    """A loop that earns 2 with each step, or 5 with another one."""
    edges = [edge("l", ("l", {"won": w})) for w in (2, 5)]
    found = model(
        "mdp",
        [automaton("m", ["l"], edges)],
        variables=[variable("won", kind="real", transient=True)],
        properties={o: filtered({"op": o, "exp": "won"}) for o in ("Smin", "Smax")},
    )
    assert values(tmp_path, found) == {"Smin": 2, "Smax": 5}


@pytest.mark.parametrize(
    "formula",
    [
        {"op": "Emax", "exp": "won", "step-instant": 3},
        {"op": "Smax", "exp": binary("≥", "won", 1)},
        {"op": "Smax", "exp": "lost"},
        {"op": "Pmax", "exp": {"op": "F", "exp": "lost"}},
        {"op": "Pmax", "exp": {"op": "U", "left": binary("≤", "won", 0), "right": "lost"}},
        {"op": "Emax", "exp": "won", "accumulate": ["steps"], "reach": "lost"},
        "won",
    ],
)
def test_variables_that_have_values_on_edges_only_are_not_read_in_states(formula):
    """They would be 0 or false in every state, and the result 0 whatever the edges say."""
    found = model(
        "mdp",
        [automaton("m", ["l"], [edge("l", ("l", {"won": 1, "lost": True}))])],
        variables=[
            variable("won", kind="real", transient=True),
            variable("lost", kind="bool", transient=True) | {"initial-value": False},
        ],
        properties={"p": filtered(formula)},
    )
    (fault,) = read_jani(text(found), "model.jani").faults.values()
    assert "is read in states, and edges assign it" in str(fault)
    assert "^" in str(fault)


def test_long_run_averages_of_variables_that_are_not_0_at_first_are_refused():
    won = variable("won", kind="real", transient=True) | {"initial-value": 1}
    found = model(
        "mdp",
        [automaton("m", ["l"], [edge("l", ("l", {"won": 4}))])],
        variables=[won],
        properties={"p": filtered({"op": "Smax", "exp": "won"})},
    )
    (fault,) = read_jani(text(found), "model.jani").faults.values()
    assert "whose initial value is not 0" in str(fault)


@pytest.mark.parametrize(
    ("operator", "expected"), [("≥", True), (">", True), ("≤", False), ("<", False), ("=", False)]
)
def test_two_values_are_compared(tmp_path, operator, expected):
    """Neither is a constant, so none of them is a threshold."""
    three, one = ({"op": "Pmax", "exp": {"op": "F", "exp": binary(o, "d", 3)}} for o in "≥=")
    asked = {
        "plain": filtered(binary(operator, three, one)),
        "scaled": filtered(binary(operator, three, binary("*", 2, one))),
    }
    properties = [{"name": n, "expression": e} for n, e in asked.items()]
    found = values(tmp_path, MODELS["die"] | {"properties": properties})
    assert found == {"plain": expected, "scaled": expected}


def test_steps_are_counted_by_the_number_1(tmp_path):
    def steps(**more):
        return {"op": "Emax", "exp": 1, "accumulate": ["steps"], **more}

    bounded = {
        "op": "F",
        "exp": "done",
        "reward-bounds": [{"exp": 1, "accumulate": ["steps"], "bounds": {"upper": 4}}],
    }
    asked = {
        "all": filtered(steps(reach="done")),
        "some": filtered(steps(**{"step-instant": 7})),
        "soon": filtered({"op": "Pmax", "exp": bounded}),
        "timed": filtered({"op": "Emax", "exp": 1, "accumulate": ["time"], "reach": "done"}),
    }
    properties = [{"name": n, "expression": e} for n, e in asked.items()]
    file = read_jani(text(MODELS["die"] | {"properties": properties}))
    assert "no time passes in the states of a DTMC" in str(file.faults[3])
    values_ = values(tmp_path, MODELS["die"] | {"properties": properties[:3]})
    assert values_ == pytest.approx({"all": 11 / 3, "some": 7, "soon": 0.75})


def test_inputs_are_enabled_where_an_element_says_so(tmp_path):
    sender = automaton(
        "sender",
        ["l"],
        [edge("l", ("l", {"x": binary("+", "x", 1)}), action="a", guard=binary("<", "x", 3))],
    )
    receiver = automaton("receiver", ["on", "off"], [edge("on", ("off", {}), action="a")])
    elements = [{"automaton": "sender"}, {"automaton": "receiver", "input-enable": ["a"]}]
    found = model(
        "mdp",
        [sender, receiver],
        variables=[variable("x", 0, 3)],
        syncs=[(["a", "a"], "a")],
        elements=elements,
    )
    assert loaded(tmp_path, found)[0].engine.states == 4


def test_an_automaton_may_occur_twice(tmp_path):
    one = automaton(
        "m",
        ["l", "k"],
        [edge("l", ("k", {"x": 1})), edge("k", ("l", {"x": 0}))],
        [variable("x", 0, 1)],
    )
    found = model("mdp", [one], elements=[{"automaton": "m"}, {"automaton": "m"}], syncs=[])
    assert loaded(tmp_path, found)[0].engine.states == 4


# ------------------------------------------------------------------------------------------- faults


def simple(**changes):
    return (
        model(
            "mdp", [automaton("m", ["l"], [edge("l", ("l", {}))])], variables=[variable("x", 0, 1)]
        )
        | changes
    )


@pytest.mark.parametrize(
    ("found", "message"),
    [
        (simple(variables=[variable("c", kind="clock")]), "only timed automata have clocks"),
        (
            simple(
                automata=[
                    automaton("m", ["l"], [edge("l", ("l", {}))])
                    | {"locations": [{"name": "l", "time-progress": {"exp": True}}]}
                ]
            ),
            "only timed automata let time progress",
        ),
    ],
)
def test_parts_of_timed_automata_in_other_models_are_faults(found, message):
    with pytest.raises(SyntaxFault, match=message):
        read_jani(text(found), "model.jani")


@pytest.mark.parametrize(
    ("found", "message"),
    [
        (simple(type="sha"), "stochastic hybrid automata are not supported"),
        (simple(variables=[variable("c", kind="real")]), "is real"),
        (
            simple(variables=[variable("c", kind={"kind": "array", "base": "int"})]),
            "an array is a name, a list (av) or a comprehension (ac)",
        ),
        (simple(**{"jani-version": 2}), "only version 1"),
        *(
            (simple(**{"restrict-initial": {"exp": expression}}), message)
            for expression, message in (
                ({"op": "av", "elements": [1]}, "arrays as values of expressions ('av') are"),
                ({"op": "da", "exp": "x", "member": "y"}, "datatypes ('da') are not supported"),
                ({"op": "nondet", "var": "i", "exp": True}, "selections of values ('nondet') are"),
                ({"op": "der", "var": "x"}, "derivatives of continuous variables ('der') are not"),
                ({"op": "sin", "exp": "x"}, "the operator 'sin' is not supported"),
                (
                    {"distribution": "Uniform", "args": [0, 1]},
                    "random numbers of the distribution 'Uniform' are not supported here",
                ),
                (
                    {"distribution": "DiscreteUniform", "args": [0, 1]},
                    "hint: DiscreteUniform and Bernoulli are, in assignments",
                ),
            )
        ),
        (simple(type="ha"), "hybrid automata are not supported"),
        (simple(variables=[variable("c", kind={"kind": "datatype", "ref": "d"})]), "'datatype' is"),
        (
            simple(
                variables=[variable("c", kind={"kind": "bounded", "base": "int", "lower-bound": 0})]
            ),
            "has one bound only",
        ),
    ],
)
def test_what_is_not_supported_is_named_with_its_place(found, message):
    with pytest.raises(
        UnsupportedError, match=r"model\.jani:\d+:\d+: error\[unsupported\]"
    ) as error:
        read_jani(text(found), "model.jani")
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("found", "message"),
    [
        ('{"jani-version": 1,\n "type" "mdp"}', "model.jani:2:9: error[json]: this is no JSON"),
        (
            '{"jani-version": 1,\n "type": "mdp", "type": "mdp"}',
            'model.jani:2:17: error[json]: "type" occurs twice',
        ),
        ("[]", "an object { … } is expected"),
        ('{"jani-version": 1, "type": "petri"}', "'petri' is no model type"),
        (
            text(simple(**{"restrict-initial": {"exp": "y"}})),
            "there is no variable or constant 'y'",
        ),
        (
            text(model("mdp", [automaton("m", ["l"], [edge("l", ("k", {}))])])),
            "there is no location 'k'",
        ),
        (
            text(model("mdp", [automaton("m", ["l"], [edge("l", ("l", {}), rate=1)])])),
            "edges of MDPs have no rate",
        ),
        (text(model("mdp", [automaton("m", ["l"], [edge("l")])])), "an edge needs a destination"),
        (
            text(
                simple(automata=[automaton("m", ["l"], [edge("l", ("l", {})) | {"guards": True}])])
            ),
            '"guards" is no member of this object\n  43 |      "guards": true\n',
        ),
        (
            text(
                simple(automata=[automaton("m", ["l"], [edge("l", ("l", {})) | {"guards": True}])])
            ),
            'hint: did you mean "guard"?',
        ),
        (
            text(simple(propertys=[]) | {"properties": None}).replace("properties", "x-notes"),
            '"properties"?',
        ),
        (
            text(simple(automata=[automaton("m", ["l"], [edge("l", ("l", {}), action="b")])])),
            "there is no action 'b'",
        ),
        (
            text(
                simple(system={"elements": [{"automaton": "m"}], "syncs": [{"synchronise": ["c"]}]})
            ),
            'hint: the model declares its "actions": there are none',
        ),
        (
            text(
                model(
                    "mdp",
                    [automaton(n, ["l"], [edge("l", ("l", {}), action="a")]) for n in "ab"],
                )
            ),
            'the composition needs "syncs"',
        ),
        (
            text(model("ctmc", [automaton("m", ["l"], [edge("l", ("l", {}))])])),
            "edges of CTMCs need a rate",
        ),
        (
            text(
                model(
                    "ctmc",
                    [automaton("m", ["l"], [edge("l", ("l", {}), rate=1), edge("l", ("l", {}))])],
                )
            ),
            "edges of CTMCs need a rate",
        ),
    ],
)
def test_faults_have_their_place(found, message):
    with pytest.raises(SyntaxFault) as error:
        read_jani(found, "model.jani")
    assert message in str(error.value)
    assert "\n  hint" in str(error.value) or "^" in str(error.value)


def test_members_of_other_tools_are_left_alone():
    given = simple(
        **{"x-origin": "a tool", "comment": "of the model", "metadata": {"author": "us"}}
    )
    assert read_jani(text(given), "model.jani").program.modules


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ({"op": "P", "exp": {"op": "F", "exp": True}}, "'P' needs a direction"),
        ({"op": "timelock"}, "models have no timelocks"),
        (
            {"op": "Pmax", "exp": {"op": "F", "exp": True, "time-bounds": {"upper": 3}}},
            "MDPs have no time: use step-bounds",
        ),
        ({"op": "multi", "objectives": []}, "the operator 'multi' is not supported"),
        ({"op": "Emax", "exp": 1, "reward-instants": []}, "instant of a reward are not supported"),
    ],
)
def test_properties_that_are_not_read_have_their_place(formula, message):
    (fault,) = read_jani(
        text(simple() | {"properties": [{"name": "p", "expression": filtered(formula, "max")}]}),
        "model.jani",
    ).faults.values()
    assert message in str(fault)
    assert "^" in str(fault)


def test_a_truth_value_in_a_filter_of_numbers_has_its_place(tmp_path):
    formula = filtered({"op": "∀", "exp": {"op": "F", "exp": {"op": "initial"}}}, "max")
    with pytest.raises(symcheck.SymcheckError, match=r"model\.jani:\d+:\d+: error\[type\]"):
        values(tmp_path, simple(properties=[{"name": "p", "expression": formula}]))


def test_faults_of_types_point_into_the_file(tmp_path):
    wrong = model(
        "dtmc",
        [automaton("m", ["l"], [edge("l", ("l", {"x": True}))])],
        variables=[variable("x", 0, 1)],
    )
    with pytest.raises(symcheck.SymcheckError, match=r"model\.jani:\d+:\d+: error\[type\]"):
        loaded(tmp_path, wrong)


def test_a_property_that_is_not_supported_leaves_the_others(tmp_path):
    reads = {"op": "Emax", "exp": "x", "accumulate": ["steps"], "step-instant": 3}
    found = simple(
        properties=[
            {"name": "bad", "expression": filtered(reads)},
            {"name": "good", "expression": filtered(binary("=", "x", 0))},
        ]
    )
    file = read_jani(text(found))
    assert list(file.faults) == [0]
    assert [p.name for p in file.properties.properties] == ["bad", "good"]


def test_the_command_line_checks_the_properties_of_the_file(tmp_path, capsys):
    bad = {"op": "Emax", "exp": "d", "accumulate": ["steps"], "reach": "done"}
    path = tmp_path / "die.jani"
    path.write_text(
        text(
            MODELS["die"]
            | {"properties": [{"name": "bad", "expression": bad}, *MODELS["die"]["properties"]]}
        )
    )
    assert main([str(path)]) == 1
    out = capsys.readouterr().out
    assert "what accumulates on steps cannot depend on a variable of states" in out
    assert 'Model checking: "six": P=? [ F d=6 ]' in out
    assert "Result: 3.25" in out
    assert main([str(path), "-prop", "length"]) == 0
    assert main([str(path), "-pf", 'P=? [ F "done" ]']) == 0


def test_an_edge_is_shown_as_a_command(tmp_path):
    die, _ = loaded(tmp_path, MODELS["die"])
    step = die.simulator(seed=1).choices[0]
    assert step.text.startswith("[] die_location=0 -> 1/2") or "die_location'=1" in step.text
    assert "{" not in step.text


@pytest.mark.parametrize("name", MODELS)
def test_the_program_has_a_text_in_the_prism_language(name, tmp_path):
    given = CONSTANTS.get(name, {})
    read, _ = loaded(tmp_path, MODELS[name], given)
    again = symcheck.loads(symcheck.pretty(read.program), given)
    assert again.engine.states == read.engine.states
    assert again.engine.transitions == read.engine.transitions
