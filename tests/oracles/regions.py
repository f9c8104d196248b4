"""Probabilistic timed automata over regions, in plain Python: an oracle for digital clocks and zones.

An automaton is a list of modules in parallel. The state of the graph is a valuation of the clocks
with fractions, of which one stands for each region. A further clock is set to 0 whenever it reaches
1: time goes on for ever where that happens again and again.
Source: Alur & Dill, A theory of timed automata (1994); Kwiatkowska, Norman, Segala & Sproston,
Automatic verification of real-time systems with discrete probability distributions (2002).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product
from typing import Any

Atom = tuple[str, str | None, str, int]
"""(x, y, operator, c): x - y compared with c; y None: x alone."""

_COMPARE: dict[str, Callable[[Any, Any], bool]] = {
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
    "=": lambda a, b: a == b,
}


@dataclass
class Edge:
    """`[action] location=source & guard -> p: (location'=target) & resets + …`."""

    source: int
    action: str | None
    guard: list[Atom]
    branches: list[tuple[Fraction, int, dict[str, int]]]


@dataclass
class Component:
    """A module: its clocks, its locations with their invariants, its edges."""

    clocks: list[str]
    invariants: list[list[Atom]]
    edges: list[Edge]


@dataclass
class Question:
    """`P direction [ left U right ]` within a window of times, or its negation.

    left, right: pairs of conditions on locations (one set per module) and atoms.
    """

    direction: str
    left: tuple[list[set[int]], list[Atom]]
    right: tuple[list[set[int]], list[Atom]]
    window: tuple[int, int | None, bool, bool] = (0, None, False, False)
    negative: bool = False


class TimeStops(Exception):
    """A timelock is reached, or states from which time cannot go on for ever."""


Valuation = dict[str, Fraction]
State = tuple[tuple[int, ...], Any]


@dataclass
class Graph:
    """The reachable region graph: per state its choices, each (tick, [(p, state)])."""

    choices: list[list[tuple[bool, list[tuple[Fraction, int]]]]] = field(default_factory=list)
    states: list[tuple[tuple[int, ...], Valuation]] = field(default_factory=list)


def satisfies(atoms: list[Atom], v: Valuation) -> bool:
    """Whether all atoms hold."""
    return all(_COMPARE[op](v[x] - (v[y] if y else 0), c) for x, y, op, c in atoms)


class Regions:
    """The region graph of an automaton with the clock `now` of a bound, and the clock `unit`."""

    def __init__(self, components: list[Component], largest: int, *, diagonal: bool) -> None:
        self.components, self.largest, self.diagonal = components, largest, diagonal
        self.clocks = [c for m in components for c in m.clocks] + ["now"]

    def key(self, v: Valuation) -> Any:
        """The region of a valuation."""
        m = self.largest
        if self.diagonal:
            values = [Fraction(0), *(v[c] for c in self.clocks), v["unit"]]
            result = []
            for i, a in enumerate(values):
                for b in values[:i]:
                    d = a - b
                    if d > m:
                        result.append(("more",))
                    elif d < -m:
                        result.append(("less",))
                    else:
                        result.append((d.numerator // d.denominator, d.denominator > 1))
            return tuple(result)
        whole = tuple(
            min(v[c].numerator // v[c].denominator, m + 1) if v[c] <= m else m + 1
            for c in self.clocks
        )
        parts = [(v[c] % 1, c) for c in (*self.clocks, "unit") if c == "unit" or v[c] <= m]
        distinct = sorted({f for f, _ in parts} | {Fraction(0)})
        return whole, tuple((c, distinct.index(f)) for f, c in parts)

    def later(self, v: Valuation) -> tuple[Valuation, bool]:
        """A valuation of the next region in time, and whether `unit` reaches 1."""
        counted = [c for c in self.clocks if self.diagonal or v[c] <= self.largest]
        gaps = [1 - v[c] % 1 for c in (*counted, "unit")]
        if any(g == 1 for g in gaps):
            inner = [g for g in gaps if g < 1]
            step = min(inner) / 2 if inner else Fraction(1, 2)
        else:
            step = min(gaps)
        after = {c: x + step for c, x in v.items()}
        if after["unit"] == 1:
            after["unit"] = Fraction(0)
            return after, True
        return after, False

    def build(self) -> Graph:
        """The graph from the initial state. Raises TimeStops at a timelock."""
        graph = Graph()
        number: dict[Any, int] = {}

        def state(places: tuple[int, ...], v: Valuation) -> int:
            name = places, self.key(v)
            if name not in number:
                number[name] = len(graph.states)
                graph.states.append((places, v))
            return number[name]

        zero = Fraction(0)
        state(tuple(0 for _ in self.components), dict.fromkeys([*self.clocks, "unit"], zero))
        done = 0
        while done < len(graph.states):
            places, v = graph.states[done]
            done += 1
            found: list[tuple[bool, list[tuple[Fraction, int]]]] = []
            after, tick = self.later(v)
            while not tick and self.key(after) == self.key(v):
                after, tick = self.later(after)
            if self.invariant(places, v) and self.invariant(places, after):
                found.append((tick, [(Fraction(1), state(places, after))]))
            for edges in self.enabled(places, v):
                branches = []
                for combination in product(*(e.branches for _, e in edges)):
                    p, at, w = Fraction(1), list(places), dict(v)
                    for (i, _), (q, target, resets) in zip(edges, combination, strict=True):
                        p, at[i] = p * q, target
                        w.update({c: Fraction(x) for c, x in resets.items()})
                    branches.append((p, state(tuple(at), w)))
                found.append((False, branches))
            if not found:
                raise TimeStops("timelock")
            graph.choices.append(found)
        return graph

    def invariant(self, places: tuple[int, ...], v: Valuation) -> bool:
        """Whether the invariants of all modules hold."""
        return all(
            satisfies(m.invariants[p], v) for m, p in zip(self.components, places, strict=True)
        )

    def enabled(self, places: tuple[int, ...], v: Valuation) -> list[list[tuple[int, Edge]]]:
        """Joint edges: unlabelled ones alone, labelled ones with all modules that have the action."""
        result = []
        actions = {e.action for m in self.components for e in m.edges if e.action}
        for i, m in enumerate(self.components):
            result += [
                [(i, e)]
                for e in m.edges
                if e.action is None and e.source == places[i] and satisfies(e.guard, v)
            ]
        for action in sorted(actions):
            partners = []
            for i, m in enumerate(self.components):
                own = [e for e in m.edges if e.action == action]
                if own:
                    partners.append(
                        [(i, e) for e in own if e.source == places[i] and satisfies(e.guard, v)]
                    )
            result += [list(joint) for joint in product(*partners)]
        return result


def _holds(
    condition: tuple[list[set[int]], list[Atom]], places: tuple[int, ...], v: Valuation
) -> bool:
    sets, atoms = condition
    return all(p in s for p, s in zip(places, sets, strict=True)) and satisfies(atoms, v)


def _in_window(window: tuple[int, int | None, bool, bool], now: Fraction) -> bool:
    low, high, low_strict, high_strict = window
    above = now > low if low_strict else now >= low
    return above and (high is None or (now < high if high_strict else now <= high))


def never_ending(graph: Graph, safe: list[bool]) -> list[bool]:
    """The states from which time goes on for ever, almost surely, within the safe states."""
    current = list(safe)
    while True:
        good = [False] * len(current)
        changed = True
        while changed:
            changed = False
            for s, choices in enumerate(graph.choices):
                if good[s] or not current[s]:
                    continue
                for tick, branches in choices:
                    if all(current[t] for _, t in branches) and (
                        tick or any(good[t] for _, t in branches)
                    ):
                        good[s] = changed = True
                        break
        if good == current:
            return good
        current = good


def greatest(graph: Graph, allowed: list[bool], target: list[bool]) -> float:
    """The greatest probability of `allowed U target` in the first state, by value iteration."""
    values = [float(t) for t in target]
    while True:
        most = 0.0
        for s in reversed(range(len(values))):
            if target[s] or not allowed[s]:
                continue
            best = max(
                sum(float(p) * values[t] for p, t in branches) for _, branches in graph.choices[s]
            )
            most, values[s] = max(most, best - values[s]), best
        if most < 1e-14:
            return values[0]


def solve(components: list[Component], question: Question, *, diagonal: bool) -> float:
    """The value of a question in the initial state. Raises TimeStops."""
    atoms = [a for m in components for i in m.invariants for a in i]
    atoms += [a for m in components for e in m.edges for a in e.guard]
    atoms += question.left[1] + question.right[1]
    constants = [abs(c) for *_, c in atoms]
    constants += [
        x for m in components for e in m.edges for _, _, r in e.branches for x in r.values()
    ]
    low, high, *_ = question.window
    regions = Regions(components, max([*constants, low, high or 0, 1]), diagonal=diagonal)
    graph = regions.build()
    left = [_holds(question.left, p, v) for p, v in graph.states]
    inside = [_in_window(question.window, v["now"]) for _, v in graph.states]
    right = [
        i and _holds(question.right, p, v) for i, (p, v) in zip(inside, graph.states, strict=True)
    ]
    if (question.direction == "max") != question.negative:
        value = greatest(graph, left, right)
        return 1 - value if question.negative else value
    if not all(never_ending(graph, [True] * len(left))):
        raise TimeStops("zeno")
    outside = [not r for r in right]
    ends = never_ending(graph, outside)
    failed = [e or (o and not x) for e, o, x in zip(ends, outside, left, strict=True)]
    value = greatest(graph, outside, failed)
    return value if question.negative else 1 - value
