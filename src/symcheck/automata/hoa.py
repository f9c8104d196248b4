"""Reading and writing automata in the Hanoi Omega-Automata format (HOA v1); hints are ignored.

Source: Babiak et al., 'The Hanoi Omega-Automata Format', CAV 2015.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from itertools import product
from typing import Any, cast

import numpy as np
from lark import Lark, Token, UnexpectedCharacters, UnexpectedInput, UnexpectedToken

from symcheck.automata.automaton import Automaton, RabinPair
from symcheck.automata.reduce import reduced
from symcheck.errors import Diagnostic, InputError, Source, Span
from symcheck.matrices.rows import Bools
from symcheck.syntax.grammars import grammar_text

__all__ = ["read", "write"]

_MAX_EDGES = 1 << 28
"""Edges of an automaton that is read, counted once more for each acceptance set."""
_MAX_PAIRS = 256
"""Rabin pairs that an acceptance condition may be rewritten to."""

_WORDS = {
    "_FORMAT": "'HOA: v1'",
    "INT": "a number",
    "STRING": "a text in quotes",
    "ALIAS": "an alias such as @a",
}
_Node = Any
"""A part of the parsed text: a word, or a tree with the children that the grammar gives it."""

_Term = tuple[frozenset[tuple[int, bool]], frozenset[tuple[int, bool]]]
"""Sets to visit finitely and infinitely often: pairs (number, False for its complement)."""
_Edge = tuple[int, Bools, int, frozenset[int]]
"""The source, the letters, the target and the acceptance sets."""

_NOTHING: frozenset[tuple[int, bool]] = frozenset()


@cache
def _parser() -> Lark:
    starts = ["automaton", "misplaced"]
    return Lark(grammar_text("hoa"), parser="lalr", start=starts, propagate_positions=True)


def read(
    text: str, letters: Sequence[int], atoms: Mapping[str, int], name: str = "<automaton>"
) -> Automaton:
    """Read a deterministic automaton. Missing edges lead to a rejecting state.

    Args:
        text: the HOA file.
        letters: letter i of the result is the valuation `letters[i]`.
        atoms: the bit of each atomic proposition in a valuation.
        name: the file name for messages.

    Raises:
        InputError: a syntax error, a nondeterministic automaton or an unknown atom.
    """
    source = Source(name, text)
    try:
        tree = _parser().parse(text, start="automaton")
    except UnexpectedInput as error:
        raise InputError(_syntax_fault(error, source)) from None
    return _Reader(source, letters, atoms).automaton(tree)


def _syntax_fault(error: UnexpectedInput, source: Source) -> Diagnostic:
    start = min(cast(int, error.pos_in_stream), max(len(source.text) - 1, 0))
    if isinstance(error, UnexpectedCharacters):
        message = "this is not a word of the HOA format"
        return Diagnostic(message, Span(source, start, start + 1), "hoa")
    assert isinstance(error, UnexpectedToken)
    spelled = {t.name: f"'{t.pattern.value}'" for t in _parser().terminals} | _WORDS
    words = sorted(spelled[t] for t in error.accepts if t in _WORDS or t.isupper())
    message = " or ".join(filter(None, (", ".join(words[:-1]), words[-1])))
    end = start + max(len(error.token), 1)
    return Diagnostic(f"{message} is expected here", Span(source, start, end), "hoa")


class _Reader:
    """Reads the tree of an automaton, header by header and state by state."""

    def __init__(self, source: Source, letters: Sequence[int], bits: Mapping[str, int]) -> None:
        self.source = source
        self.letters = letters
        self.bits = bits
        self.atoms: list[Bools] = []
        self.aliases: dict[str, Bools] = {}
        self.sets = 0

    def fault(self, message: str, node: _Node) -> InputError:
        position = node if isinstance(node, Token) else node.meta
        start, end = position.start_pos or 0, position.end_pos or 0
        return InputError(Diagnostic(message, Span(self.source, start, end), "hoa"))

    def automaton(self, tree: _Node) -> Automaton:
        states, start, edges = 0, list[Token](), list[_Edge]()
        terms: tuple[_Term, ...] | None = None
        for part in tree.children:
            match part.data, part.children:
                case "states", [number]:
                    states = int(number)
                case "start", numbers:
                    start += map(self.single, [numbers])
                case "atoms", [count, *names]:
                    self.atoms = [self.atom(n) for n in names]
                    if int(str(count)) != len(names):
                        raise self.fault(f"{count} names of atoms are expected", part)
                case "alias", [name, label]:
                    self.aliases[str(name)] = self.label(label)
                case "acceptance", [number, condition]:
                    self.sets = int(number)
                    terms = self.condition(condition)
                case "state", children:
                    edges += self.edges(children)
                case _:
                    pass  # a header that does not change the language
        if len(start) != 1:
            message = f"a deterministic automaton has one initial state, not {len(start)}"
            raise self.fault(message, tree)
        if terms is None:
            raise self.fault("the acceptance condition is missing", tree)
        first = int(start[0])
        states = max((states, first + 1, *(max(e[0], e[2]) + 1 for e in edges)))
        if (states + 1) * len(self.letters) * (1 + self.sets) > _MAX_EDGES:
            size = f"{states:,} states and {len(self.letters):,} letters"
            raise self.fault(f"an automaton with {size} is too large", tree)
        sink = states  # takes the edges that are missing
        table = np.full((states + 1, len(self.letters)), sink, dtype=np.int32)
        marks = np.zeros((self.sets, *table.shape), dtype=bool)
        for state, label, target, sets in edges:
            if np.any(label & (table[state] != sink) & (table[state] != target)):
                message = f"state {state} has several edges for the same letter"
                raise self.fault(f"the automaton is not deterministic: {message}", tree)
            table[state, label] = target
            for number in sets:
                marks[number, state] |= label
        return reduced(Automaton(table, first, tuple(_pair(term, marks, sink) for term in terms)))

    def edges(self, children: Sequence[_Node]) -> Iterator[_Edge]:
        """The edges of a state."""
        state_label, state, _, state_sets, *edges = children
        # Atom j is true in edge i of those without a label if bit j of i is set.
        numbers = sum((atom.astype(int) << j for j, atom in enumerate(self.atoms)), np.array(0))
        implicit = 0
        for edge in edges:
            label, target, sets = edge.children
            if label is None and state_label is None:
                letters = np.broadcast_to(numbers == implicit, len(self.letters))
                implicit += 1
            else:
                letters = self.label(label or state_label)
            both = self.marks(state_sets) | self.marks(sets)
            yield int(state), letters, int(self.single(target.children)), both

    def marks(self, sets: _Node) -> frozenset[int]:
        return frozenset() if sets is None else frozenset(map(self.number, sets.children))

    def single(self, states: Sequence[_Node]) -> Token:
        """The only state of a conjunction."""
        if len(states) > 1:
            raise self.fault("alternating automata are not read", states[1])
        return cast(Token, states[0])

    def atom(self, name: Token) -> Bools:
        """The letters in which an atom is true."""
        if name[1:-1] not in self.bits:
            raise self.fault(f"the formula has no atom {name}", name)
        bit = self.bits[name[1:-1]]
        return np.array([v >> bit & 1 for v in self.letters], dtype=bool)

    def number(self, token: Token) -> int:
        """The number of an acceptance set."""
        if int(token) >= self.sets:
            message = f"there are {self.sets} acceptance sets, numbered from 0"
            raise self.fault(message, token)
        return int(token)

    def label(self, node: _Node) -> Bools:
        """The letters of a label."""
        if isinstance(node, Token):
            if node.type == "ALIAS":
                if node not in self.aliases:
                    raise self.fault(f"there is no alias {node}", node)
                return self.aliases[node]
            if int(node) >= len(self.atoms):
                message = f"there are {len(self.atoms)} atoms, numbered from 0"
                raise self.fault(message, node)
            return self.atoms[int(node)]
        parts = [self.label(c) for c in node.children]
        match node.data:
            case "either":
                return parts[0] | parts[1]
            case "both":
                return parts[0] & parts[1]
            case "complement":
                return ~parts[0]
            case constant:
                return np.full(len(self.letters), constant == "true")

    def condition(self, node: _Node) -> tuple[_Term, ...]:
        """An acceptance condition in disjunctive normal form."""
        match node.data:
            case "true":
                return ((_NOTHING, _NOTHING),)
            case "false":
                return ()
            case "either" | "both":
                left, right = map(self.condition, node.children)
                if node.data == "either":
                    return self.limited((*left, *right), node)
                pairs = ((a[0] | b[0], a[1] | b[1]) for a, b in product(left, right))
                return self.limited(pairs, node)
            case kind:
                (chosen,) = node.children
                number = chosen if isinstance(chosen, Token) else chosen.children[0]
                sets = frozenset({(self.number(number), number is chosen)})
                return ((sets, _NOTHING) if kind == "finitely" else (_NOTHING, sets),)

    def limited(self, terms: Iterable[_Term], node: _Node) -> tuple[_Term, ...]:
        """The terms that no other one makes superfluous."""
        distinct = dict.fromkeys(terms)
        kept = tuple(
            t
            for t in distinct
            if not any(o != t and o[0] <= t[0] and o[1] <= t[1] for o in distinct)
        )
        if len(kept) > _MAX_PAIRS:
            message = f"this acceptance condition needs more than {_MAX_PAIRS} Rabin pairs"
            raise self.fault(message, node)
        return kept


def _pair(term: _Term, marks: Bools, sink: int) -> RabinPair:
    finitely, infinitely = term
    avoid = np.zeros(marks.shape[1:], dtype=bool)
    for number, positive in finitely:
        avoid |= marks[number] == positive
    avoid[sink] = True
    return RabinPair(
        avoid, tuple(marks[number] == positive for number, positive in sorted(infinitely))
    )


# ---------------------------------------------------------------------------------------------- out


def write(automaton: Automaton, letters: Sequence[int], atoms: Sequence[str]) -> str:
    """The automaton in HOA format, with transition-based generalised Rabin acceptance.

    Args:
        automaton: the automaton.
        letters: the valuation of each letter.
        atoms: the name of the atom of each bit.
    """
    sets: list[Bools] = []
    terms = []
    for pair in automaton.pairs:
        words = [
            f"Fin({len(sets)})",
            *(f"Inf({len(sets) + 1 + i})" for i in range(len(pair.visits))),
        ]
        sets += [pair.avoid, *pair.visits]
        terms.append("(" + " & ".join(words) + ")")
    labels = [
        "&".join(("" if v >> i & 1 else "!") + str(i) for i in range(len(atoms))) or "t"
        for v in letters
    ]
    counts = [len(automaton.pairs), *(len(p.visits) for p in automaton.pairs)]
    lines = [
        "HOA: v1",
        f"States: {automaton.states}",
        f"Start: {automaton.initial}",
        " ".join([f"AP: {len(atoms)}", *(f'"{a}"' for a in atoms)]),
        " ".join(["acc-name: generalized-Rabin", *map(str, counts)]),
        f"Acceptance: {len(sets)} " + (" | ".join(terms) or "f"),
        "properties: deterministic trans-labels explicit-labels trans-acc",
        "--BODY--",
    ]
    for q in range(automaton.states):
        lines.append(f"State: {q}")
        for a, label in enumerate(labels):
            marks = [str(i) for i, s in enumerate(sets) if s[q, a]]
            lines.append(
                f"[{label}] {automaton.table[q, a]}"
                + (" {" + " ".join(marks) + "}" if marks else "")
            )
    return "\n".join([*lines, "--END--", ""])
