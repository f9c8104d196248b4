"""Probabilities and rewards of LTL formulas by deterministic automata.

A run of the product of the model and an automaton satisfies the formula if it stays in a bottom
component (Markov chains) or an end component (MDPs) that the automaton accepts.

Sources: Baier & Katoen (2008), 10.3 and 10.6.4; de Alfaro (1997); Baier (1998).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import assert_never

from symcheck.automata.acceptance import degeneralize
from symcheck.automata.automaton import Automaton
from symcheck.automata.formula import Kind, LtlFormula
from symcheck.automata.ltl import LtlFactory
from symcheck.check import tuning
from symcheck.check.context import Context
from symcheck.check.measures.reachability import reach_reward, until
from symcheck.check.omega_regular.linear_time import read
from symcheck.direction import Direction
from symcheck.engines.base import Product, StateSet, Values
from symcheck.errors import Diagnostic, InputError, UnsupportedError
from symcheck.semantics.path_formulas import LtlPathFormula, UntilPath
from symcheck.semantics.rewards import Reward

__all__ = [
    "accepted_states",
    "as_until",
    "co_safe_product",
    "co_safe_reward",
    "is_co_safe",
    "labelled_automaton",
    "linear_product",
    "numbered_automaton",
    "path_probability_ltl",
]


def path_probability_ltl(
    context: Context, path: LtlPathFormula[StateSet], direction: Direction | None
) -> Values:
    """Probability of an LTL formula at each state.

    Args:
        context: the engine, the options and the log.
        path: the formula.
        direction: None for a chain, the maximum for an MDP.

    Returns:
        Values in [0, 1], certified within `options.epsilon`.

    Raises:
        UnsupportedError: the automaton would be too large, or a formula on a CTMC has time bounds.
    """
    product, pairs = linear_product(context, path)
    inner = context.on(product.engine)
    accepting = accepted_states(inner, context, product, pairs)
    return product.project(until(inner, inner.engine.all, accepting, direction))


def as_until(context: Context, path: LtlPathFormula[StateSet]) -> UntilPath[StateSet] | None:
    """The formula as `left U right` over sets of states if it simplifies to one, as F (a U b)."""
    factory = LtlFactory()
    alphabet, formula = _read(context, factory, path)
    if formula.kind is not Kind.UNTIL or formula.bound is not None:
        return None
    left, right = (_literal_states(context, alphabet, part) for part in formula.parts)
    return None if left is None or right is None else UntilPath(left, right, negative=path.negative)


def _literal_states(context: Context, alphabet: _Alphabet, formula: LtlFormula) -> StateSet | None:
    """The states of a literal; None for other formulas, and if letters are numbered."""
    match formula.kind:
        case Kind.TRUE:
            return context.engine.all
        case Kind.POSITIVE | Kind.NEGATIVE if alphabet.letters == alphabet.columns:
            states = alphabet.sets[formula.atom]
            return states if formula.kind is Kind.POSITIVE else ~states
        case Kind.POSITIVE | Kind.NEGATIVE | Kind.FALSE | Kind.AND | Kind.OR:
            return None
        case Kind.NEXT | Kind.UNTIL | Kind.RELEASE:
            return None
        case _:
            assert_never(formula.kind)


def labelled_automaton(
    context: Context, path: LtlPathFormula[StateSet]
) -> tuple[Sequence[StateSet], Automaton]:
    """The automaton of a formula, and the sets of states whose numbers are its letters.

    A state has bit i of its letter if it is in set i.
    """
    factory = LtlFactory()
    alphabet, formula = _read(context, factory, path)
    if path.negative:
        formula = factory.negation(formula)
    return alphabet.sets, alphabet.automaton(context, factory, formula)


def numbered_automaton(
    context: Context, path: LtlPathFormula[StateSet]
) -> tuple[Sequence[int], Sequence[StateSet], Automaton]:
    """The automaton of a formula whose letters are numbered, over the atoms as they stand.

    Returns:
        The valuation of the atoms with each number (bit i is atom i), the sets of states whose
        numbers are the letters (as for `labelled_automaton`), and the automaton.
    """
    factory, timed = LtlFactory(), context.engine.model.type.continuous_time
    alphabet = _numbered(context, _blocks(path.atoms, context.engine.all))
    atoms = [factory.literal(i) for i in range(len(path.atoms))]
    formula = read(factory, path.form, atoms, timed=timed)
    if path.negative:
        formula = factory.negation(formula)
    return alphabet.letters, alphabet.sets, alphabet.automaton(context, factory, formula)


def linear_product(
    context: Context, path: LtlPathFormula[StateSet]
) -> tuple[Product, list[tuple[StateSet, list[StateSet]]]]:
    """The product of the model with an automaton of the formula.

    Args:
        context: the engine and the options; for a strategy, each pair visits at most one set.
        path: the formula.

    Returns:
        The product, and its pairs (avoid, visits): a run is accepted if, for some pair, it is
        finitely often in `avoid` and infinitely often in each set of `visits`.
    """
    return context.once((path,), lambda: _linear_product(context, path))


def _linear_product(
    context: Context, path: LtlPathFormula[StateSet]
) -> tuple[Product, list[tuple[StateSet, list[StateSet]]]]:
    sets, automaton = labelled_automaton(context, path)
    if context.options.strategy and context.engine.model.type.has_choices:
        automaton = degeneralize(automaton)
    product: Product = context.engine.product(sets, automaton)
    return product, [
        (
            product.edges(automaton.edges(p.avoid)),
            [product.edges(automaton.edges(v)) for v in p.visits],
        )
        for p in automaton.pairs
    ]


def co_safe_reward(
    context: Context, reward: Reward, path: LtlPathFormula[StateSet], direction: Direction | None
) -> Values:
    """Expected reward until a run satisfies a co-safe formula.

    The reward is earned until the state whose letter completes a good prefix: a prefix all of whose
    continuations satisfy the formula. X true needs one step. The reward is infinite where the
    formula is not satisfied almost surely.

    Raises:
        InputError: the formula has G, W or R in negation normal form.
        UnsupportedError: the automaton would be too large.
    """
    product, target = co_safe_product(context, path)
    inner = context.on(product.engine)
    return product.project(reach_reward(inner, reward, target, direction))


def co_safe_product(context: Context, path: LtlPathFormula[StateSet]) -> tuple[Product, StateSet]:
    """The product with the automaton of a co-safe formula, and where a good prefix is complete.

    Raises InputError, UnsupportedError: see `co_safe_reward`.
    """
    return context.once(("co-safe", path), lambda: _co_safe_product(context, path))


def is_co_safe(context: Context, path: LtlPathFormula[StateSet]) -> bool:
    """Whether finite prefixes of runs show that they satisfy a formula."""
    factory = LtlFactory()
    _, formula = _read(context, factory, path)
    return (factory.negation(formula) if path.negative else formula).co_safe


def _co_safe_product(context: Context, path: LtlPathFormula[StateSet]) -> tuple[Product, StateSet]:
    factory = LtlFactory(step=len(path.atoms))
    alphabet, formula = _read(context, factory, path)
    formula = factory.negation(formula) if path.negative else formula
    if not formula.co_safe:
        message = (
            "an expected reward needs a co-safe formula, which finite prefixes of runs satisfy"
        )
        raise InputError(
            Diagnostic(
                message,
                path.span,
                "co-safe",
                "use F, U and X; G, W and R (and !F, !U) are not co-safe",
            )
        )
    alphabet = replace(
        alphabet, letters=tuple(v | 1 << len(path.atoms) for v in alphabet.letters), internal=True
    )
    automaton = alphabet.automaton(context, factory, formula)
    product: Product = context.engine.product(alphabet.sets, automaton)
    return product, product.edges(automaton.entering(automaton.accepting))


@dataclass(frozen=True)
class _Alphabet:
    """The letters of an automaton.

    Attributes:
        letters: the valuations of the atoms that occur in the model; bit i is atom i.
        columns: the number of each letter in the product.
        sets: the sets of states that encode the numbers, one per bit.
        internal: no external translator makes the automaton.
    """

    letters: tuple[int, ...]
    columns: tuple[int, ...]
    sets: tuple[StateSet, ...]
    internal: bool = False

    def automaton(self, context: Context, factory: LtlFactory, formula: LtlFormula) -> Automaton:
        """The automaton of a formula, over the letters of the sets."""
        program = None if self.internal else context.options.ltl2da
        if program is None:
            from symcheck.automata.translate import translate

            automaton = translate(factory, formula, self.letters)
        else:
            from symcheck.automata.external import translate_externally

            automaton = translate_externally(
                program, context.options.ltl2da_syntax, formula, self.letters
            )
        return automaton.relabel(self.columns, 1 << len(self.sets))


def _read(
    context: Context, factory: LtlFactory, path: LtlPathFormula[StateSet]
) -> tuple[_Alphabet, LtlFormula]:
    """The alphabet, and the formula over numbered atoms."""
    everything = context.engine.all
    sets: list[StateSet] = []
    atoms = [_atom(factory, sets, states, everything) for states in path.atoms]
    timed = context.engine.model.type.continuous_time
    formula = read(factory, path.form, atoms, timed=timed)
    blocks = _blocks(sets, everything)
    letters = tuple(v for v, _ in blocks)
    if len(sets) <= tuning.ATOMS_AS_LETTERS:
        return _Alphabet(letters, letters, tuple(sets)), formula
    return _numbered(context, blocks), formula


def _blocks(sets: Sequence[StateSet], everything: StateSet) -> list[tuple[int, StateSet]]:
    """The valuations that occur of the sets, each with its states."""
    blocks = [(0, everything)]
    for i, states in enumerate(sets):
        split = [
            (v | bit, block)
            for v, s in blocks
            for bit, block in ((1 << i, s & states), (0, s - states))
            if block
        ]
        if len(split) > tuning.LETTERS:
            raise UnsupportedError(
                f"this LTL formula distinguishes more than {tuning.LETTERS:,} kinds of states"
            )
        blocks = split
    return blocks


def _numbered(context: Context, blocks: Sequence[tuple[int, StateSet]]) -> _Alphabet:
    """The alphabet in which the valuations that occur are numbered."""
    bits = max(1, (len(blocks) - 1).bit_length())
    coded = tuple(
        _union(context.engine.none, [s for i, (_, s) in enumerate(blocks) if i >> j & 1])
        for j in range(bits)
    )
    return _Alphabet(tuple(v for v, _ in blocks), tuple(range(len(blocks))), coded)


def _atom(
    factory: LtlFactory, sets: list[StateSet], states: StateSet, everything: StateSet
) -> LtlFormula:
    """The literal of a set of states.

    A set that is full, empty, known or the complement of a known one needs no new atom.
    """
    if not states:
        return factory.false
    if states == everything:
        return factory.true
    for i, known in enumerate(sets):
        if states == known or states == ~known:
            return factory.literal(i, states == known)
    sets.append(states)
    return factory.literal(len(sets) - 1)


def _union(none: StateSet, sets: Sequence[StateSet]) -> StateSet:
    result = none
    for states in sets:
        result = result | states
    return result


def accepted_states(
    context: Context,
    base: Context,
    product: Product,
    pairs: Sequence[tuple[StateSet, Sequence[StateSet]]],
) -> StateSet:
    """States in accepting end components, or (chains) of almost surely accepted runs."""
    graph = context.engine.graph
    if not context.engine.model.type.has_choices:
        return _union(
            context.engine.none,
            [_accepted_almost_surely(context, avoid, visits) for avoid, visits in pairs],
        )
    if context.options.fairness:
        from symcheck.check.omega_regular.fair_mec import fair_end_components

        return fair_end_components(context, base, product, pairs)
    return graph.accepting_end_components(pairs)


def _accepted_almost_surely(
    context: Context, avoid: StateSet, visits: Sequence[StateSet]
) -> StateSet:
    """States of a chain from which a run almost surely is accepted by a pair.

    Bottom components are not enumerated. A run visits a set infinitely often almost surely if and
    only if every reachable state can reach the set. A run visits it finitely often almost surely if
    and only if no state is reachable from which the set is visited infinitely often almost surely.
    """
    graph, everything = context.engine.graph, context.engine.all

    def always(states: StateSet) -> StateSet:
        return ~graph.exists_until(everything, ~graph.exists_until(everything, states))

    result = everything if not avoid else ~graph.exists_until(everything, always(avoid))
    for states in visits:
        result = result & always(states)
    return result
