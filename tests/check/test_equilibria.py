"""Equilibria of concurrent games: values against trees in fractions, and what is refused."""

from __future__ import annotations

from fractions import Fraction
from random import Random

import pytest

import symcheck
from oracles import concurrent, equilibria
from symcheck.check.result import Estimate
from symcheck.errors import InputError, NotInResultError, NumericalError, UnsupportedError

MEETING = """
csg
player one one endplayer
player two two endplayer
module one [opera] at=0 -> true; [match] at=0 -> true; endmodule
module two [opera2] at=0 -> true; [match2] at=0 -> true; endmodule
module place
  at : [0..2];  // at home, at the opera, at the match
  [opera,opera2] at=0 -> (at'=1);
  [match,match2] at=0 -> (at'=2);
  [opera,match2] at=0 -> true;
  [match,opera2] at=0 -> true;
endmodule
rewards "one" at=1 : 3; at=2 : 2; endrewards
rewards "two" at=1 : 2; at=2 : 3; endrewards
"""
"""The battle of the sexes, until the two meet."""


def repeated(one: str, two: str) -> str:
    """A game of two actions, which ends with probability 1/2 after each step.

    one, two: the payoffs if both take the first action, only two the second one, only one, both.
    """

    def rewards(name: str, payoffs: str) -> str:
        pairs = zip(("a,c", "a,d", "b,c", "b,d"), payoffs.split(), strict=True)
        items = " ".join(f"[{actions}] true : {payoff};" for actions, payoff in pairs)
        return f'rewards "{name}" {items} endrewards'

    return f"""
csg
player one one endplayer
player two two endplayer
module one [a] !over -> true; [b] !over -> true; endmodule
module two [c] !over -> true; [d] !over -> true; endmodule
module end over : bool init false; [] !over -> 1/2:(over'=true) + 1/2:true; endmodule
{rewards("one", one)}
{rewards("two", two)}
"""


DILEMMA = repeated("3 0 5 1", "3 5 0 1")
CHICKEN = repeated("6 2 7 0", "6 7 2 0")


def found(asked: str, text: str, **options: object) -> list[float]:
    """The value of a property, and those of its objectives."""
    result = symcheck.loads(text, **options).check(asked)
    return [float(result), *(float(v[0]) for v in result.objectives)]


# -------------------------------------------------------------------------------------- closed forms


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("", (28 / 3, 14 / 3, 14 / 3)),  # mixed; the pure equilibria are 7 + 2 and 2 + 7
        ("{nash,fair}", (28 / 3, 14 / 3, 14 / 3)),
        ("{corr}", (21 / 2, 21 / 4, 21 / 4)),
        ("{fair,corr}", (21 / 2, 21 / 4, 21 / 4)),
    ],
)
def test_one_step_is_a_bimatrix_game(kind, values):
    asked = f'<<one:two>>{kind} max=? (R{{"one"}} [ C<=1 ] + R{{"two"}} [ C<=1 ])'
    assert found(asked, CHICKEN) == pytest.approx(values)


def test_rewards_until_a_state_is_reached():
    # Both defect in each step, of which there are two in expectation.
    asked = '(R{"one"} [ F over ] + R{"two"} [ F over ])'
    assert found(f"<<one:two>> max=? {asked}", DILEMMA) == pytest.approx([4, 2, 2])
    # Who minimises cooperates by giving nothing: the first action dominates.
    assert found(f"<<one:two>> min=? {asked}", DILEMMA) == pytest.approx([12, 6, 6])


def test_an_objective_that_goes_on_is_helped_after_the_bound_of_the_other_one():
    # Both defect first; from then on, two lets one have 5 in each step.
    asked = '<<one:two>> max=? (R{"one"} [ F over ] + R{"two"} [ C<=1 ])'
    assert found(asked, DILEMMA) == pytest.approx([1 + 5 + 1, 6, 1])
    asked = '<<two:one>> max=? (R{"two"} [ C<=1 ] + R{"one"} [ C<=3 ])'
    assert found(asked, DILEMMA) == pytest.approx([1 + 1 + 5 / 2 + 5 / 4, 1, 1 + 15 / 4])


def test_probabilities():
    for objectives, values in (
        ("max=? (P [ X at=1 ] + P [ X at=2 ])", [1, 1, 0]),
        ("{fair} max=? (P [ X at=1 ] + P [ X at=2 ])", [0, 0, 0]),  # they miss each other
        ("{corr,fair} max=? (P [ X at=1 ] + P [ X at=2 ])", [1, 0.5, 0.5]),
        ("max=? (P [ F at>0 ] + P [ F at>0 ])", [2, 1, 1]),
        ("max=? (P [ F at=1 ] + P [ at=0 U<=2 at=2 ])", [1, 1, 0]),
        ("max=? (P [ G at=0 ] + P [ G<=5 at!=2 ])", [2, 1, 1]),
        ("min=? (P [ F at=1 ] + P [ F at=2 ])", [0, 0, 0]),
        ("max=? (P [ at=0 ] + P [ F at=2 ])", [2, 1, 1]),
        ('max=? (R{"one"} [ I=1 ] + R{"two"} [ I=1 ])', [5, 3, 2]),
        ('max=? (R{"one"} [ I=0 ] + R{"two"} [ I=2 ])', [3, 0, 3]),
    ):
        assert found(f"<<one:two>> {objectives}", MEETING) == pytest.approx(values), objectives


def test_coalitions_are_named_or_numbered():
    text = """
    csg
    player one a endplayer
    player two b endplayer
    player three c endplayer
    module a x : [0..1]; [x] x=0 -> true; [y] x=0 -> (x'=1); endmodule
    module b = a [ x=s, y=t, x=v ] endmodule
    module c z : [0..1]; [z] z=0 -> (z'=1); [w] z=0 -> true; endmodule
    """.replace("module b = a [ x=s, y=t, x=v ]", "module b v : [0..1]; [s] v=0 -> (v'=1);")
    for players in ("one,3:two", "3,1:2"):
        asked = f"<<{players}>> max=? (P [ X x=1 & z=1 ] + P [ F v=1 ])"
        assert found(asked, text) == [2, 1, 1]


def test_thresholds_compare_the_sum():
    model = symcheck.loads(MEETING)
    objectives = '(R{"one"} [ I=1 ] + R{"two"} [ I=1 ])'
    assert model.check(f"<<one:two>> max>=4.99 {objectives}").value is True
    assert model.check(f"<<one:two>> max>5.01 {objectives}").value is False
    assert model.check(f"at=0 & !(<<one:two>> max<4.5 {objectives})").value is True
    result = model.check(f"<<one:two>> max>=4.99 {objectives}")
    assert str(result) == "true"
    assert result.explanation == "satisfied in the initial state: 3.0 + 2.0"


@pytest.mark.parametrize("bound", [">=5", ">5", "<5.000000001"])
def test_an_estimate_decides_no_threshold_that_is_near(bound):
    asked = f'<<one:two>> max{bound} (R{{"one"}} [ I=1 ] + R{{"two"}} [ I=1 ])'
    with pytest.raises(NumericalError, match="cannot decide"):
        symcheck.loads(MEETING).check(asked)


def test_values_of_other_states():
    model = symcheck.loads(MEETING)
    asked = "<<one:two>> max=? (P [ F at=1 ] + P [ F at=2 ])"
    assert model.check(f"filter(min, {asked}, at=2)").value == 1
    assert [float(v[{"at": 2}]) for v in model.check(asked).objectives] == [0, 1]


# --------------------------------------------------------------------------------- honest and refused


def test_a_value_is_an_estimate():
    result = symcheck.loads(MEETING).check("<<one:two>> max=? (P [ X at=1 ] + P [ X at=1 ])")
    assert result.accuracy == Estimate()
    assert str(result) == "2.0 (estimate)"
    assert result.explanation == "value in the initial state: 1.0 + 1.0"
    assert result.warnings == ()
    with pytest.raises(UnsupportedError, match="has no bounds"):
        _ = result.bounds
    with pytest.raises(UnsupportedError, match="certificates are not available"):
        result.certificate()


def test_other_results_have_no_objectives():
    with pytest.raises(NotInResultError, match="no objectives"):
        _ = symcheck.loads(MEETING).check("<<one>> Pmax=? [ F at=1 ]").objectives


def test_values_that_do_not_converge():
    asked = '<<one:two>> max=? (R{"one"} [ F over ] + R{"two"} [ F over ])'
    with pytest.raises(NumericalError, match="of 3 steps of value iteration still differ by"):
        found(asked, DILEMMA, max_iterations=3)


REACH = "P [ F at=1 ]"


@pytest.mark.parametrize(
    ("property", "message"),
    [
        (f"<<one:two>> max=? ({REACH} + P [ F>=2 at=1 ])", "no lower bound on steps"),
        (f"<<one:two>> max=? ({REACH} + P [ F G at=1 ])", "probabilities of LTL formulas"),
        (f'<<one:two>> max=? ({REACH} + R{{"one"}} [ C ])', "total rewards"),
        (f'<<one:two>> max=? ({REACH} + R{{"one"}} [ F at=1 ])', "this one may be missed from"),
        (
            f"<<one:two:>> max=? ({REACH} + {REACH} + {REACH})",
            "of two coalitions are supported, and here are 3",
        ),
    ],
)
def test_what_is_not_supported(property, message):
    with pytest.raises(UnsupportedError, match=message):
        symcheck.loads(MEETING).check(property)


@pytest.mark.parametrize(
    ("players", "message"),
    [
        ("<<one:one>>", "player one is in several coalitions of the equilibrium"),
        ("<<:one>>", "player two is in no coalition of the equilibrium"),
        ("<<one:three>>", "there is no player three"),
    ],
)
def test_each_player_belongs_to_one_coalition(players, message):
    with pytest.raises(InputError, match=message):
        symcheck.loads(MEETING).check(f"{players} max=? ({REACH} + {REACH})")


def test_other_models_have_no_equilibria():
    mdp = "mdp module m at : [0..1]; [] true -> (at'=1); endmodule"
    with pytest.raises(InputError, match="named players belong to stochastic games"):
        symcheck.loads(mdp).check(f"<<one:two>> max=? ({REACH} + {REACH})")
    smg = "smg player one m endplayer player two endplayer " + mdp.removeprefix("mdp")
    with pytest.raises(UnsupportedError, match="equilibria are not available for stochastic games"):
        symcheck.loads(smg).check(f"<<one:two>> max=? ({REACH} + {REACH})")


def test_what_equilibria_do_not_have():
    asked = f"<<one:two>> max=? ({REACH} + {REACH})"
    result = symcheck.loads(MEETING, strategy=True).check(asked)
    assert result.no_strategy == "strategies are not available for concurrent stochastic games"
    for options in ({"exact": True}, {"engine": "mtbdd"}):
        with pytest.raises(UnsupportedError):
            symcheck.loads(MEETING, **options).check(asked)


def test_other_properties_of_a_file_are_answered():
    text = f"<<one:two:>> max=? ({REACH} + {REACH} + {REACH}); <<one>> Pmax=? [ X at=0 ]"
    refused, answered = symcheck.parse_properties(text).properties
    model = symcheck.loads(MEETING)
    with pytest.raises(UnsupportedError, match="and here are 3"):
        model.check(refused.span.text)
    assert model.check(answered.span.text).value == pytest.approx(0.5)


# ------------------------------------------------------------------------- against trees of fractions

Pair = tuple[Fraction, Fraction]


class Objective:
    """The reward of some steps, or the probability of a goal within them."""

    def __init__(self, random: Random, game: concurrent.Game, name: str):
        states = range(len(game))
        self.steps = random.randint(1, 5 - max(map(len, game)))
        self.goal = set(random.sample(states, random.randint(1, 2))) if name == "p" else set()
        self.name = name
        self.earned = [[[random.randint(0, 3) for _ in r] for r in m] for m in game]

    def text(self, structure: str) -> str:
        if self.name == "r":
            return f'R{{"{structure}"}} [ C<={self.steps} ]'
        goal = "|".join(f"s={s}" for s in sorted(self.goal))
        return f"P [ F<={self.steps} {goal} ]"

    def rewards(self, structure: str) -> str:
        items = [
            f"  [a{i},b{j}] s={s} : {earned};"
            for s, matrix in enumerate(self.earned)
            for i, row in enumerate(matrix)
            for j, earned in enumerate(row)
        ]
        return "\n".join([f'rewards "{structure}"', *items, "endrewards"])

    def settled(self, state: int, left: int) -> Fraction | None:
        """Its value if nothing changes it any more."""
        if state in self.goal:
            return Fraction(1)
        return Fraction(0) if left == 0 else None


def tree(
    game: concurrent.Game, objectives: list[Objective], solve: object, sign: int, state: int
) -> Pair:
    """The values in equilibria of all subgames, by recursion over the steps."""

    def helped(which: int, state: int, left: int) -> Fraction:
        objective = objectives[which]
        value = objective.settled(state, left)
        if value is not None:
            return sign * value
        return max(
            sign * (objective.name == "r") * objective.earned[state][i][j]
            + sum(p * helped(which, t, left - 1) for t, p in to.items())
            for i, row in enumerate(game[state])
            for j, (_, to) in enumerate(row)
        )

    def played(state: int, left: tuple[int, int]) -> Pair:
        if any(o.settled(state, n) is not None for o, n in zip(objectives, left, strict=True)):
            return helped(0, state, left[0]), helped(1, state, left[1])
        after = (left[0] - 1, left[1] - 1)
        payoffs = [
            [
                [
                    sign * (o.name == "r") * o.earned[state][i][j]
                    + sum((p * played(t, after)[k] for t, p in to.items()), Fraction(0))
                    for j, (_, to) in enumerate(row)
                ]
                for i, row in enumerate(game[state])
            ]
            for k, o in enumerate(objectives)
        ]
        return solve(*payoffs)

    one, two = played(state, (objectives[0].steps, objectives[1].steps))
    return sign * one, sign * two


@pytest.mark.parametrize("seed", range(16))
def test_bounded_objectives_of_random_games(seed):
    random = Random(seed)
    game = concurrent.draw(random, 3, 2 + seed % 2)
    objectives = [Objective(random, game, random.choice("pr")) for _ in range(2)]
    rewards = [o.rewards(f"r{i}") for i, o in enumerate(objectives)]
    model = symcheck.loads("\n".join([concurrent.text(game), *rewards]))
    asked = " + ".join(o.text(f"r{i}") for i, o in enumerate(objectives))
    correlated = seed % 2 == 0 and seed % 3 == 0  # of two actions, which takes long
    for direction, sign in (("max", 1), ("min", -1)):
        for fair in (False, True):
            kind = ("corr" if correlated else "nash") + "," + ("fair" if fair else "social")

            def solve(one: equilibria.Matrix, two: equilibria.Matrix, fair: bool = fair) -> Pair:
                pick = equilibria.correlated if correlated else equilibria.nash
                return pick(one, two, fair=fair)

            result = model.check(f"<<one:two>>{{{kind}}} {direction}=? ({asked})")
            wanted = tree(game, objectives, solve, sign, 0)
            values = [float(v[0]) for v in result.objectives]
            assert values == pytest.approx(list(map(float, wanted)), abs=1e-6), kind
            assert float(result) == pytest.approx(sum(values))
            assert result.accuracy == Estimate()
