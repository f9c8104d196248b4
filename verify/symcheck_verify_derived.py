"""Rules of `symcheck_verify` about a model that is made of the given one.

In time, it is the uniformised chain of a ctmc. For LTL formulas, conditions and bounds on rewards
it is a product with a memory, whose states are the pairs (state, memory): the rules about models
are applied to it, and this file has what leads there: the automaton of a formula, which is compared
with the formula, the components that it accepts, and sums of rewards.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import cache
from math import lcm
from typing import Any, NamedTuple

from symcheck_verify import (
    BUDGET,
    ONE,
    Model,
    Proofs,
    Rejected,
    Reward,
    Row,
    Side,
    States,
    Steps,
    divided,
    number_of,
    scaled,
    states_of,
    until_bound,
)

__all__ = ["proved"]


def proved(
    model: Model, about: Any, evidence: Any, reward: Reward, earned: Any, notes: list[str]
) -> Proofs:
    """The lower and the upper bounds that are proved of the measure of a statement.

    Args:
        model: the model.
        about: the statement.
        evidence: what proves it.
        reward: the rewards that it names.
        earned: what a step from a state by a row earns.
        notes: is told what is trusted.
    """
    match about["measure"]:
        case "ltl":
            return linear_time(model, about, evidence, notes)
        case "conditional":
            return conditional(model, about, evidence, notes)
        case "until" if "reward" in about:
            return within_rewards(model, about, evidence, reward)
    time, everywhere = number_of(about["time"]), range(model.states)
    match about["measure"]:
        case "until":
            left, right = states_of(model, about["left"]), states_of(model, about["right"])
            low, high = in_time(model, time, [int(s in right) for s in everywhere], left - right)
            return low, lambda s: min(high(s) or Fraction(0), Fraction(1))
        case "cumulative":
            rates = [earned(s, s) / model.stay(s) for s in everywhere]  # row s is that of state s
            return in_time(model, time, rates, frozenset(everywhere), added=True)
        case _:
            of_states = [reward.of_state.get(s, Fraction(0)) for s in everywhere]
            return in_time(model, time, of_states, frozenset(everywhere))


# --------------------------------------------------------------------------------------------- time


def in_time(
    model: Model, time: Fraction, start: Sequence[Any], free: States, *, added: bool = False
) -> Proofs:
    """Bounds of the mean of `start` at a time in a ctmc that moves in the free states only.

    With `added`, of its integral up to this time. By uniformisation (Jensen 1953): the chain steps
    at the greatest exit rate q, and some steps stay; their number N has a Poisson distribution with
    mean q time. The mean after k steps counts with the weight P(N = k), or with P(N > k) / q; the
    latter sum to the time. What is left out counts with the greatest value, or not at all.
    """
    if model.exit_rates is None or time < 0 or min(start) < 0:
        raise Rejected("a ctmc, a time and rewards of at least 0 are needed")
    rate = max((model.exit_rates[s] for s in free), default=Fraction(1))
    if rate * time > BUDGET:
        raise Rejected(f"{int(rate * time)} jumps are expected: more than the budget of {BUDGET}")
    jumps = Model("dtmc", model.first)
    for s, row in enumerate(model.rows):
        num, den = (model.exit_rates[s] / rate).as_integer_ratio() if s in free else (0, 1)
        stays = (den - num) * row.denominator
        moves = (num * w for w in row.weights)
        jumps.rows.append(Row((*moves, stays), (*row.targets, s), den * row.denominator))
    steps, (first, early, weights, later) = Steps(jumps, free), _poisson(rate * time)
    if added:
        tails, low, high = list[Bounds](), Fraction(0), later
        for least, most in reversed(weights):
            tails.append((low / rate, min(high, Fraction(1)) / rate))
            low, high = low + least, high + most
        weights, early = tails[::-1], (low / rate, 1 / rate)
        later = time - first * early[0] - sum((low for low, _ in tails), Fraction(0))
    sides: list[list[int]] = []
    for up in (False, True):
        sums: list[int] = [scaled(later * max(start), up=True) * ONE if up else 0] * model.states
        walk, before, taken = steps.values(start, up=up), list[int](), 0
        while taken < first + len(weights):
            values = next(walk, before)
            weight = early[up] if taken < first else weights[taken - first][up]
            if settled := values is before:  # and so are they for all weights that are left
                rest = weights[max(taken - first, 0) :]
                weight = sum((w[up] for w in rest), early[up] * max(first - taken, 0))
            factor, before = scaled(weight, up=up), values
            sums = [total + factor * value for total, value in zip(sums, values, strict=True)]
            taken += first + len(weights) if settled else 1
        sides.append(sums)
    return lambda s: Fraction(sides[0][s], ONE**2), lambda s: Fraction(sides[1][s], ONE**2)


Bounds = tuple[Fraction, Fraction]


def _poisson(mean: Fraction) -> tuple[int, Bounds, list[Bounds], Fraction]:
    """Bounds of the probabilities of numbers of events, and an upper one of all that are left out.

    They are the first number, bounds of each number before it, those from there on, and the rest.
    The terms mean**k / k! are computed relative to the greatest one, until they are below
    2**-96 of it; geometric series bound what follows on both sides. Their sum divides them.
    """
    k = mode = int(mean)
    low, high = {mode: ONE}, {mode: ONE}
    while k > 0 and low[k] > 0:
        ratio = k / mean
        low[k - 1] = low[k] * ratio.numerator // ratio.denominator
        high[k - 1] = divided(high[k] * ratio.numerator, ratio.denominator, up=True)
        k -= 1
    first, k = k, mode
    while low[k] > 0:
        k, ratio = k + 1, mean / (k + 1)
        low[k] = low[k - 1] * ratio.numerator // ratio.denominator
        high[k] = divided(high[k - 1] * ratio.numerator, ratio.denominator, up=True)
    rising = mean / (k + 1)
    above = high[k] * rising / (1 - rising)
    falling = first / mean if first else Fraction(0)
    below = high[first] * falling / (1 - falling)
    least, most = sum(low.values()), sum(high.values()) + above + below
    weights = [(low[i] / most, Fraction(high[i], least)) for i in range(first, k + 1)]
    return first, (Fraction(0), below / least), weights, above / least


# ------------------------------------------------------------------------------------- LTL formulas

_MOST_EDGES, _MOST_WAYS = 200_000, 2_000
"""Edges of an automaton and a formula, and combinations of ways to satisfy two formulas, up to
which languages are compared."""


class _TooLarge(Exception):
    pass


Formula = tuple[Any, ...]
Way = tuple[frozenset[Formula], frozenset[Formula]]  # what has to hold next; what is put off
_DUAL = {"and": "or", "or": "and", "U": "R"}


def _positive(data: Any, atoms: int, *, negated: bool = False) -> Formula:
    """A formula of a statement (or its negation) over atoms, with negations at atoms only.

    It is true, false, the number of an atom, or a list of an operator and its operands: not, and,
    or, X, U. A number after those of U is the greatest number of steps.
    """
    match data:
        case bool():
            return ("true",) if data is not negated else ("false",)
        case int() if 0 <= data < atoms:
            return ("atom", data, not negated)
        case ["not", inner]:
            return _positive(inner, atoms, negated=not negated)
        case ["X", inner]:
            return ("X", _positive(inner, atoms, negated=negated))
        case ["and" | "or" | "U", left, right] | ["U", left, right, int()]:
            operator = _DUAL[data[0]] if negated else data[0]
            parts = (_positive(part, atoms, negated=negated) for part in (left, right))
            return (operator, *parts, *(data[3:] or [None] * (data[0] == "U")))
        case _:
            raise Rejected(f"no LTL formula: {data!a:.60}")


def _both(some: Iterable[Way], others: Iterable[Way]) -> frozenset[Way]:
    """The ways to satisfy two formulas; those that demand more than another one are left out."""
    some, others = {*some}, {*others}
    if len(some) * len(others) > _MOST_WAYS:
        raise _TooLarge
    ways = {(a | c, b | d) for a, b in some for c, d in others}
    return frozenset(w for w in ways if not any(o[0] <= w[0] and o[1] <= w[1] for o in ways - {w}))


@cache
def _ways(formula: Formula, letter: int) -> frozenset[Way]:
    """The ways to satisfy a formula by a word that begins with a letter (Couvreur 1999).

    U is satisfied now, or put off. It is satisfied if it is not put off for ever.
    """
    nothing: frozenset[Formula] = frozenset()
    match formula:
        case ("true",):
            return frozenset({(nothing, nothing)})
        case ("atom", number, wanted):
            return frozenset({(nothing, nothing)} if (letter >> number & 1) == wanted else ())
        case ("and", left, right):
            return _both(_ways(left, letter), _ways(right, letter))
        case ("or", left, right):
            return _ways(left, letter) | _ways(right, letter)
        case ("X", inner):
            return frozenset({(frozenset({inner}), nothing)})
        case ("U" | "R" as operator, left, right, bound):
            now = _ways(right, letter)
            if bound is not None and bound <= 0:
                return now
            later = formula if bound is None else (operator, left, right, bound - 1)
            put_off = {formula} if bound is None and operator == "U" else nothing
            then = frozenset({(frozenset({later}), frozenset(put_off))})
            if operator == "U":
                return now | _both(_ways(left, letter), then)
            return _both(now, _ways(left, letter) | then)
        case _:
            return frozenset()


class Automaton(NamedTuple):
    """A deterministic automaton; pairs (avoid, visits) of sets of places (state, letter).

    It accepts a word if, for some pair, its run is finitely often in `avoid` and infinitely often
    in each set of `visits`.
    """

    letters: list[int]  # valuations of the atoms; atom i is bit i
    table: list[list[int]]  # from state 0, the successor of each state by each letter
    pairs: list[tuple[frozenset[Any], list[frozenset[Any]]]]

    @staticmethod
    def read(data: Any) -> Automaton:
        """The automaton of a certificate."""
        letters, table = data["letters"], data["table"]
        whole = all(type(x) is int for x in letters) and len({*letters}) == len(letters)
        for row in table:
            inside = all(type(q) is int and 0 <= q < len(table) for q in row)
            whole &= inside and len(row) == len(letters)
        if not whole or not table:
            raise Rejected("an automaton has a successor for each of its states and letters")

        def places(given: Any) -> frozenset[Any]:
            return frozenset((int(q), int(a)) for q, a in given)

        pairs = [(places(p["avoid"]), [*map(places, p["visits"])]) for p in data["pairs"]]
        return Automaton(letters, table, pairs)


class Edge(NamedTuple):
    """A step of the automaton and of a formula: from and to numbers of pairs of both."""

    source: int
    target: int
    place: tuple[int, int]
    put_off: frozenset[Formula]


def same_language(automaton: Automaton, formula: Any, atoms: int) -> bool:
    """Whether automaton and formula accept the same words of letters; False: they are too large.

    No word of the negation may be accepted, and no word of the formula may be rejected.

    Raises:
        Rejected: their languages differ.
    """
    for accepted in (True, False):
        try:
            edges = _steps_of_both(automaton, _positive(formula, atoms, negated=accepted))
        except _TooLarge:
            return False
        if _has_word(edges, automaton.pairs, accepted=accepted):
            words = "accepts words that its formula does" if accepted else "rejects words of"
            raise Rejected(f"the automaton {words} {'not' if accepted else 'its formula'}")
    return True


def _steps_of_both(automaton: Automaton, formula: Formula) -> list[Edge]:
    start = (0, frozenset({formula}))
    number, todo, edges = {start: 0}, [start], list[Edge]()
    while todo:
        source = state, demands = todo.pop()
        for index, letter in enumerate(automaton.letters):
            ways = frozenset({(frozenset[Formula](), frozenset[Formula]())})
            for demand in demands:
                ways = _both(ways, _ways(demand, letter))
            for then, put_off in ways:
                target = automaton.table[state][index], then
                if target not in number:
                    number[target] = len(number)
                    todo.append(target)
                edges.append(Edge(number[source], number[target], (state, index), put_off))
            if len(edges) > _MOST_EDGES:
                raise _TooLarge
    return edges


def _has_word(edges: list[Edge], pairs: Any, *, accepted: bool) -> bool:
    """Whether a cycle of edges puts nothing off for ever, and is accepted (not accepted)."""

    def visited(loop: list[Edge], visits: Any) -> bool:
        return all(any(e.place in visit for e in loop) for visit in visits)

    if accepted:
        return any(
            visited(loop, visits) and not frozenset.intersection(*(e.put_off for e in loop))
            for avoid, visits in pairs
            for loop in _loops([e for e in edges if e.place not in avoid])
        )
    for loop in _loops(edges):
        if frozenset.intersection(*(e.put_off for e in loop)):
            continue
        within = [p for p in pairs if not any(e.place in p[0] for e in loop)]
        accepting = [visits for _, visits in within if visited(loop, visits)]
        # A smaller cycle is rejected by this pair only if it misses one of its sets.
        if not accepting or any(
            _has_word([e for e in loop if e.place not in visit], pairs, accepted=False)
            for visit in accepting[0]
        ):
            return True
    return False


def _loops(edges: list[Edge]) -> list[list[Edge]]:
    """The edges within each strong component."""
    after: dict[int, list[int]] = {}
    for edge in edges:
        after.setdefault(edge.source, []).append(edge.target)
        after.setdefault(edge.target, [])
    of, loops = components(after), dict[int, list[Edge]]()
    for edge in edges:
        if of[edge.source] == of[edge.target]:
            loops.setdefault(of[edge.source], []).append(edge)
    return list(loops.values())


def components(after: Mapping[int, Sequence[int]]) -> dict[int, int]:
    """A member of the strong component of each node (Kosaraju's algorithm)."""
    order, seen, of = list[int](), set[int](), dict[int, int]()
    for root in after:
        path = [] if root in seen else [(root, iter(after[root]))]
        seen.add(root)
        while path:
            target = next((t for t in path[-1][1] if t not in seen), None)
            if target is None:
                order.append(path.pop()[0])
            else:
                seen.add(target)
                path.append((target, iter(after[target])))
    before: dict[int, list[int]] = {node: [] for node in after}
    for node, targets in after.items():
        for target in targets:
            before[target].append(node)
    for root in reversed(order):
        todo = [root]
        while todo:
            if (node := todo.pop()) not in of:
                of[node] = root
                todo += before[node]
    return of


# ----------------------------------------------------------------------------------------- products

Pair = tuple[int, Any]
After = Callable[[int, int, int, Any], Any]  # the memory after a state, a row, and a target


def product(model: Model, evidence: Any, after: After) -> tuple[Model, list[Pair]]:
    """The pairs (state, memory) that are reached from each state with memory 0.

    They have to be as many as the numbers of the evidence.
    """
    most = len(evidence["lower"]["vector"]["numerators"])
    todo: list[Pair] = [(state, 0) for state in range(model.states)]
    successors: dict[Pair, list[list[Pair]]] = {pair: [] for pair in todo}
    while todo:
        if len(successors) > most:
            raise Rejected(
                f"the vectors have {most} numbers, and there are more states and memories"
            )
        state, memory = pair = todo.pop()
        rows = successors[pair] = []
        for index in model.rows_of(state):
            targets = model.rows[index].targets
            rows.append([(target, after(state, index, target, memory)) for target in targets])
            for successor in rows[-1]:
                if successor not in successors:
                    successors[successor] = []
                    todo.append(successor)
    pairs = sorted(successors)
    number, inner = {pair: i for i, pair in enumerate(pairs)}, Model(model.kind)
    for pair in pairs:
        for number_of_row, reached in zip(model.rows_of(pair[0]), successors[pair], strict=True):
            row = model.rows[number_of_row]
            after_row = tuple(map(number.__getitem__, reached))
            inner.rows.append(Row(row.weights, after_row, row.denominator))
        inner.first.append(len(inner.rows))
    return inner, pairs


def _accepted(model: Model, places: Sequence[Any], pairs: Any) -> frozenset[int]:
    """The states of end components that some pair accepts.

    A strategy that takes all rows of such a component in turn is accepted almost surely. And any
    run almost surely ends in an end component, all of which it visits infinitely often.
    """
    found: set[int] = set()
    for avoid, visits in pairs:
        kept = {s: [*model.rows_of(s)] for s in range(model.states) if places[s] not in avoid}
        while True:
            targets = {
                s: [t for r in rows for t in model.rows[r].targets] for s, rows in kept.items()
            }
            of = components({s: [t for t in ts if t in kept] for s, ts in targets.items()})
            inside = {
                s: [r for r in rows if all(of.get(t) == of[s] for t in model.rows[r].targets)]
                for s, rows in kept.items()
            }
            inside = {s: rows for s, rows in inside.items() if rows}
            if all(inside.get(s) == rows for s, rows in kept.items()):
                break
            kept = inside
        members: dict[int, set[int]] = {}
        for state, root in of.items():
            members.setdefault(root, set()).add(state)
        for component in members.values():
            if all(any(places[s] in visit for s in component) for visit in visits):
                found |= component
    return frozenset(found)


def linear_time(model: Model, about: Any, evidence: Any, notes: list[str]) -> Proofs:
    """Bounds of the probability of an LTL formula, by the product with an automaton.

    The automaton reads the letter of the state that is left: the atoms that hold there. The
    probability is that of reaching an accepted end component (Baier & Katoen 2008, 10.3, 10.6.4).

    Args:
        model: the model.
        about: `formula`, whose atom i is the set `atoms[i]`, and `optimum`.
        evidence: `automaton`, and the bounds of reaching accepted components of the product.
        notes: is told if the languages are too large to be compared.
    """
    if about["optimum"] == "min":
        raise Rejected("the least probability is 1 minus the greatest one of the negation")
    atoms = [states_of(model, atom) for atom in about["atoms"]]
    automaton = Automaton.read(evidence["automaton"])
    index = {letter: i for i, letter in enumerate(automaton.letters)}
    valuation = [sum(1 << i for i, a in enumerate(atoms) if s in a) for s in range(model.states)]
    if missing := [s for s, letter in enumerate(valuation) if letter not in index]:
        raise Rejected(f"state {missing[0]}: the automaton does not know the letter of its atoms")
    if not same_language(automaton, about["formula"], len(atoms)):
        notes.append("the automaton of the certificate is trusted: it is too large to be compared")
    letters = [index[letter] for letter in valuation]

    def after(state: int, _row: int, _target: int, memory: int) -> int:
        return automaton.table[memory][letters[state]]

    inner, pairs = product(model, evidence, after)
    right = _accepted(inner, [(q, letters[s]) for s, q in pairs], automaton.pairs)
    entry = {s: i for i, (s, q) in enumerate(pairs) if q == 0}
    return _until(inner, evidence, about["optimum"], range(inner.states), right, entry)


def _until(
    inner: Model, evidence: Any, optimum: Any, left: Any, right: Any, entry: Mapping[int, int]
) -> Proofs:
    """The bounds of `left U right` in a product, at the first pair of each state."""
    low = until_bound(inner, evidence["lower"], Side(optimum, -1), left, right)
    high = until_bound(inner, evidence["upper"], Side(optimum, 1), left, right)
    return lambda s: low.at(entry[s]), lambda s: high.at(entry[s])


def conditional(model: Model, about: Any, evidence: Any, notes: list[str]) -> Proofs:
    """Bounds of the probability of a formula, given a condition of positive probability (a chain).

    It is P(formula and condition) / P(condition).
    """
    if about["optimum"] is not None:
        raise Rejected("conditional probabilities of an mdp have no rule")
    parts = {"both": ["and", about["formula"], about["condition"]], "given": about["condition"]}
    sides = {
        name: linear_time(model, {**about, "formula": part}, evidence[name], notes)
        for name, part in parts.items()
    }

    def bound(state: int, side: int) -> Fraction:
        of_both, least = sides["both"][side](state), sides["given"][0](state)
        of_given = sides["given"][1 - side](state)
        if least is None or of_both is None or of_given is None or least <= 0:
            raise Rejected(f"state {state}: it is not proved that the condition is possible")
        return min(of_both / of_given, Fraction(1))

    return lambda s: bound(s, 0), lambda s: bound(s, 1)


def within_rewards(model: Model, about: Any, evidence: Any, reward: Reward) -> Proofs:
    """Bounds of the probability of `left U right` with a reward of at most `most` until `right`, or
    at least `least`.

    The memory is the reward so far; -1 where it exceeds `most`, and `least` from there on. The
    reward of the state where `right` holds does not count, that of the step into it does.
    """
    if model.exit_rates is not None and reward.of_state:
        raise Rejected("rewards of states of a ctmc grow in time, and have no bounds here")
    left, right = states_of(model, about["left"]), states_of(model, about["right"])
    bound = number_of(about["most" if "most" in about else "least"])
    values = [bound, *reward.of_state.values(), *reward.of_step.values()]
    if min(values) < 0:
        raise Rejected("a bound on a reward, and its rewards, are at least 0")
    unit = lcm(*(v.denominator for v in values))  # the memory is a whole number
    limit, *_ = whole = [int(v * unit) for v in values]
    least, most = (0, limit) if "most" in about else (limit, None)
    of_state = dict(zip(reward.of_state, whole[1:], strict=False))
    of_step = dict(zip(reward.of_step, whole[1 + len(of_state) :], strict=True))

    def after(state: int, row: int, target: int, memory: int) -> int:
        if memory < 0 or state not in left or (state in right and memory >= least):
            return memory
        earned = memory + of_state.get(state, 0) + of_step.get((row, target), 0)
        return min(earned, least) if most is None else earned if earned <= most else -1

    inner, pairs = product(model, evidence, after)
    through = {i for i, (s, earned) in enumerate(pairs) if s in left and earned >= 0}
    ends = {i for i, (s, earned) in enumerate(pairs) if s in right and earned >= least}
    entry = {s: i for i, (s, earned) in enumerate(pairs) if earned == 0}
    return _until(inner, evidence, about["optimum"], through, ends, entry)
