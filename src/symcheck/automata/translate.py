"""Translation of LTL formulas to deterministic automata with generalised Rabin acceptance on edges.

The main automaton tracks the remaining formula (derivatives by letters). A run that stays forever
in one of its strong components is accepted depending on the component: never if only co-safety
formulas remain, always if only safety formulas remain, and otherwise by the conditions of the
master theorem. Each condition has a small deterministic automaton, which runs beside the main
automaton while that is in the component.

Source: Esparza, Křetínský & Sickert, "A unified translation of linear temporal logic to
ω-automata", J. ACM 67 (2020).
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar, assert_never

import numpy as np

from symcheck.automata.acceptance import simplify_acceptance
from symcheck.automata.automaton import Automaton, RabinPair
from symcheck.automata.boolean import FALSE, TRUE
from symcheck.automata.compose import intersection, union
from symcheck.automata.derivatives import Derivatives
from symcheck.automata.formula import Kind, LtlFormula
from symcheck.automata.ltl import LtlFactory
from symcheck.automata.master_theorem import (
    Condition,
    FGCondition,
    GFCondition,
    SafetyCondition,
    conditions,
    guesses,
)
from symcheck.automata.reduce import reduced, strong_components
from symcheck.errors import UnsupportedError

__all__ = ["translate"]

_MAX_EDGES = 4_000_000
"""Edges (states times letters) up to which an automaton is constructed."""


@dataclass(frozen=True)
class Component:
    """Acceptance within a strong component of the main automaton.

    A run is accepted if all conditions of some alternative (a set of indices of `conditions`) hold.
    """

    conditions: tuple[Condition, ...] = ()
    alternatives: tuple[frozenset[int], ...] = ()


@dataclass(frozen=True)
class State:
    """A product state: the main automaton's state, and one remaining formula per condition."""

    main: int
    remaining: tuple[int, ...] = ()


S = TypeVar("S", bound=Hashable)


@dataclass
class _Explored(Generic[S]):
    """States in order of discovery; per state and letter the successor and its condition marks."""

    states: list[S] = field(default_factory=list)
    delta: list[list[int]] = field(default_factory=list)
    marks: list[list[frozenset[int]]] = field(default_factory=list)


def translate(factory: LtlFactory, formula: LtlFormula, letters: Sequence[int]) -> Automaton:
    """The automaton of the words that satisfy a formula.

    Automata of conjunctions and disjunctions are products of the automata of their parts. All
    co-safety parts count as one part, as do all safety parts: their remainder is one formula.

    Args:
        factory: made the formula.
        formula: the formula.
        letters: letter i of the automaton is the valuation `letters[i]`: atom j is true if bit j is
            set.

    Raises:
        UnsupportedError: the automaton would have too many states or pairs.
    """
    combine, parts = _parts(factory, formula)
    if len(parts) < 2:
        return simplify_acceptance(_whole(factory, formula, letters))
    return simplify_acceptance(combine([translate(factory, part, letters) for part in parts]))


def _parts(
    factory: LtlFactory, formula: LtlFormula
) -> tuple[Callable[[Sequence[Automaton]], Automaton], list[LtlFormula]]:
    """How the automata of the parts are combined, and the parts; one part if it is not split."""
    conjunction = formula.kind is Kind.AND or formula.always is not None
    inner = formula.always or formula.eventually
    below = formula.parts
    if inner is not None:
        kind, make = (Kind.AND, factory.always) if conjunction else (Kind.OR, factory.eventually)
        below = tuple(make(p) for p in inner.parts) if inner.kind is kind else ()
    if (
        (inner is None and formula.kind not in (Kind.AND, Kind.OR))
        or formula.co_safe
        or formula.safe
        or len(below) < 2
    ):
        return intersection, [formula]
    unite = factory.conjunction if conjunction else factory.disjunction
    co_safe = [p for p in below if p.co_safe]
    safe = [p for p in below if p.safe and not p.co_safe]
    others = [p for p in below if not p.safe and not p.co_safe]
    return intersection if conjunction else union, [
        unite(group) for group in (co_safe, safe) if group
    ] + others


def _whole(factory: LtlFactory, formula: LtlFormula, letters: Sequence[int]) -> Automaton:
    """The automaton of the formula as a whole, by the master theorem."""
    derivatives = Derivatives(factory)
    start = derivatives.simplify(derivatives.encode(formula))
    main = _explore(
        start,
        len(letters),
        lambda state: [(derivatives.derivative(state, a), frozenset()) for a in letters],
    )
    delta = np.array(main.delta, dtype=np.int32)
    states = main.states
    number = {state: i for i, state in enumerate(states)}
    of, looping = strong_components(delta)
    parts = [
        _component(derivatives, [states[q] for q in np.flatnonzero(of == c)])
        if looping[c]
        else Component()
        for c in range(len(looping))
    ]
    component_of = {state: int(of[number[state]]) for state in states}
    steps = _ProductSteps(derivatives, component_of, parts)
    whole = _explore(
        steps.entered(start), len(letters), lambda state: [steps.step(state, a) for a in letters]
    )
    return reduced(_assemble(whole, [parts[component_of[s.main]] for s in whole.states]))


def _explore(
    start: S, letters: int, successors: Callable[[S], list[tuple[S, frozenset[int]]]]
) -> _Explored[S]:
    result = _Explored([start])
    number = {start: 0}
    for state in result.states:  # the list grows on the way
        delta, marks = [], []
        for target, mark in successors(state):
            if target not in number:
                number[target] = len(number)
                result.states.append(target)
            delta.append(number[target])
            marks.append(mark)
        result.delta.append(delta)
        result.marks.append(marks)
        if len(number) * letters > _MAX_EDGES:
            raise UnsupportedError(
                f"the automaton of this LTL formula has more than {len(number):,} states",
                hint="simplify the formula or use an external translator (-ltl2datool)",
            )
    return result


def _component(derivatives: Derivatives, states: list[int]) -> Component:
    """Acceptance of runs that stay among some states of the main automaton."""
    formulas = [f for s in states for f in derivatives.formulas_of(s)]
    if states == [TRUE] or (all(f.safe for f in formulas) and FALSE not in states):
        return Component((), (frozenset(),))
    if states == [FALSE] or all(f.co_safe for f in formulas):
        return Component()
    sets = {
        c
        for g in guesses(derivatives, states)
        if (c := conditions(derivatives, states, g)) is not None
    }
    minimal = [c for c in sets if not any(other < c for other in sets)]
    distinct = sorted({condition for c in minimal for condition in c}, key=repr)
    index = {condition: i for i, condition in enumerate(distinct)}
    alternatives = sorted((frozenset(index[r] for r in c) for c in minimal), key=sorted)
    return Component(tuple(distinct), tuple(alternatives))


@dataclass(frozen=True)
class _ProductSteps:
    """Successors in the product of the main automaton and the automata of the conditions."""

    derivatives: Derivatives
    component_of: dict[int, int]
    parts: list[Component]

    def entered(self, main: int) -> State:
        """The product state on entering a component of the main automaton."""
        return State(
            main,
            tuple(
                _initial_formula(r, main) for r in self.parts[self.component_of[main]].conditions
            ),
        )

    def step(self, state: State, letter: int) -> tuple[State, frozenset[int]]:
        """The successor, and the conditions that the letter satisfied (GF) or violated (others)."""
        main = self.derivatives.derivative(state.main, letter)
        if self.component_of[main] != self.component_of[state.main]:
            return self.entered(main), frozenset()
        remaining, marks = [], []
        for i, (condition, left) in enumerate(
            zip(self.parts[self.component_of[main]].conditions, state.remaining, strict=True)
        ):
            left = self.derivatives.derivative(left, letter)
            if left == (TRUE if isinstance(condition, GFCondition) else FALSE):
                marks.append(i)
                left = _initial_formula(condition, main)
            remaining.append(left)
        return State(main, tuple(remaining)), frozenset(marks)


def _initial_formula(condition: Condition, main: int) -> int:
    match condition:
        case GFCondition(formula) | FGCondition(formula):
            return formula
        case SafetyCondition(formulas):
            return dict(formulas)[main]
        case _:
            assert_never(condition)


def _assemble(whole: _Explored[State], parts: list[Component]) -> Automaton:
    """The automaton with one Rabin pair per alternative.

    The i-th alternatives of all components share a pair, since a run stays in one component only.
    """
    delta = np.array(whole.delta, dtype=np.int32)
    pairs = []
    for i in range(max((len(p.alternatives) for p in parts), default=0)):
        chosen = [p.alternatives[i] if i < len(p.alternatives) else None for p in parts]
        gf = [
            [r for r in sorted(a or ()) if isinstance(p.conditions[r], GFCondition)]
            for p, a in zip(parts, chosen, strict=True)
        ]
        avoid = np.zeros(delta.shape, dtype=bool)
        visits = np.ones((max(map(len, gf)), *delta.shape), dtype=bool)
        for q, (marks, alternative) in enumerate(zip(whole.marks, chosen, strict=True)):
            if alternative is None:
                avoid[q] = True
                continue
            avoid[q] = [bool((alternative - set(gf[q])) & m) for m in marks]
            for v, condition in enumerate(gf[q]):
                visits[v, q] = [condition in m for m in marks]
        pairs.append(RabinPair(avoid, tuple(visits)))
    accepting = frozenset(q for q, s in enumerate(whole.states) if s.main == TRUE)
    return Automaton(delta, 0, tuple(pairs), accepting)
