"""Turn-based games: players, coalitions, values with proofs, and strategies of both sides."""

from __future__ import annotations

from fractions import Fraction
from math import inf

import pytest

import symcheck
from oracles import draw_games
from oracles.draw_games import draw
from symcheck.check.result import Certified, Estimate
from symcheck.errors import InputError, NameFault, NoStrategyError, SyntaxFault, UnsupportedError
from symcheck.kernels.solve.game_sweeps import sweep_game
from symcheck.simulate.steps import CommandSuccessors

ENGINES = [{"engine": "explicit"}, {"engine": "sparse"}, {"engine": "mtbdd"}, {"exact": True}]

# Player b may stay, or leave to a lottery; what a wants is neither sure nor impossible.
LOTTERY = """
smg
player a [a] endplayer
player b [stay], [leave] endplayer
module m
  s : [0..3];
  [stay] s=3 -> true;
  [stay] s=0 -> (s'=0);
  [leave] s=0 -> 0.25:(s'=1) + 0.75:(s'=2);
  [a] s>0 & s<3 -> true;
endmodule
rewards "r" [leave] true : 3; [a] s=1 : 1; endrewards
label "won" = s=1;
"""


# Both can pass for ever: end component {0, 1}, from which value iteration from above never falls.
PASSING = """
smg
player up [give], [leave] endplayer
player down [back], [stop], [end] endplayer
module m
  s : [0..3];
  [give] s=0 -> (s'=1);
  [leave] s=0 -> 0.4:(s'=2) + 0.6:(s'=3);
  [back] s=1 -> (s'=0);
  [stop] s=1 -> 0.9:(s'=2) + 0.1:(s'=3);
  [end] s>1 -> true;
endmodule
"""


def value(text: str, property: str, **options: object) -> object:
    """The value of a property; of an exact check a fraction."""
    return symcheck.loads(text, **options).check(property).value


# ------------------------------------------------------------------------------------------ players


@pytest.mark.parametrize("word", ["smg", "tsg"])
def test_both_words_begin_a_game(word):
    assert value(LOTTERY.replace("smg", word), '<<b>> Pmax=? [ F "won" ]', exact=True) == 0.25


@pytest.mark.parametrize("players", ["b", "2", " b ", "b,b", "2,b"])
def test_players_have_names_and_numbers(players):
    assert value(LOTTERY, f'<<{players}>> Pmax=? [ F "won" ]', exact=True) == Fraction(1, 4)


@pytest.mark.parametrize(
    ("coalition", "direction", "expected"),
    [
        ("a", "max", 0),  # b stays
        ("a", "min", Fraction(1, 4)),  # b leaves
        ("", "max", 0),
        ("", "min", Fraction(1, 4)),
        ("*", "max", Fraction(1, 4)),
        ("a,b", "min", 0),
    ],
)
def test_others_choose_against_a_coalition(coalition, direction, expected):
    assert value(LOTTERY, f'<<{coalition}>> P{direction}=? [ F "won" ]', exact=True) == expected


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ('<<b>> P>=0.25 [ F "won" ]', True),
        ('<<b>> P>0.25 [ F "won" ]', False),
        ('<<b>> P<=0 [ F "won" ]', True),
        ('<<a>> P<=0 [ F "won" ]', False),  # b leaves
        ('[[b]] P<=0.25 [ F "won" ]', True),  # b cannot exceed it
        ('[[b]] P<0.25 [ F "won" ]', False),
        ('[[b]] P>=0.25 [ F "won" ]', False),  # b can stay
        ('P<=0.25 [ F "won" ]', True),  # under all strategies of all players
        ('P>=0.25 [ F "won" ]', False),
        ("P>=1 [ F <<b>> P>=1 [ G s=0 ] ]", True),
    ],
)
def test_a_bound_holds_under_a_strategy_of_the_coalition(text, holds):
    assert value(LOTTERY, text) is holds


def test_a_module_of_a_player_owns_its_unlabelled_commands():
    text = """
    smg
    player one m endplayer
    player two n, [go] endplayer
    module m s:[0..2]; [] s=0 -> (s'=1); [] s=0 -> (s'=2); [go] s=1 -> (s'=2); endmodule
    module n t:[0..1]; [] s=2 -> (t'=1); [go] t=0 -> (t'=1); endmodule
    """
    assert value(text, "<<one>> Pmax=? [ X s=2 ]", exact=True) == 1
    assert value(text, "<<two>> Pmax=? [ X s=2 ]", exact=True) == 0


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (("player a [a] endplayer", "player a [x] endplayer"), NameFault, "unknown action x"),
        (("player a [a] endplayer", "player a k endplayer"), NameFault, "unknown module k"),
        (("player b", "player a"), NameFault, "a second player a"),
        (("[a] endplayer", "[a], [stay] endplayer"), InputError, "belongs to two players"),
        (("smg", "mdp"), InputError, "players belong to games"),
        (("[stay], ", ""), InputError, "action stay belongs to no player"),
        (("[stay] s=0", "[] s=1"), InputError, "module m belongs to no player"),
        (("[a] s>0", "[a] s>=0"), InputError, r"players b and a can both choose in state \(s=0\)"),
    ],
)
def test_faulty_players_are_told(change, error, message):
    with pytest.raises(error, match=message):
        value(LOTTERY.replace(*change), '<<b>> Pmax=? [ F "won" ]')


def test_a_game_needs_players():
    with pytest.raises(InputError, match="a game needs players"):
        value("smg module m s:[0..1]; endmodule", "Pmax=? [ F s=1 ]")


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("<<c>> Pmax=? [ F s=1 ]", NameFault, "there is no player c"),
        ("<<0>> Pmax=? [ F s=1 ]", NameFault, "there is no player 0"),
        ("<<3>> Pmax=? [ F s=1 ]", NameFault, "there is no player 3"),
        ("<<a;b>> Pmax=? [ F s=1 ]", SyntaxFault, "no coalition of players"),
        ("<<a>> P=? [ F s=1 ]", InputError, "no unique value"),
    ],
)
def test_faulty_coalitions_are_told(text, error, message):
    with pytest.raises(error, match=message):
        value(LOTTERY, text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<<b>> Smax=? [ s=1 ]", "long-run averages are not available"),
        ('<<b>> R{"r"}max=? [ C discount=0.5 ]', "discounted rewards are not available"),
        ('<<b>> Pmax=? [ F{"r"}<=3 s=1 ]', "bounds on rewards are not available"),
        ("E [ F s=1 ]", "operators A and E are not available"),
    ],
)
def test_what_games_do_not_have_is_refused_by_name(text, message):
    with pytest.raises(UnsupportedError, match=message):
        value(LOTTERY, text)


def test_a_formula_of_several_pairs_is_refused():
    text = """
    smg
    player a [a] endplayer
    player b [b] endplayer
    module m
      s : [0..3];
      [a] s<2 -> (s'=0); [a] s<2 -> (s'=1); [a] s<2 -> (s'=2);
      [b] s>1 -> (s'=3); [b] s>1 -> (s'=1); [b] s>1 -> (s'=2);
    endmodule
    """
    formula = "(F G s!=0 | G F s=1) & (F G s!=2 | G F s=3)"
    with pytest.raises(UnsupportedError, match="one Rabin pair"):
        value(text, f"<<a>> Pmax=? [ {formula} ]")


def test_negative_rewards_need_a_bound():
    text = PASSING + 'rewards "r" [leave] true : -3; [back] true : 1; endrewards'
    assert value(text, '<<up>> R{"r"}min=? [ C<=2 ]', exact=True) == -3
    for path in ("F s>1", "Fc s>1", "F0 s>1", "C"):
        with pytest.raises(UnsupportedError, match=r"negative .*; C<=k is"):
            value(text, f'<<up>> R{{"r"}}min=? [ {path} ]')


def test_rewards_fc_and_f0_belong_to_games():
    mdp = "mdp module m s:[0..1]; [] true -> (s'=1); endmodule rewards s=0:1; endrewards"
    with pytest.raises(UnsupportedError, match="Fc and F0 are not available"):
        value(mdp, "Rmax=? [ Fc s=1 ]")


def test_fc_and_f0_remain_names():
    text = "dtmc module m F0:bool; Fc:bool; [] true -> (F0'=true); endmodule rewards true:1; endrewards"
    assert float(symcheck.loads(text).check("R=? [ F F0 ]")) == 1
    assert float(symcheck.loads(text).check("R=? [ F0 ]")) == inf  # not in the first state
    assert float(symcheck.loads(text).check("R=? [ true U F0 ]")) == 1


# ------------------------------------------------------------------------------------------- values


@pytest.mark.parametrize("options", ENGINES, ids=str)
@pytest.mark.parametrize("seed", range(2))
def test_random_games_against_all_pairs_of_strategies(seed, options):
    drawn = draw(f"test {seed}")
    model = symcheck.loads(drawn.text, **options)
    for question in drawn.questions:
        if options.get("exact") and "F0" in question.text:
            continue  # refused, or the value of a longer computation: see below
        result = model.check(f"filter(state, {question.text}, s={question.state})")
        assert draw_games.contradiction(question, result) == "", question


@pytest.mark.parametrize("seed", range(3))
def test_extreme_games(seed):
    drawn = draw(f"extreme {seed}", extreme=True)
    for options in ({"engine": "explicit"}, {"exact": True}):
        model = symcheck.loads(drawn.text, **options)
        for question in drawn.questions:
            result = model.check(f"filter(state, {question.text}, s={question.state})")
            assert draw_games.contradiction(question, result) == "", question


@pytest.mark.parametrize("method", ["auto", "policy", "interval", "topological"])
def test_bounds_meet_in_end_components(method):
    result = symcheck.loads(PASSING, method=method).check("<<up>> Pmax=? [ F s=2 ]")
    accuracy = result.accuracy
    low, high = (
        (accuracy.lower, accuracy.upper) if isinstance(accuracy, Certified) else (result.value,) * 2
    )
    assert low - 1e-12 <= 0.4 <= high + 1e-12
    assert high - low < 1e-6


def test_a_small_game_is_not_swept_for_ever(monkeypatch):
    sweeps = []

    def counted(*arguments):
        sweeps.append(1)
        return sweep_game(*arguments)

    monkeypatch.setattr("symcheck.numerics.linear.games.sweep_game", counted)
    monkeypatch.setattr("symcheck.numerics.tuning.GAME_ENTRIES", 100_000)
    text = """smg player a [s],[u],[v],[w] endplayer player b [t],[y] endplayer module m x:[0..7];
    [s] x=0 -> 0.3:(x'=3) + 0.7:(x'=1); [u] x=1 -> (x'=4); [t] x=2 -> (x'=0);
    [u] x=3 -> 1e-12:(x'=6) + 1-1e-12:(x'=3); [v] x=3 -> 1e-12:(x'=3) + 1-1e-12:(x'=7);
    [w] x=3 -> 1-1e-16:(x'=5) + 1e-16:(x'=3); [t] x=4 -> 1e-16:(x'=0) + 1-1e-16:(x'=6);
    [y] x=4 -> 1-1e-12:(x'=2) + 1e-12:(x'=4); [t] x=5 -> 0.5:(x'=6) + 0.5:(x'=3);
    [y] x=5 -> 1e-12:(x'=7) + 1-1e-12:(x'=3); endmodule"""
    assert value(text, "<<a>> Pmax=? [ G F x=7 ]") == pytest.approx(0.3, abs=1e-6)
    assert 0 < len(sweeps) < 3_000


def test_the_power_method_is_an_estimate():
    """A change that is small says nothing: each round of the duel adds a thousandth of the rest."""
    model = symcheck.load("models/duel/duel.prism")
    question = '<<first>> Pmax=? [ F "first" ]'
    true = 1 / 1.999
    proved = model.check(question).accuracy
    assert isinstance(proved, Certified)
    assert proved.lower <= true <= proved.upper
    stopped = model.with_options(method="power").check(question)
    assert isinstance(stopped.accuracy, Estimate)
    assert abs(stopped.value - true) > 1e-4


@pytest.mark.parametrize("method", ["power", "interval", "optimistic"])
@pytest.mark.parametrize(
    "text", ["<<up>> Pmax=? [ (G F s=0) | (F G s=2) ]", '<<up>> R{"r"}max=? [ F0 s=2 ]']
)
def test_measures_that_need_bounds_on_the_way_take_any_method(text, method):
    game = PASSING + 'rewards "r" [leave] true : 3; endrewards'
    proved = symcheck.loads(game).check(text)
    result = symcheck.loads(game, method=method).check(text)
    assert result.value == proved.value
    assert type(result.accuracy) is type(proved.accuracy)


def test_rewards_of_the_three_kinds():
    """A run may collect for ever before it reaches the target, or miss it."""
    text = """
    smg
    player up [on], [off], [end] endplayer
    player down [low], [high] endplayer
    module m
      s : [0..4];
      [on] s=0 -> 0.5:(s'=0) + 0.5:(s'=1);
      [off] s=0 -> (s'=3);
      [low] s=1 -> (s'=2);
      [high] s=1 -> (s'=3);
      [end] s>1 -> true;
    endmodule
    rewards "r" [on] true : 1; [high] true : 2; endrewards
    """
    model = symcheck.loads(text, exact=True)
    assert model.check('<<up>> R{"r"}max=? [ F s=3 ]').value == 4  # s=2 would be infinite
    assert model.check('<<up>> R{"r"}max=? [ Fc s=3 ]').value == 2
    assert model.check('<<up>> R{"r"}max=? [ F0 s=3 ]').value == 0.5
    assert model.check('<<down>> R{"r"}max=? [ F0 s=3 ]').value == 0
    assert model.check('<<up,down>> R{"r"}max=? [ Fc s=3 ]').value == 4


def test_strategies_of_lost_rewards_need_memory():
    """With n points, another round adds a point, or loses all with probability 1/8."""
    text = """
    smg
    player up [more], [stop] endplayer
    player down [risk], [end] endplayer
    module m
      s : [0..3];
      [more] s=0 -> (s'=1);
      [stop] s=0 -> (s'=2);
      [risk] s=1 -> 7/8:(s'=0) + 1/8:(s'=3);
      [end] s>1 -> true;
    endmodule
    rewards "r" [more] true : 1; endrewards
    """
    # Stopping after n rounds gives n (7/8)^n, which is greatest for n = 7 and 8.
    result = symcheck.loads(text).check('<<up>> R{"r"}max=? [ F0 s=2 ]')
    assert float(result) == pytest.approx(7 * (7 / 8) ** 7, rel=1e-9)


def test_timed_games_count_units_of_time():
    """The sender decides when to send, from 2 to 5 units; the receiver acknowledges after 1 to 4."""
    text = """
    tptg
    player sender [send] endplayer
    player receiver [ack], [end] endplayer
    module m
      s : [0..2];
      x : clock;
      invariant (s=0 => x<=5) & (s=1 => x<=4) endinvariant
      [send] s=0 & x>=2 -> (s'=1) & (x'=0);
      [ack] s=1 & x>=1 -> 0.5:(s'=2) + 0.5:(s'=0) & (x'=0);
      [end] s=2 -> true;
    endmodule
    rewards "time" true : 1; endrewards
    """
    model = symcheck.loads(text, exact=True)
    for coalition, rounds in (("sender,receiver", 3), ("sender", 6), ("receiver", 6), ("", 9)):
        result = model.check(f'<<{coalition}>> R{{"time"}}min=? [ F s=2 ]')
        assert result.value == 2 * rounds
    assert model.check("<<receiver>> Pmax=? [ F<=6 s=2 ]").value == Fraction(1, 2)
    assert model.check("<<receiver>> Pmax=? [ F<=5 s=2 ]").value == 0
    assert model.check("<<sender,receiver>> Pmax=? [ F<=6 s=2 ]").value == Fraction(3, 4)
    with pytest.raises(UnsupportedError, match="bounds <=k only"):
        model.check("<<receiver>> Pmax=? [ F<6 s=2 ]")


def test_games_are_stepped_through():
    steps = CommandSuccessors(symcheck.loads(LOTTERY).bound)
    assert list(steps.initial()) == [(0,)]


def test_games_have_numbers_as_probabilities():
    with pytest.raises(InputError, match="games with intervals are not supported"):
        value(LOTTERY.replace("0.25:(s'=1)", "[0.2,0.3]:(s'=1)"), "<<b>> Pmax=? [ F s=1 ]")


# --------------------------------------------------------------------------------------- strategies

_WITHOUT_MEMORY = (
    draw_games._reach,
    draw_games._until,
    draw_games._globally,
    draw_games._next,
    draw_games._reach_reward,
    draw_games._kept_reward,
    draw_games._total,
)


@pytest.mark.parametrize("kind", _WITHOUT_MEMORY, ids=lambda k: k.__name__)
@pytest.mark.parametrize("seed", range(3))
def test_each_side_attains_the_value_whatever_the_other_one_does(seed, kind):
    drawn = draw_games.reachable_game(f"strategy {seed}")
    model = symcheck.loads(drawn.text, strategy=True)
    for coalition in ("a", "b,c"):
        mine = {s for s, owner in enumerate(drawn.owners) if owner in coalition}
        question = draw_games.Random(f"{seed}")
        text, values, _ = kind(question, drawn, mine)
        letter, path = text.split(" ", 1)
        strategy = model.check(f"<<{coalition}>> {letter}max=? {path}").strategy
        first = strategy.engine.matrix.groups[:-1]
        chosen = (strategy.rows - first).tolist()
        for side in (mine, set(range(len(drawn.rows))) - mine):
            fixed = draw_games.with_choices(drawn, {s: chosen[s] for s in side})
            assert kind(draw_games.Random(f"{seed}"), fixed, mine)[1] == values


def test_a_strategy_counts_steps():
    model = symcheck.loads(LOTTERY, strategy=True)
    strategy = model.check('<<b>> Pmax=? [ F<=2 "won" ]').strategy
    assert strategy[0, 0] in ("stay", "leave")
    assert strategy[0, 1] == "leave"  # the last step counts


def test_strategies_that_are_not_built_are_refused():
    text = PASSING + 'rewards "r" [leave] true : 3; endrewards'
    model = symcheck.loads(text, strategy=True)
    for text, message in (
        ('<<up>> R{"r"}max=? [ F0 s=2 ]', "the reward F0, which need memory"),
        ("<<up>> Pmax=? [ (G F s=0) | (F G s=2) ]", "formulas that finite prefixes of runs decide"),
    ):
        result = model.check(text)
        with pytest.raises(NoStrategyError, match=message):
            _ = result.strategy


# The values of Piglet with a goal of two points, of the player to move: (own points, the other's
# points, the total of the turn) (Neller & Presser 2004, section 3).
PIGLET = {
    (0, 0, 0): Fraction(4, 7),
    (0, 0, 1): Fraction(5, 7),
    (0, 1, 0): Fraction(2, 5),
    (0, 1, 1): Fraction(3, 5),
    (1, 0, 0): Fraction(4, 5),
    (1, 1, 0): Fraction(2, 3),
}


@pytest.mark.parametrize("options", ENGINES, ids=str)
def test_piglet(options):
    model = symcheck.load("models/pig/piglet.prism", constants={"goal": 2}, **options)
    for (mine, theirs, total), expected in PIGLET.items():
        for turn, player, other in ((1, "one", "two"), (2, "two", "one")):
            if (turn, mine, theirs, total) == (1, 0, 0, 1) or turn == 2 or total == 0:
                state = f"turn={turn} & {player}={mine} & {other}={theirs} & total={total}"
                result = model.check(f'filter(max, <<{turn}>> Pmax=? [ F "{player}" ], {state})')
                assert abs(result.value - expected) <= Fraction(1, 10**9)
