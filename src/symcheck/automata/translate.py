"""From a formula of linear time to a deterministic automaton with generalised Rabin acceptance on edges.

A main automaton tracks what remains to be satisfied (derivatives by letters). A run that stays in one of its components for
ever is accepted there according to the component: never where only co-safety remains, always where only safety remains;
else by the guesses of the master theorem (see guesses.py), with one small deterministic automaton per condition that runs
beside the main one while it is in the component. Source: Esparza, Kretinsky & Sickert, J. ACM 67 (2020).
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar, assert_never

import numpy as np

from symcheck.automata.acceptance import simplified
from symcheck.automata.automaton import Automaton, Pair
from symcheck.automata.boolean import FALSE, TRUE
from symcheck.automata.compose import all_of, any_of, size
from symcheck.automata.derivatives import After
from symcheck.automata.formula import Formula, Kind
from symcheck.automata.ltl import Formulas
from symcheck.automata.master_theorem import Again, Main, Never, Requirement, guesses, requirements
from symcheck.automata.reduce import reduced, strong_components
from symcheck.errors import UnsupportedError

__all__ = ["translate"]

_LARGEST = 4_000_000
"""Largest number of edges (states times letters) of an automaton that is made here."""

_FEW = 3
"""Parts of a conjunction or disjunction up to which its automaton is made in both ways."""


@dataclass(frozen=True)
class Component:
    """A strong component of the main automaton: requirements, and the alternatives (sets of their numbers) that accept."""

    requirements: tuple[Requirement, ...] = ()
    alternatives: tuple[frozenset[int], ...] = ()


@dataclass(frozen=True)
class State:
    """Of the whole automaton: where the main one is, and what each requirement's automaton has left to see."""

    main: int
    beside: tuple[int, ...] = ()


S = TypeVar("S", bound=Hashable)


@dataclass
class _Explored(Generic[S]):
    """States in order of discovery, with an edge per letter: the state after it, and the requirements that took note."""

    states: list[S] = field(default_factory=list)
    delta: list[list[int]] = field(default_factory=list)
    marks: list[list[frozenset[int]]] = field(default_factory=list)


def translate(formulas: Formulas, formula: Formula, letters: Sequence[int]) -> Automaton:
    """The automaton of the words that satisfy a formula. Letter i of the automaton is the valuation `letters[i]`: atom j
    holds where bit j is set.

    Conjunctions and disjunctions are put together from the automata of their parts (those of co-safety, and those of safety,
    taken together, because what is left of them is one formula); where these are few, the smaller of this and of the
    automaton of the whole is taken. Raises UnsupportedError where it would be too large.
    """
    put_together, parts = _parts(formulas, formula)
    if len(parts) < 2:
        return simplified(_whole(formulas, formula, letters))
    made = simplified(put_together([translate(formulas, part, letters) for part in parts]))
    if len(parts) > _FEW:
        return made
    try:
        return min(made, simplified(_whole(formulas, formula, letters)), key=size)
    except UnsupportedError:
        return made


def _parts(
    formulas: Formulas, formula: Formula
) -> tuple[Callable[[Sequence[Automaton]], Automaton], list[Formula]]:
    """The parts that get automata of their own, and how these are put together."""
    conjunction = formula.kind is Kind.AND or formula.always is not None
    inner = formula.always or formula.eventually
    below = formula.parts
    if inner is not None:
        kind, make = (Kind.AND, formulas.always) if conjunction else (Kind.OR, formulas.eventually)
        below = tuple(make(p) for p in inner.parts) if inner.kind is kind else ()
    if (
        (inner is None and formula.kind not in (Kind.AND, Kind.OR))
        or formula.co_safe
        or formula.safe
        or len(below) < 2
    ):
        return all_of, [formula]
    unite = formulas.conjunction if conjunction else formulas.disjunction
    co_safe = [p for p in below if p.co_safe]
    safe = [p for p in below if p.safe and not p.co_safe]
    others = [p for p in below if not p.safe and not p.co_safe]
    return all_of if conjunction else any_of, [
        unite(group) for group in (co_safe, safe) if group
    ] + others


def _whole(formulas: Formulas, formula: Formula, letters: Sequence[int]) -> Automaton:
    """The automaton by the master theorem."""
    after = After(formulas)
    start = after.simplified(after.of(formula))
    main = _explore(
        start, len(letters), lambda state: [(after.after(state, a), frozenset()) for a in letters]
    )
    delta = np.array(main.delta, dtype=np.int32)
    states = main.states
    number = {state: i for i, state in enumerate(states)}
    of, looping = strong_components(delta)
    parts = [
        _component(after, [states[q] for q in np.flatnonzero(of == c)])
        if looping[c]
        else Component()
        for c in range(len(looping))
    ]
    where = {state: int(of[number[state]]) for state in states}
    runner = _Runner(after, where, parts)
    whole = _explore(
        runner.entered(start), len(letters), lambda state: [runner.step(state, a) for a in letters]
    )
    return reduced(_assembled(whole, [parts[where[s.main]] for s in whole.states]))


def _explore(
    start: S, letters: int, successors: Callable[[S], list[tuple[S, frozenset[int]]]]
) -> _Explored[S]:
    found = _Explored([start])
    number = {start: 0}
    for state in found.states:  # the list grows on the way
        delta, marks = [], []
        for target, mark in successors(state):
            if target not in number:
                number[target] = len(number)
                found.states.append(target)
            delta.append(number[target])
            marks.append(mark)
        found.delta.append(delta)
        found.marks.append(marks)
        if len(number) * letters > _LARGEST:
            raise UnsupportedError(
                f"the automaton of this formula of linear time has more than {len(number):,} states; "
                "a simpler formula, or an external translator (-ltl2datool), may do"
            )
    return found


def _component(after: After, states: list[int]) -> Component:
    """How a run that stays among some states of the main automaton is accepted."""
    formulas = [f for s in states for f in after.formulas_in(s)]
    if states == [TRUE] or (all(f.safe for f in formulas) and FALSE not in states):
        return Component((), (frozenset(),))
    if states == [FALSE] or all(f.co_safe for f in formulas):
        return Component()
    wanted = {
        w for g in guesses(after, states) if (w := requirements(after, states, g)) is not None
    }
    least = [w for w in wanted if not any(v < w for v in wanted)]
    found = sorted({r for w in least for r in w}, key=repr)
    number = {r: i for i, r in enumerate(found)}
    alternatives = sorted((frozenset(number[r] for r in w) for w in least), key=sorted)
    return Component(tuple(found), tuple(alternatives))


@dataclass(frozen=True)
class _Runner:
    """Steps of the whole automaton."""

    after: After
    where: dict[int, int]
    parts: list[Component]

    def entered(self, main: int) -> State:
        """The state on entering a component of the main automaton."""
        return State(
            main, tuple(_initial(r, main) for r in self.parts[self.where[main]].requirements)
        )

    def step(self, state: State, letter: int) -> tuple[State, frozenset[int]]:
        """The next state, and the requirements that were satisfied (Again) or violated (others) by the letter."""
        main = self.after.after(state.main, letter)
        if self.where[main] != self.where[state.main]:
            return self.entered(main), frozenset()
        beside, marks = [], []
        for i, (requirement, left) in enumerate(
            zip(self.parts[self.where[main]].requirements, state.beside, strict=True)
        ):
            left = self.after.after(left, letter)
            if left == (TRUE if isinstance(requirement, Again) else FALSE):
                marks.append(i)
                left = _initial(requirement, main)
            beside.append(left)
        return State(main, tuple(beside)), frozenset(marks)


def _initial(requirement: Requirement, main: int) -> int:
    match requirement:
        case Again(formula) | Never(formula):
            return formula
        case Main(formulas):
            return dict(formulas)[main]
        case _:
            assert_never(requirement)


def _assembled(whole: _Explored[State], parts: list[Component]) -> Automaton:
    """One automaton: the i-th alternatives of all components together make the i-th pair, as no run stays in two components."""
    delta = np.array(whole.delta, dtype=np.int32)
    pairs = []
    for i in range(max((len(p.alternatives) for p in parts), default=0)):
        chosen = [p.alternatives[i] if i < len(p.alternatives) else None for p in parts]
        again = [
            [r for r in sorted(a or ()) if isinstance(p.requirements[r], Again)]
            for p, a in zip(parts, chosen, strict=True)
        ]
        avoid = np.zeros(delta.shape, dtype=bool)
        visits = np.ones((max(map(len, again)), *delta.shape), dtype=bool)
        for q, (marks, alternative) in enumerate(zip(whole.marks, chosen, strict=True)):
            if alternative is None:
                avoid[q] = True
                continue
            avoid[q] = [bool((alternative - set(again[q])) & m) for m in marks]
            for v, requirement in enumerate(again[q]):
                visits[v, q] = [requirement in m for m in marks]
        pairs.append(Pair(avoid, tuple(visits)))
    accepting = frozenset(q for q, s in enumerate(whole.states) if s.main == TRUE)
    return Automaton(delta, 0, tuple(pairs), accepting)
