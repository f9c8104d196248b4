"""Concurrent games: joint actions, values with proofs, and what is refused."""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from math import inf, sqrt
from random import Random

import pytest

import symcheck
from oracles import concurrent
from symcheck.check.result import Certified, Exact
from symcheck.errors import ModelFault, NoStrategyError, NumericalError, UnsupportedError

PENNIES = """
csg
player even even endplayer
player odd odd endplayer
module even [heads] true -> true; [tails] true -> true; endmodule
module odd = even [heads=heads2, tails=tails2] endmodule
module score
  s : [-1..1] init 0;
  [heads,heads2] s=0 -> (s'=1);
  [tails,tails2] s=0 -> (s'=1);
  [heads,tails2] s=0 -> (s'=-1);
  [tails,heads2] s=0 -> 0.5:(s'=-1) + 0.5:true;
endmodule
rewards "won" [heads,heads2] s=0 : 3; [tails,tails2] s=0 : 1; [] s=0 & false : 7; endrewards
"""


def hide_or_run(waiting: str, cost: int = 0) -> str:
    """A hider runs while the other one has not thrown the only ball (de Alfaro et al.)."""
    return f"""
csg
player hider hider endplayer
player thrower thrower endplayer
module hider [hide] s=0 -> true; [run] s=0 -> true; endmodule
module thrower [throw] s=0 -> true; [wait] s=0 -> true; endmodule
module game
  s : [0..2];
  [hide,throw] s=0 -> (s'=1);
  [run,wait] s=0 -> (s'=1);
  [run,throw] s=0 -> (s'=2);
  [hide,wait] s=0 -> {waiting};
endmodule
rewards "cost" [] s=0 : {cost}; endrewards
"""


def check(text: str, property: str, **options: object) -> symcheck.Result:
    return symcheck.loads(text, **options).check(property)


def encloses(result: symcheck.Result, value: float | Fraction, width: float = 1e-6) -> bool:
    """Whether proved bounds contain a value, and are close."""
    lower, upper = result.bounds
    return lower <= value <= upper and upper - lower <= width * max(1.0, abs(value))


# ---------------------------------------------------------------------------------- joint actions


def test_each_joint_action_is_a_choice():
    model = symcheck.loads(PENNIES)
    assert model.bound.actions == (
        "heads,heads2",
        "heads,tails2",
        "tails,heads2",
        "tails,tails2",
    )
    assert len(model.states) == 3
    assert model.engine.choices == 12


def test_a_text_is_printed_as_it_is_read():
    program = symcheck.parse_model(PENNIES.replace("(s'=1)", "(s'=min(1,s'=s?1:2))", 1))
    assert symcheck.parse_model(symcheck.pretty(program)) == program


def test_who_has_no_action_picks_none():
    text = """
    csg
    player one one endplayer
    player two two endplayer
    module one x : [0..2]; [a] x=0 -> (x'=1); endmodule
    module two y : [0..2]; [b] x=1 & y=0 -> (y'=1); [c] x=1 & y=0 -> (y'=2); endmodule
    module days t : [0..3]; [] t<3 -> (t'=t+1); endmodule
    """
    model = symcheck.loads(text)
    assert model.bound.actions == ("a,b", "a,c", "a", "b", "c")
    # a, then b or c, then only the clock goes on, and at last nothing happens.
    states = [(0, 0, 0), (1, 0, 1), (1, 1, 2), (1, 1, 3), (1, 2, 2), (1, 2, 3)]
    assert [tuple(state.values()) for state in model.states] == states
    assert model.check("<<one>> Pmax=? [ F y=1 ]").value == 0
    assert model.check("<<two>> Pmax=? [ F y=1 ]").value == 1


def test_updates_read_values_after_the_step():
    text = """
    csg
    player one one endplayer
    player two two endplayer
    module one x : [0..3]; [a] true -> 0.5:(x'=1) + 0.5:(x'=2); endmodule
    module two y : [0..4]; [b] true -> (y'=z'); [c] true -> (y'=0); endmodule
    module three = two [ y=unused, z=x, b=d, c=e ] endmodule
    module four z : [0..4]; [a] true -> (z'=x'+x); endmodule
    player three three endplayer
    """
    found = symcheck.loads(text).check("filter(print, <<two>> Pmax=? [ X y=x & z=x ], x=0)")
    assert found.value == 1
    assert check(text, "<<three>> Pmax=? [ F<=2 unused=x & z>x ]").value == 1


def test_modules_follow_the_joint_action_or_stay():
    text = PENNIES + "module other o : [0..1]; [heads] s=0 -> (o'=1); endmodule"
    assert check(text, "<<even>> Pmax=? [ X o=1 ]").value == 1
    assert check(text, "<<odd>> Pmax=? [ X o=1 ]").value == 0


@pytest.mark.parametrize(
    ("commands", "message"),
    [
        ("[heads] s=0 -> true;", "two commands of module score take part if \\[heads,heads2\\]"),
        ("[] s=1 -> true; [heads] s>0 -> true;", "for example in state \\(s=1\\)"),
    ],
)
def test_several_commands_of_a_module_for_one_joint_action(commands, message):
    text = PENNIES.replace("endmodule\nrewards", f"{commands} endmodule\nrewards")
    with pytest.raises(ModelFault, match=message):
        check(text, "<<even>> Pmax=? [ F s=1 ]")


@pytest.mark.parametrize("both", ["[a,b] true -> true;", "[a,b] true -> true; [a,c] x=1 -> true;"])
def test_a_joint_action_without_a_command(both):
    text = f"""
    csg
    player one one endplayer
    player two two endplayer
    module one x : [0..1]; {both} endmodule
    module two [b] true -> true; [c] true -> true; endmodule
    """
    with pytest.raises(ModelFault, match=r"what follows if \[a,c\] is picked, .* \(x=0\)"):
        check(text, "<<one>> Pmax=? [ F x=1 ]")


def test_too_many_joint_actions():
    players = "\n".join(
        f"player p{i} m{i} endplayer module m{i} "
        + "".join(f"[a{i}_{k}] true -> true;" for k in range(9))
        + "endmodule"
        for i in range(5)
    )
    with pytest.raises(UnsupportedError, match="100,000 joint actions"):
        _ = symcheck.loads("csg " + players).bound


# ---------------------------------------------------------------------------------- bounded values


def test_one_step_is_a_matrix_game():
    # [[1, 0], [0.5, 1]] for s>=0, the first player mixes 1/3 and 2/3.
    assert encloses(check(PENNIES, "<<even>> Pmax=? [ X s>=0 ]"), Fraction(2, 3), 1e-12)
    assert encloses(check(PENNIES, "<<odd>> Pmin=? [ X s>=0 ]"), Fraction(2, 3), 1e-12)
    assert encloses(check(PENNIES, "<<odd>> Pmax=? [ X s<0 ]"), Fraction(1, 3), 1e-12)
    assert encloses(check(PENNIES, "<<even>> Pmin=? [ X s<0 ]"), Fraction(1, 3), 1e-12)
    found = check(PENNIES, '<<even>> R{"won"}max=? [ C<=1 ]')
    assert encloses(found, Fraction(3, 4), 1e-12)
    assert found.accuracy == Exact(rounding=True)


def test_sides():
    assert check(PENNIES, "Pmax=? [ F s=1 ]").value == 1
    assert check(PENNIES, "Pmin=? [ F s=1 ]").value == 0
    assert check(PENNIES, "<<*>> Pmin=? [ F s=1 ]").value == 0
    assert check(PENNIES, "<<>> Pmin=? [ F s=1 ]").value == 1
    assert check(PENNIES, "<<even,odd>> Pmax=? [ F s=-1 ]").value == 1


@pytest.mark.parametrize("seed", range(25))
def test_bounded_values_of_random_games(seed):
    random = Random(seed)
    game = concurrent.draw(random, random.randint(2, 5), random.randint(2, 4))
    n = len(game)
    goal_reward = '\nrewards "goal" mod(s,3)=1 : 1; endrewards'
    model = symcheck.loads(concurrent.text(game) + goal_reward)
    reached = {state["s"] for state in model.states}
    goal, lost = frozenset(s for s in range(n) if s % 3 == 1), frozenset({n - 1})
    start, nothing = [Fraction(s in goal) for s in range(n)], [Fraction(0)] * n
    steps = random.randint(1, 4)
    is_goal = "|".join(f"s={s}" for s in goal)
    until = f"(s!={n - 1}|{is_goal}) U<={steps} ({is_goal})"
    for player, direction in product(("one", "two"), ("max", "min")):
        maximises = (player == "one") == (direction == "max")
        reach = concurrent.after_steps(
            game, start, steps, one_maximises=maximises, stays=goal | lost
        )
        earn = concurrent.after_steps(game, nothing, steps, one_maximises=maximises, earns=True)
        after = concurrent.after_steps(game, start, steps, one_maximises=maximises)
        for state in reached:
            for asked, value in (
                (f"P{direction}=? [ {until} ]", reach[state]),
                (f"R{direction}=? [ C<={steps} ]", earn[state]),
                (f'R{{"goal"}}{direction}=? [ I={steps} ]', after[state]),
            ):
                found = model.check(f"filter(max, <<{player}>> {asked}, s={state})")
                assert encloses(found, value, 1e-12), (player, asked, state)


# -------------------------------------------------------------------------- values without a bound


def test_repeated_pennies():
    # v = value [[1, 0], [v/2, 1]] = 1 / (2 - v/2), so that v = 2 - sqrt(2).
    found = check(PENNIES, "<<even>> Pmax=? [ F s=1 ]")
    assert encloses(found, 2 - sqrt(2))
    assert isinstance(found.accuracy, Certified)
    assert encloses(check(PENNIES, "<<odd>> Pmax=? [ G s<1 ]"), sqrt(2) - 1)
    assert encloses(check(PENNIES, "<<even>> Pmax=? [ F>=2 s=1 ]"), 2 - sqrt(2))


@pytest.mark.parametrize(("bound", "holds"), [(">=0.5857", True), (">0.5858", False)])
def test_thresholds(bound, holds):
    assert check(PENNIES, f"<<even>> P{bound} [ F s=1 ]").value is holds
    opposite = bound.replace(">=", "<").replace(">", "<=")
    assert check(PENNIES, f"[[even]] P{opposite} [ F s=1 ]").value is not holds


def test_a_threshold_at_an_irrational_value_is_not_decided():
    text = hide_or_run("(s'=0)")
    with pytest.raises(NumericalError, match="cannot decide") as error:
        check(text, "<<hider>> P>=1 [ F s=1 ]", max_iterations=100)
    assert error.value.hint == "=? in place of the bound gives the value with its accuracy"
    assert check(text, "<<hider>> P>0.9 [ F s=1 ]", max_iterations=100).value is True


def test_a_value_that_no_strategy_attains():
    found = check(hide_or_run("(s'=0)"), "<<hider>> Pmax=? [ F s=1 ]", max_iterations=100)
    assert encloses(found, 1, 0.02)
    assert "further than asked for" in found.warnings[0]


def test_a_game_without_choices_at_once_in_time():
    text = hide_or_run("0.5:(s'=0)+0.5:(s'=2)")
    assert encloses(check(text, "<<hider>> Pmax=? [ F s=1 ]"), 2 - sqrt(2))
    assert encloses(check(text, "<<thrower>> Pmin=? [ F s=1 ]"), 2 - sqrt(2))


@pytest.mark.parametrize("seed", range(15))
def test_values_without_a_bound_of_random_games(seed):
    """Values within more and more steps come near them from below."""
    random = Random(seed)
    game = concurrent.draw(random, random.randint(2, 4), 2)
    goal = len(game) - 1
    model = symcheck.loads(concurrent.text(game))
    for direction in ("max", "min"):
        asked = f"<<one>> P{direction}=?"
        found = model.check(f"{asked} [ F s={goal} ]")
        within = model.check(f"{asked} [ F<=300 s={goal} ]")
        assert found.bounds[1] >= within.bounds[0]
        assert found.bounds[0] <= within.bounds[1] + 1e-3


# ------------------------------------------------------------------------------------------ rewards


def test_reward_until_a_target():
    # The hider runs or hides until the thrower throws: v = 1 + value [[v, 0], [0, 0]] for s=0.
    text = hide_or_run("(s'=0)", cost=1)
    assert encloses(check(text, '<<hider>> R{"cost"}min=? [ F s>0 ]'), 1)
    # v = 1 + value [[0, v/2], [0, 0]]
    half = hide_or_run("0.5:(s'=0)+0.5:(s'=2)", cost=1)
    assert encloses(check(half, '<<hider>> R{"cost"}max=? [ F s>0 ]'), 1)


def test_reward_of_a_game_in_which_chance_helps():
    text = PENNIES.replace("(s'=-1) + 0.5:true", "true + 0.5:true").replace(
        "[heads,tails2] s=0 -> (s'=-1)", "[heads,tails2] s=0 -> true"
    )
    # Odd wants to go on, even matches with 1/2: two steps in expectation.
    steps = text.replace("[] s=0 & false : 7", "[] s=0 : 1").replace("[heads,heads2] s=0 : 3;", "")
    steps = steps.replace("[tails,tails2] s=0 : 1;", "")
    assert encloses(check(steps, '<<odd>> R{"won"}max=? [ F s=1 ]'), 2)
    assert encloses(check(steps, '<<even>> R{"won"}min=? [ F s=1 ]'), 2)


@pytest.mark.parametrize("seed", range(15))
def test_expected_steps_of_random_games(seed):
    """What is earned within more and more steps comes near the reward until a target."""
    random = Random(seed)
    game = concurrent.draw(random, random.randint(2, 4), 2)
    goal = len(game) - 1
    game[goal] = [[(Fraction(0), {goal: Fraction(1)})]]
    rewards = f'\nrewards "steps" [] s!={goal} : 1; endrewards'
    model = symcheck.loads(concurrent.text(game) + rewards)
    for direction in ("max", "min"):
        asked = f'<<two>> R{{"steps"}}{direction}=?'
        found = model.check(f"{asked} [ F s={goal} ]")
        within = model.check(f"{asked} [ C<=400 ]").bounds
        if found.value == inf:
            assert within[0] > 20
        else:
            assert found.bounds[1] >= within[0]
            assert found.bounds[0] <= within[1] + 1e-3 * found.value


def test_a_reward_is_infinite_where_a_target_may_be_missed():
    assert check(PENNIES, '<<even>> R{"won"}min=? [ F s=1 ]').value == inf
    assert check(PENNIES, '<<odd>> R{"won"}max=? [ F s=1 ]').value == inf


def test_a_target_that_is_almost_but_never_surely_reached():
    text = hide_or_run("(s'=0)")
    with pytest.raises(NumericalError, match="no strategy without memory was found"):
        check(text, '<<hider>> R{"cost"}min=? [ F s=1 ]', max_iterations=100)


def test_who_minimises_does_not_stay_where_steps_earn_nothing():
    """Value iteration proposes to stay; a strategy that leaves with a small probability proves 1."""
    text = """csg player one m endplayer player two n endplayer
    module m x : [0..1]; [stay] x=0 -> true; [go] x=0 -> (x'=1); endmodule
    module n y : [0..1]; [b] x=0 -> (y'=0); [c] x=0 -> (y'=1); endmodule
    rewards "r" [go] true : 1; endrewards"""
    lower, upper = symcheck.loads(text).check('<<one>> R{"r"}min=? [ F x=1 ]').bounds
    assert lower <= 1 <= upper <= 1 + 1e-6


def test_little_work_leaves_bounds_that_hold(monkeypatch):
    monkeypatch.setattr("symcheck.check.measures.concurrent._WORK", 1)
    lower, upper = symcheck.loads(hide_or_run("(s'=0)")).check("<<hider>> Pmax=? [ F s=1 ]").bounds
    assert lower <= 1 <= upper


# ------------------------------------------------------------------------------- what is refused


@pytest.mark.parametrize(
    ("property", "options", "message"),
    [
        ("<<even>> Pmax=? [ G F s=1 ]", {}, "probabilities of LTL formulas are not available"),
        ('<<even>> R{"won"}max=? [ C ]', {}, "total rewards are not available"),
        ('<<even>> R{"won"}max=? [ (F s=1) & (F s=0) ]', {}, "not available for concurrent"),
        ("<<even>> Pmax=? [ F s=1 ]", {"exact": True}, "exact computations are not available"),
        ("<<even>> Pmax=? [ F s=1 ]", {"engine": "mtbdd"}, "decision diagrams are not available"),
    ],
)
def test_what_is_refused(property, options, message):
    with pytest.raises(UnsupportedError, match=message):
        check(PENNIES, property, **options)


def test_there_is_no_strategy():
    result = check(PENNIES, "<<even>> Pmax=? [ F s=1 ]", strategy=True)
    assert encloses(result, 2 - sqrt(2))
    with pytest.raises(NoStrategyError, match="strategies are not available for concurrent"):
        _ = result.strategy


EXTREMES = ("0", "1", "1e-300", "1e-16", "1-1e-16", "0.5", "1/3", "1e-9", "2e-300")


def number(text: str) -> Fraction:
    return 1 - Fraction(text[2:]) if text.startswith("1-") else Fraction(text)


@pytest.mark.parametrize("seed", range(12))
def test_bounds_hold_at_extreme_chances(seed: int) -> None:
    """A game of one move, whose value has a closed form."""
    random = Random(seed)
    chances = [[random.choice(EXTREMES) for _ in range(2)] for _ in range(2)]
    commands = " ".join(
        f"[a{i},b{j}] s=0 -> {p} : (s'=1) + 1-({p}) : (s'=2);"
        for i, row in enumerate(chances)
        for j, p in enumerate(row)
    )
    model = symcheck.loads(
        "csg player one m endplayer player two n endplayer\n"
        f"module m s : [0..2]; {commands} [stay] s>0 -> true; endmodule\n"
        "module n t : [0..0]; [b0] s=0 -> true; [b1] s=0 -> true; [c] s>0 -> true; endmodule"
    )
    (a, b), (c, d) = ([number(p) for p in row] for row in chances)
    truth = max(min(a, b), min(c, d))
    if truth < min(max(a, c), max(b, d)):  # no pure strategies are optimal
        truth = (a * d - b * c) / (a + d - b - c)
    for formula in ("<<one>> Pmax=? [ F<=1 s=1 ]", "<<two>> Pmin=? [ F s=1 ]"):
        lower, upper = model.check(formula).bounds
        assert lower <= truth <= upper
