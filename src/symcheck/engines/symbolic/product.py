"""The product with an automaton on diagrams: additional top bits hold its state."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from symcheck.dd.odd import Odd
from symcheck.engines.symbolic.diagrams import Diagrams, TransitionPart
from symcheck.engines.symbolic.sets import Piece, SymbolicOwner, SymbolicSet, SymbolicValues, merged
from symcheck.engines.symbolic.steps import TransitionGraph

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, DiagramManager
    from symcheck.engines.base import Automaton

__all__ = ["Base", "SymbolicProduct", "product"]


class Base(SymbolicOwner, Protocol):
    """The engine that a product is built from."""

    def over(self, diagrams: Diagrams) -> Base:
        """The same kind of engine over other diagrams."""
        ...


@dataclass(frozen=True, eq=False)
class Counter:
    """Bits for an automaton's states, number i in binary, most significant first; `rows` and
    `columns` may be empty.
    """

    manager: DiagramManager
    rows: tuple[str, ...]
    columns: tuple[str, ...]

    def at(self, number: int, *, after: bool = False) -> Bdd:
        """The automaton is in a state (after the step)."""
        names = self.columns if after else self.rows
        literals = [self.manager.variable(name) for name in names]
        bits = [(number >> (len(names) - 1 - i)) & 1 for i in range(len(names))]
        return self.manager.conjunction(
            [x if bit else ~x for x, bit in zip(literals, bits, strict=True)]
        )

    def any(self, numbers: Iterable[int]) -> Bdd:
        """The automaton is in one of these states."""
        return self.manager.disjunction([self.at(n) for n in numbers])


@dataclass(frozen=True, eq=False)
class SymbolicProduct:
    """See `symcheck.engines.base.Product`. `letters`: the base states with each letter that
    occurs.
    """

    engine: Base
    base: Base = field(repr=False)
    counter: Counter = field(repr=False)
    letters: dict[int, Bdd] = field(repr=False)
    entry: Bdd = field(repr=False)

    def _set(self, bdd: Bdd) -> SymbolicSet:
        return SymbolicSet(self.engine.diagrams, bdd & self.engine.diagrams.states)

    def lift(self, states: SymbolicSet) -> SymbolicSet:
        """The pairs whose first part is in the set."""
        return self._set(states.bdd)

    def automaton_states(self, states: frozenset[int]) -> SymbolicSet:
        """The pairs whose second part is one of these."""
        return self._set(self.counter.any(states))

    def edges(self, edges: frozenset[tuple[int, int]]) -> SymbolicSet:
        """The pairs (s, q) for which (q, letter of s) is one of these."""
        by_letter: dict[int, list[int]] = {}
        for state, letter in edges:
            by_letter.setdefault(letter, []).append(state)
        parts = [
            here & self.counter.any(by_letter[letter])
            for letter, here in self.letters.items()
            if letter in by_letter
        ]
        return self._set(self.base.diagrams.union(parts))

    def project(self, values: SymbolicValues) -> SymbolicValues:
        """For each base state, the value at its pair with the automaton's initial state."""
        base = self.base.diagrams
        pieces = []
        for piece in values.pieces:
            pairs = piece.states & self.entry
            if not pairs:
                continue
            states = pairs.cofactor(self.entry)
            if piece.odd is None:
                pieces.append(Piece(states, piece.values, None))
            else:  # the top bits are equal in all pairs, so the base states keep their order
                indices = Odd(base.manager, pairs, self.engine.diagrams.rows).indices_in(piece.odd)
                pieces.append(
                    Piece(
                        states, piece.values.gather(indices), Odd(base.manager, states, base.rows)
                    )
                )
        return SymbolicValues(base, merged(base, pieces))

    def project_set(self, states: SymbolicSet) -> SymbolicSet:
        """The base states whose pair with the automaton's initial state is in the set."""
        return SymbolicSet(self.base.diagrams, (states.bdd & self.entry).cofactor(self.entry))


def product(base: Base, letters: Sequence[SymbolicSet], automaton: Automaton) -> SymbolicProduct:
    """The pairs reachable from (s, initial state) for every state s of the base model."""
    d = base.diagrams
    table = np.asarray(automaton.table)
    counter = _counter(d.manager, len(table))
    classes = _classes(d.states, [s.bdd for s in letters])
    moves = _moves(counter, table, classes)
    steps = tuple(
        _with_automaton(d.manager, counter, step.relation & moves, step) for step in d.steps
    )
    if d.loops:
        steps = (*steps, _with_automaton(d.manager, counter, d.loops & moves, None))
    entry = counter.at(automaton.initial)
    rows, columns = (*counter.rows, *d.rows), (*counter.columns, *d.columns)
    draft = replace(
        d, rows=rows, columns=columns, steps=steps, loops=d.manager.false, states=d.states & entry
    )
    states = TransitionGraph(draft).reachable(draft.states)
    diagrams = replace(
        draft,
        states=states,
        initial=d.initial & entry,
        deadlocks=d.deadlocks & states,
        roots=tuple(root.times_bdd(moves & states) for root in d.roots),
        guards=None if d.guards is None else tuple(guard & states for guard in d.guards),
        actions={key: where & states for key, where in d.actions.items()},
    )
    return SymbolicProduct(base.over(diagrams), base, counter, classes, entry)


def _counter(manager: DiagramManager, size: int) -> Counter:
    """New bits for numbers below `size`, above all other bits."""
    before = manager.order()
    width = (size - 1).bit_length()
    serial = 1 + max(
        (int(name[1:].split(".")[0]) for name in before if name.startswith("@")), default=0
    )
    rows = tuple(
        f"@{serial}.{e}" for e in range(width - 1, -1, -1)
    )  # no variable of a model begins like this
    columns = tuple(f"{row}'" for row in rows)
    if width:
        new = [bit for pair in zip(rows, columns, strict=True) for bit in pair]
        manager.add_variables(new)
        manager.reorder([*new, *before])
    return Counter(manager, rows, columns)


def _classes(states: Bdd, sets: Sequence[Bdd]) -> dict[int, Bdd]:
    """The states by letter: bit i of a letter says whether set i holds. Only letters that occur."""
    classes = {0: states}
    for i, members in enumerate(sets):
        without = {letter: here - members for letter, here in classes.items()}
        within = {letter | 1 << i: here & members for letter, here in classes.items()}
        classes = {letter: here for letter, here in (without | within).items() if here}
    return classes


def _moves(
    counter: Counter,
    table: np.ndarray[tuple[int, int], np.dtype[np.int32]],
    classes: dict[int, Bdd],
) -> Bdd:
    """The steps of the automaton by the letter of the source state."""
    manager = counter.manager
    alike: dict[bytes, list[int]] = {}
    for letter in classes:
        alike.setdefault(table[:, letter].tobytes(), []).append(letter)
    parts = []
    for same in alike.values():
        steps = [
            counter.at(q) & counter.at(int(following), after=True)
            for q, following in enumerate(table[:, same[0]])
        ]
        parts.append(
            manager.disjunction([classes[letter] for letter in same]) & manager.disjunction(steps)
        )
    return manager.disjunction(parts)


def _with_automaton(
    manager: DiagramManager, counter: Counter, relation: Bdd, step: TransitionPart | None
) -> TransitionPart:
    """A step of the model and the automaton; without a base step, of the automaton alone."""
    pairs = (
        [(manager.name_of(a), manager.name_of(b)) for a, b in step.transition.pairs]
        if step is not None
        else []
    )
    rows, columns = (
        [*counter.rows, *(a for a, _ in pairs)],
        [*counter.columns, *(b for _, b in pairs)],
    )
    return TransitionPart(
        relation,
        manager.transition(rows, columns),
        step.top if step is not None else len(manager.order()),
    )
