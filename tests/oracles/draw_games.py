"""Random turn-based games as texts, with questions and their answers in fractions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from math import inf
from random import Random
from typing import Any, TypeVar

from oracles import chains, games
from oracles.chains import Row, Value

T = TypeVar("T")

PLAYERS = "abc"
UNKNOWN = Fraction(10**9)
"""The upper bound of an answer of which only a lower one is known."""
STEPS = 40
"""Steps after which rewards that may be lost are compared with those of fewer steps."""


@dataclass(frozen=True)
class Question:
    """A property, and its value in state `state`.

    upper: of an answer that is a limit, what it exceeds by little; the value is a lower bound.
    """

    text: str
    state: int
    value: Value | bool
    upper: Value | None = None


@dataclass(frozen=True)
class Drawn:
    """The text of a model, and questions about it."""

    text: str
    questions: list[Question]


@dataclass(frozen=True)
class Game:
    """Per state its owner and its rows, with a reward for each, and the reward of the state."""

    owners: list[str]
    rows: list[list[Row]]
    rewards: list[list[Fraction]]
    state_rewards: list[Fraction]

    @property
    def text(self) -> str:
        """The game in the language of PRISM-games: choice i of player a has the action ai."""
        lines = ["smg"]
        most = max(map(len, self.rows))
        used = {
            f"{owner}{i}"
            for owner, rows in zip(self.owners, self.rows, strict=True)
            for i in range(len(rows))
        }
        for player in PLAYERS:
            actions = [f"[{player}{i}]" for i in range(most) if f"{player}{i}" in used]
            lines.append(f"player {player} {', '.join(actions)} endplayer")
        lines += ["module m", f"  s : [0..{len(self.rows) - 1}] init 0;"]
        earned = []
        for s, (owner, rows) in enumerate(zip(self.owners, self.rows, strict=True)):
            for i, row in enumerate(rows):
                updates = " + ".join(
                    f"{p.numerator}/{p.denominator}:(s'={t})" for t, p in row.items()
                )
                lines.append(f"  [{owner}{i}] s={s} -> {updates};")
                r = self.rewards[s][i]
                earned.append(f"  [{owner}{i}] s={s} : {r.numerator}/{r.denominator};")
        lines += ["endmodule", 'rewards "r"', *earned, "endrewards", 'rewards "q"']
        lines += [
            f"  s={s} : {r.numerator}/{r.denominator};" for s, r in enumerate(self.state_rewards)
        ]
        return "\n".join([*lines, "endrewards\n"])


def draw(seed: str, *, extreme: bool = False) -> Drawn:
    """A game of 2 to 6 states, and a question of each kind."""
    rng = Random(seed)
    game = _game(rng, extreme=extreme)
    reached = sorted(
        chains.reachable([{t: Fraction(1) for r in c for t in r} for c in game.rows], 0)
    )
    questions: list[Question] = []
    for kind in _KINDS:
        coalition = rng.sample(PLAYERS, rng.randint(0, 3))
        direction = rng.choice(["max", "min"])
        inside = {s for s, owner in enumerate(game.owners) if owner in coalition}
        outside = set(range(len(game.owners))) - inside
        maximiser = inside if direction == "max" else outside
        text, values, upper = kind(rng, game, maximiser)
        state = rng.choice(reached)
        players = ",".join(rng.choice([p, str(PLAYERS.index(p) + 1)]) for p in coalition)
        letter, path = text.split(" ", 1)
        ask = f"<<{players}>> {letter}{direction}=? {path}"
        limit = None if upper is None else upper[state]
        value = values[state]
        questions.append(Question(ask, state, value, limit))
        if limit is None and isinstance(value, Fraction) and not extreme:
            exists = rng.random() < 0.5
            sign = ">" if (direction == "max") == exists else "<"
            brackets = "<<{}>>" if exists else "[[{}]]"
            strict = rng.random() < 0.5
            limit_text = f"{value.numerator}/{value.denominator}"
            comparison = f"{sign}{'' if strict else '='}{limit_text}"
            asked = f"{brackets.format(players)} {letter}{comparison} {path}"
            questions.append(Question(asked, state, not strict))
    return Drawn(game.text, questions)


def _game(rng: Random, *, extreme: bool) -> Game:
    n = rng.randint(2, 6)
    rows = [[_row(rng, n, extreme) for _ in range(rng.choice([1, 1, 2, 2, 3]))] for _ in range(n)]
    paid = [0, 0, 1, 2] if not extreme else [0, 0, 1, Fraction(1, 10**9), 10**17]
    rewards = [[Fraction(rng.choice(paid)) for _ in choices] for choices in rows]
    states = [Fraction(rng.choice(paid)) for _ in rows]
    return Game([rng.choice(PLAYERS) for _ in range(n)], rows, rewards, states)


def _row(rng: Random, n: int, extreme: bool) -> Row:
    successors = rng.sample(range(n), rng.randint(1, min(3, n)))
    if extreme and len(successors) > 1 and rng.random() < 0.5:
        small = rng.choice([Fraction(1, 10**300), Fraction(1, 10**16), Fraction(1, 10**6)])
        first, second = successors[:2]
        return {first: 1 - small, second: small}
    weights = [rng.randint(1, 4) for _ in successors]
    return {t: Fraction(w, sum(weights)) for t, w in zip(successors, weights, strict=True)}


Answer = tuple[str, Sequence[Value], Sequence[Value] | None]
Kind = Callable[[Random, Game, set[int]], Answer]


def _set(rng: Random, game: Game) -> tuple[str, set[int]]:
    n = len(game.rows)
    states = set(rng.sample(range(n), rng.randint(1, max(1, n // 2))))
    return "(" + "|".join(f"s={s}" for s in sorted(states)) + ")", states


def _others(game: Game, states: set[int]) -> set[int]:
    return set(range(len(game.rows))) - states


def _reach(rng: Random, game: Game, maximiser: set[int]) -> Answer:
    text, states = _set(rng, game)
    return f"P [ F {text} ]", games.until(game.rows, maximiser, _others(game, set()), states), None


def _until(rng: Random, game: Game, maximiser: set[int]) -> Answer:
    (left, a), (right, b) = _set(rng, game), _set(rng, game)
    return f"P [ {left} U {right} ]", games.until(game.rows, maximiser, a, b), None


def _globally(rng: Random, game: Game, maximiser: set[int]) -> Answer:
    text, states = _set(rng, game)
    missed = games.until(
        game.rows, _others(game, maximiser), _others(game, set()), _others(game, states)
    )
    return f"P [ G {text} ]", [1 - v for v in missed], None


def _bounded(rng: Random, game: Game, maximiser: set[int]) -> Answer:
    (left, a), (right, b), k = _set(rng, game), _set(rng, game), rng.randint(0, 6)
    return f"P [ {left} U<={k} {right} ]", games.bounded_until(game.rows, maximiser, a, b, k), None


def _always_within(rng: Random, game: Game, maximiser: set[int]) -> Answer:
    (text, a), k = _set(rng, game), rng.randint(0, 6)
    others = _others(game, maximiser)
    missed = games.bounded_until(game.rows, others, _others(game, set()), _others(game, a), k)
    return f"P [ G<={k} {text} ]", [1 - v for v in missed], None


def _next(rng: Random, game: Game, maximiser: set[int]) -> Answer:
    text, states = _set(rng, game)
    start = [Fraction(s in states) for s in range(len(game.rows))]
    return f"P [ X {text} ]", games.stepwise(game.rows, maximiser, start, 1), None


def _after_next(rng: Random, game: Game, maximiser: set[int]) -> Answer:
    text, states = _set(rng, game)
    values = games.until(game.rows, maximiser, _others(game, set()), states)
    return f"P [ X X F {text} ]", games.stepwise(game.rows, maximiser, values, 2), None


def _both(rng: Random, game: Game, maximiser: set[int]) -> Answer:
    (one, a), (other, b) = _set(rng, game), _set(rng, game)
    n = len(game.rows)
    # State s with the sets that were visited before: 4 s + bits.
    rows: list[list[Row]] = []
    for s, bits in product(range(n), range(4)):
        after = bits | (s in a) | 2 * (s in b)
        rows.append([{4 * t + after: p for t, p in row.items()} for row in game.rows[s]])
    mine = {4 * s + bits for s in maximiser for bits in range(4)}
    goal = {
        4 * s + bits
        for s, bits in product(range(n), range(4))
        if bits | (s in a) | 2 * (s in b) == 3
    }
    # Only what is reached from empty sets matters; the rest would multiply the strategies.
    used = chains.reachable([{t: Fraction(1) for r in c for t in r} for c in rows], 0)
    used = (
        set().union(
            *(
                chains.reachable([{t: Fraction(1) for r in c for t in r} for c in rows], 4 * s)
                for s in range(n)
            )
        )
        | used
    )
    rows = [c if i in used and i not in goal else [{i: Fraction(1)}] for i, c in enumerate(rows)]
    strategies = 1
    for c in rows:
        strategies *= len(c)
    if strategies > 400:
        return _next(rng, game, maximiser)
    values = games.until(rows, mine, range(4 * n), goal)
    return f"P [ (F {one}) & (F {other}) ]", values[::4], None


def _for_ever(rng: Random, game: Game, maximiser: set[int]) -> Answer:
    """A formula about what holds infinitely often and from some time on."""
    (one, a), (other, b) = _set(rng, game), _set(rng, game)
    text, accepts = rng.choice(
        [
            (f"G F {one}", lambda c: bool(c & a)),
            (f"F G {one}", lambda c: c <= a),
            (f"(G F {one}) & (F G {other})", lambda c: bool(c & a) and c <= b),
            (f"(G F {one}) | (F G {other})", lambda c: bool(c & a) or c <= b),
        ]
    )
    nothing = [[Fraction(0)] * len(c) for c in game.rows]

    def measure(chain: chains.Chain, _: chains.Column) -> Sequence[Value]:
        good = [c for c in chains.components(chain) if accepts(c)]
        return chains.until(chain, range(len(chain)), set().union(*good))

    return f"P [ {text} ]", games.value(game.rows, maximiser, nothing, measure), None


def _reach_reward(rng: Random, game: Game, maximiser: set[int]) -> Answer:
    text, states = _set(rng, game)
    return (
        f'R{{"r"}} [ F {text} ]',
        games.reach_reward(game.rows, maximiser, game.rewards, states),
        None,
    )


def _kept_reward(rng: Random, game: Game, maximiser: set[int]) -> Answer:
    text, states = _set(rng, game)
    values = games.kept_reward(game.rows, maximiser, game.rewards, states)
    return f'R{{"r"}} [ Fc {text} ]', values, None


def _total(_: Random, game: Game, maximiser: set[int]) -> Answer:
    return 'R{"r"} [ C ]', games.kept_reward(game.rows, maximiser, game.rewards, set()), None


def _lost_reward(rng: Random, game: Game, maximiser: set[int]) -> Answer:
    text, states = _set(rng, game)
    if any(r.denominator > 1 or r > 9 for rewards in game.rewards for r in rewards):
        return _next(rng, game, maximiser)
    lower, near = (
        games.lost_reward(game.rows, maximiser, game.rewards, states, steps)
        for steps in (STEPS, STEPS - 8)
    )
    # The last steps add little: what is to come is less than that, many times over.
    upper = [
        v + 1000 * (v - w) if v - w < Fraction(1, 10**3) else None
        for v, w in zip(lower, near, strict=True)
    ]
    known = [UNKNOWN if u is None else u for u in upper]
    return f'R{{"r"}} [ F0 {text} ]', lower, known


def _cumulated(rng: Random, game: Game, maximiser: set[int]) -> Answer:
    k = rng.randint(0, 6)
    zero = [Fraction(0)] * len(game.rows)
    values = games.stepwise(game.rows, maximiser, zero, k, game.rewards)
    return f'R{{"r"}} [ C<={k} ]', values, None


def _instantaneous(rng: Random, game: Game, maximiser: set[int]) -> Answer:
    k = rng.randint(0, 6)
    values = games.stepwise(game.rows, maximiser, game.state_rewards, k)
    return f'R{{"q"}} [ I={k} ]', values, None


_KINDS: tuple[Kind, ...] = (
    *(_reach, _until, _globally, _bounded, _always_within, _next, _after_next, _both, _for_ever),
    *(_reach_reward, _kept_reward, _total, _lost_reward, _cumulated, _instantaneous),
)


def reachable_game(seed: str) -> Game:
    """A game whose states are all reached from the first one."""
    whole = _game(Random(seed), extreme=False)
    edges = [{t: Fraction(1) for row in choices for t in row} for choices in whole.rows]
    reached = sorted(chains.reachable(edges, 0))
    number = {s: i for i, s in enumerate(reached)}
    return Game(
        [whole.owners[s] for s in reached],
        [[{number[t]: p for t, p in row.items()} for row in whole.rows[s]] for s in reached],
        [whole.rewards[s] for s in reached],
        [whole.state_rewards[s] for s in reached],
    )


def with_choices(game: Game, chosen: Mapping[int, int]) -> Game:
    """The game in which some states have one choice only."""

    def kept(per_choice: list[T], state: int) -> list[T]:
        return [per_choice[chosen[state]]] if state in chosen else per_choice

    return Game(
        game.owners,
        [kept(choices, s) for s, choices in enumerate(game.rows)],
        [kept(rewards, s) for s, rewards in enumerate(game.rewards)],
        game.state_rewards,
    )


def contradiction(question: Question, result: Any) -> str:
    """How a result of a check contradicts the truth; empty if it does not.

    An exact value has to be the truth, bounds contain it, and a verdict is right.
    """
    truth = question.value
    if isinstance(truth, bool):
        return "" if result.value is truth else "verdict"
    low, high = result.bounds
    if low == inf and question.upper == UNKNOWN:
        return ""  # it grows without end
    if inf in (low, truth):
        return "" if low == high == truth else "infinity"
    low, high = Fraction(low), inf if high == inf else Fraction(high)
    if question.upper is not None:
        return "" if high >= truth and low <= question.upper else "limit"
    return "" if low <= truth <= high else "value"
