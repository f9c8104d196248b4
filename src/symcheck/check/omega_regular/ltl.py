"""LtlFactory of linear time, by way of deterministic automata.

The product of the model with an automaton of the formula has the same probabilities as the model,
and whether a run satisfies the formula can be seen from where it ends up: in a bottom component (a
Markov chain) or an end component (an MDP) that the automaton accepts. Sources: Baier & Katoen
(2008), 10.3 and 10.6.4; de Alfaro (1997); Baier (1998), chapter 9.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from symcheck.automata.automaton import Automaton
from symcheck.automata.formula import Kind, LtlFormula
from symcheck.automata.ltl import LtlFactory
from symcheck.check.context import Context
from symcheck.check.measures.reachability import reach_reward, until
from symcheck.check.omega_regular.linear_time import read
from symcheck.check.path_formulas import TemporalPath, UntilPath
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, Values
from symcheck.engines.product import Product
from symcheck.errors import Diagnostic, InputError, UnsupportedError
from symcheck.semantics.rewards import Reward
from symcheck.syntax.ast import Expression, ModelType

__all__ = ["as_until", "co_safe_reward", "linear_product", "path_probability_ltl"]

_BITS = 8
"""Up to so many atoms, letters of the product are valuations of the atoms; of more, only those that
occur are numbered.
"""
_LETTERS = 1 << 14


def path_probability_ltl(
    context: Context, path: TemporalPath, direction: Direction | None
) -> Values:
    """Probability of a formula of linear time at each state: the only (None) or the greatest
    ('max') one.

    Raises UnsupportedError where the automaton would be too large, and for bounds on time within
    such formulas.
    """
    product, pairs = linear_product(context, path)
    inner = replace(context, engine=product.engine)
    good = _accepted(inner, context, product, pairs)
    return product.project(until(inner, inner.engine.all, good, direction))


def as_until(context: Context, path: TemporalPath) -> UntilPath | None:
    """The path formula as `left U right` over sets of states, if it is found to be no more: F (a U
    b) is F b.
    """
    factory = LtlFactory()
    alphabet, formula = _read(context, factory, path)
    if formula.kind is not Kind.UNTIL or formula.bound is not None:
        return None
    left, right = (_literal_states(context, alphabet, part) for part in formula.parts)
    return None if left is None or right is None else UntilPath(left, right, negative=path.negative)


def _literal_states(context: Context, alphabet: _Alphabet, formula: LtlFormula) -> StateSet | None:
    """The states of a literal; None for any other formula, and where letters are only numbers."""
    match formula.kind:
        case Kind.TRUE:
            return context.engine.all
        case Kind.POSITIVE | Kind.NEGATIVE if alphabet.letters == alphabet.columns:
            states = alphabet.sets[formula.atom]
            return states if formula.kind is Kind.POSITIVE else ~states
        case _:
            return None


def linear_product(
    context: Context, path: TemporalPath, form: Callable[[Automaton], Automaton] | None = None
) -> tuple[Product, list[tuple[StateSet, list[StateSet]]]]:
    """The product with an automaton of the formula, and the pairs (avoid, visits) one of which its
    runs must meet for ever.

    form: what is to be made of the automaton first.
    """
    factory = LtlFactory()
    alphabet, formula = _read(context, factory, path)
    if path.negative:
        formula = factory.negation(formula)
    automaton = alphabet.automaton(context, factory, formula)
    if form is not None:
        automaton = form(automaton)
    product: Product = context.engine.product(alphabet.sets, automaton)
    return product, [
        (
            product.edges(automaton.edges(p.avoid)),
            [product.edges(automaton.edges(v)) for v in p.visits],
        )
        for p in automaton.pairs
    ]


def co_safe_reward(
    context: Context, reward: Reward, path: TemporalPath, direction: Direction | None
) -> Values:
    """Expected reward until a run shows that it satisfies a co-safe formula; infinite where that
    may never be.

    A run shows it with the state whose letter ends a prefix all of whose continuations satisfy the
    formula, as the derivatives tell; X true needs one step. Raises InputError for formulas with
    (after negations are pushed inwards) G, W or R.
    """
    factory = LtlFactory(step=len(path.sets))
    alphabet, formula = _read(context, factory, path)
    formula = factory.negation(formula) if path.negative else formula
    if not formula.co_safe:
        message = "an expected reward until a formula that no finite part of a run may show to be satisfied"
        raise InputError(
            Diagnostic(
                message,
                path.span,
                "co-safe",
                "G, W and R (and !F, !U) are not for rewards; F, U, X are",
            )
        )
    alphabet = replace(
        alphabet, letters=tuple(v | 1 << len(path.sets) for v in alphabet.letters), own=True
    )
    automaton = alphabet.automaton(context, factory, formula)
    product: Product = context.engine.product(alphabet.sets, automaton)
    inner = replace(context, engine=product.engine)
    target = product.edges(automaton.entering(automaton.accepting))
    return product.project(reach_reward(inner, reward, target, direction))


@dataclass(frozen=True)
class _Alphabet:
    """The valuations of the atoms that occur in the model (atom i: bit i), and the sets of states
    that tell letters apart.

    own: the automaton is made here, not by an external translator.
    """

    letters: tuple[int, ...]
    columns: tuple[int, ...]
    sets: tuple[StateSet, ...]
    own: bool = False

    def automaton(self, context: Context, factory: LtlFactory, formula: LtlFormula) -> Automaton:
        """The automaton of a formula, over the letters of the sets."""
        program = None if self.own else context.options.ltl2da
        if program is None:
            from symcheck.automata.translate import translate

            made = translate(factory, formula, self.letters)
        else:
            from symcheck.automata.external import translate_externally

            made = translate_externally(
                program, context.options.ltl2da_syntax, formula, self.letters
            )
        return made.relabel(self.columns, 1 << len(self.sets))


def _read(
    context: Context, factory: LtlFactory, path: TemporalPath
) -> tuple[_Alphabet, LtlFormula]:
    """The formula over numbered atoms, and the letters that occur."""
    everything = context.engine.all
    atoms: dict[Expression, LtlFormula] = {}
    sets: list[StateSet] = []
    for expression, states in path.sets:
        atoms[expression] = _atom(factory, sets, states, everything)
    timed = context.engine.model.type is ModelType.CTMC
    formula = read(factory, path.form, atoms, timed=timed)
    blocks = [(0, everything)]
    for i, states in enumerate(sets):
        split = [
            (v | bit, block)
            for v, s in blocks
            for bit, block in ((1 << i, s & states), (0, s - states))
            if block
        ]
        if len(split) > _LETTERS:
            raise UnsupportedError(
                f"this formula of linear time tells more than {_LETTERS:,} kinds of states apart"
            )
        blocks = split
    letters = tuple(v for v, _ in blocks)
    if len(sets) <= _BITS:
        return _Alphabet(letters, letters, tuple(sets)), formula
    bits = max(1, (len(blocks) - 1).bit_length())
    coded = tuple(
        _union(context.engine.none, [s for i, (_, s) in enumerate(blocks) if i >> j & 1])
        for j in range(bits)
    )
    return _Alphabet(letters, tuple(range(len(blocks))), coded), formula


def _atom(
    factory: LtlFactory, sets: list[StateSet], states: StateSet, everything: StateSet
) -> LtlFormula:
    """The literal of a set of states; no atom is spent on sets that are full, empty, known, or the
    complement of a known one.
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


def _accepted(
    context: Context,
    base: Context,
    product: Product,
    pairs: Sequence[tuple[StateSet, Sequence[StateSet]]],
) -> StateSet:
    """States of the product in components that the automaton accepts, or from where it does almost
    surely.
    """
    graph = context.engine.graph
    if context.engine.model.type is not ModelType.MDP:
        return _union(
            context.engine.none, [_surely(context, avoid, visits) for avoid, visits in pairs]
        )
    if context.options.fairness:
        from symcheck.check.omega_regular.fair_mec import fair_end_components

        return fair_end_components(context, base, product, pairs)
    return graph.accepting_end_components(pairs)


def _surely(context: Context, avoid: StateSet, visits: Sequence[StateSet]) -> StateSet:
    """Where a run of a Markov chain almost surely leaves `avoid` for good and meets each set of
    `visits` infinitely often.

    No bottom component is listed: a set is met infinitely often for certain exactly where every
    state that can be reached can reach it; and it is left for good for certain where no state can
    be reached from which it is met infinitely often.
    """
    graph, everything = context.engine.graph, context.engine.all

    def always(states: StateSet) -> StateSet:
        return ~graph.exists_until(everything, ~graph.exists_until(everything, states))

    result = everything if not avoid else ~graph.exists_until(everything, always(avoid))
    for states in visits:
        result = result & always(states)
    return result
