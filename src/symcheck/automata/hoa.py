"""Reading and writing automata in the Hanoi Omega-Automata format (HOA v1); hints are ignored.

Source: Babiak et al., 'The Hanoi Omega-Automata Format', CAV 2015.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from symcheck.automata.automaton import Automaton, RabinPair
from symcheck.automata.reduce import reduced
from symcheck.errors import Diagnostic, InputError, Source, Span
from symcheck.matrices.rows import Bools

__all__ = ["read", "write"]

_TOKEN = re.compile(
    r'\s+|/\*.*?\*/|(?P<text>"(?:[^"\\]|\\.)*")|(?P<mark>--[A-Z]+--)|(?P<header>[A-Za-z_][\w-]*:)'
    r"|(?P<name>@[\w-]+|[A-Za-z_][\w-]*)|(?P<number>\d+)|(?P<sign>[\[\]{}()&|!])",
    re.DOTALL,
)
_MAX_EDGES = 1 << 28
"""Edges of an automaton that is read, counted once more for each acceptance set."""
_MAX_PAIRS = 256
"""Rabin pairs that an acceptance condition may be rewritten to."""


@dataclass(frozen=True, slots=True)
class _Token:
    kind: str
    text: str
    span: Span


@dataclass
class _Reader:
    """The tokens and the position of the next one."""

    source: Source
    tokens: list[_Token] = field(default_factory=list)
    at: int = 0

    def fault(self, message: str) -> InputError:
        size = len(self.source.text)
        span = (
            self.tokens[self.at].span
            if self.at < len(self.tokens)
            else Span(self.source, max(0, size - 1), size)
        )
        return InputError(Diagnostic(message, span, "hoa"))

    def split(self) -> None:
        position, text = 0, self.source.text
        while position < len(text):
            found = _TOKEN.match(text, position)
            if found is None:
                self.tokens.append(
                    _Token("", text[position], Span(self.source, position, position + 1))
                )
                self.at = len(self.tokens) - 1
                raise self.fault("this is not a word of the HOA format")
            if found.lastgroup is not None:
                self.tokens.append(
                    _Token(found.lastgroup, found.group(), Span(self.source, *found.span()))
                )
            position = found.end()

    @property
    def next(self) -> _Token:
        return (
            self.tokens[self.at]
            if self.at < len(self.tokens)
            else _Token("end", "", Span(self.source, 0, 0))
        )

    def take(self, *expected: str) -> str | None:
        """The text of the next token if its text or kind is among those given, else None."""
        token = self.next
        if token.text in expected or token.kind in expected:
            self.at += 1
            return token.text
        return None

    def need(self, *expected: str, what: str) -> str:
        text = self.take(*expected)
        if text is None:
            raise self.fault(f"{what} is expected here")
        return text

    def number(self, what: str) -> int:
        return int(self.need("number", what=what))


_Label = Callable[[int], bool]
"""Whether an edge has a letter, given as a valuation in bits."""
_Term = tuple[frozenset[tuple[int, bool]], frozenset[tuple[int, bool]]]
"""Sets to visit finitely and infinitely often: pairs (number, False for its complement)."""


@dataclass
class _Header:
    states: int | None = None
    start: list[int] = field(default_factory=list)
    bits: tuple[int, ...] = ()
    aliases: dict[str, _Label] = field(default_factory=dict)
    sets: int = 0
    condition: tuple[_Term, ...] | None = None


@dataclass(frozen=True, slots=True)
class _Edge:
    source: int
    label: _Label
    target: int
    sets: frozenset[int]


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
    reader = _Reader(Source(name, text))
    reader.split()
    header = _header(reader, atoms)
    if len(header.start) != 1:
        raise reader.fault(
            f"a deterministic automaton has one initial state, not {len(header.start)}"
        )
    if header.condition is None:
        raise reader.fault("the acceptance condition is missing")
    edges = _body(reader, header)
    return _automaton(reader, header, edges, letters)


# ------------------------------------------------------------------------------------------- header


def _header(reader: _Reader, atoms: Mapping[str, int]) -> _Header:
    reader.need("HOA:", what="'HOA: v1'")
    reader.need("v1", what="v1")
    header = _Header()
    while not reader.take("--BODY--"):
        match reader.need("header", what="a header or --BODY--"):
            case "States:":
                header.states = reader.number("the number of states")
            case "Start:":
                header.start.append(reader.number("the initial state"))
                if reader.take("&"):
                    raise reader.fault("alternating automata are not read")
            case "AP:":
                header.bits = tuple(
                    _atom(reader, atoms) for _ in range(reader.number("the number of atoms"))
                )
            case "Alias:":
                alias = reader.need("name", what="the name of the alias")
                header.aliases[alias] = _label(reader, header)
            case "Acceptance:":
                header.sets = reader.number("the number of acceptance sets")
                header.condition = _condition(reader, header)
            case _:
                while reader.next.kind not in ("header", "mark", "end"):
                    reader.at += 1
    return header


def _atom(reader: _Reader, atoms: Mapping[str, int]) -> int:
    text = reader.next.text
    if reader.next.kind == "text" and text[1:-1] not in atoms:
        raise reader.fault(f"the formula has no atom {text}")
    return atoms[reader.need("text", what="the name of an atom")[1:-1]]


def _label(reader: _Reader, header: _Header) -> _Label:
    """A boolean expression over the atoms: | binds weaker than &."""
    parts = [_label_and(reader, header)]
    while reader.take("|"):
        parts.append(_label_and(reader, header))
    return parts[0] if len(parts) == 1 else lambda v: any(p(v) for p in parts)


def _label_and(reader: _Reader, header: _Header) -> _Label:
    parts = [_label_atom(reader, header)]
    while reader.take("&"):
        parts.append(_label_atom(reader, header))
    return parts[0] if len(parts) == 1 else lambda v: all(p(v) for p in parts)


def _label_atom(reader: _Reader, header: _Header) -> _Label:
    if reader.take("!"):
        inner = _label_atom(reader, header)
        return lambda v: not inner(v)
    if reader.take("("):
        inner = _label(reader, header)
        reader.need(")", what="')'")
        return inner
    if reader.next.kind == "name" and reader.next.text in header.aliases:
        return header.aliases[reader.need("name", what="an alias")]
    if reader.take("t"):
        return lambda _: True
    if reader.take("f"):
        return lambda _: False
    if reader.next.kind == "number" and int(reader.next.text) >= len(header.bits):
        raise reader.fault(f"there are {len(header.bits)} atoms, restrict_to_reachable from 0")
    bit = header.bits[reader.number("a label")]
    return lambda v: bool(v >> bit & 1)


def _condition(reader: _Reader, header: _Header) -> tuple[_Term, ...]:
    """The acceptance condition in disjunctive normal form."""
    terms = _condition_and(reader, header)
    while reader.take("|"):
        terms = _limited(reader, dict.fromkeys((*terms, *_condition_and(reader, header))))
    return terms


def _condition_and(reader: _Reader, header: _Header) -> tuple[_Term, ...]:
    terms = _condition_atom(reader, header)
    while reader.take("&"):
        pairs = product(terms, _condition_atom(reader, header))
        terms = _limited(reader, dict.fromkeys((a[0] | b[0], a[1] | b[1]) for a, b in pairs))
    return terms


def _limited(reader: _Reader, terms: Mapping[_Term, None]) -> tuple[_Term, ...]:
    kept = tuple(
        t for t in terms if not any(o != t and o[0] <= t[0] and o[1] <= t[1] for o in terms)
    )
    if len(kept) > _MAX_PAIRS:
        raise reader.fault(f"this acceptance condition needs more than {_MAX_PAIRS} Rabin pairs")
    return kept


def _condition_atom(reader: _Reader, header: _Header) -> tuple[_Term, ...]:
    nothing: frozenset[tuple[int, bool]] = frozenset()
    if reader.take("("):
        terms = _condition(reader, header)
        reader.need(")", what="')'")
        return terms
    match reader.need("t", "f", "Fin", "Inf", what="Fin, Inf, t or f"):
        case "t":
            return ((nothing, nothing),)
        case "f":
            return ()
        case kind:
            reader.need("(", what="'('")
            positive = reader.take("!") is None
            sets = frozenset({(_set(reader, header), positive)})
            reader.need(")", what="')'")
            return ((sets, nothing) if kind == "Fin" else (nothing, sets),)


def _set(reader: _Reader, header: _Header) -> int:
    if reader.next.kind == "number" and int(reader.next.text) >= header.sets:
        raise reader.fault(f"there are {header.sets} acceptance sets, restrict_to_reachable from 0")
    return reader.number("the number of an acceptance set")


# --------------------------------------------------------------------------------------------- body


def _body(reader: _Reader, header: _Header) -> list[_Edge]:
    edges: list[_Edge] = []
    while not reader.take("--END--"):
        reader.need("State:", what="'State:' or --END--")
        label = _bracketed(reader, header)
        state = reader.number("the number of a state")
        reader.take("text")
        sets = _sets(reader, header)
        edges += [replace(e, sets=e.sets | sets) for e in _edges(reader, header, state, label)]
    return edges


def _edges(
    reader: _Reader, header: _Header, state: int, state_label: _Label | None
) -> Iterator[_Edge]:
    implicit = 0
    while reader.next.text == "[" or reader.next.kind == "number":
        label = _bracketed(reader, header) or state_label
        if label is None:
            label = _implicit(header.bits, implicit)
            implicit += 1
        target = reader.number("the state after the edge")
        if reader.next.text == "&":
            raise reader.fault("alternating automata are not read")
        yield _Edge(state, label, target, _sets(reader, header))


def _implicit(bits: tuple[int, ...], number: int) -> _Label:
    """The label of the i-th edge without one: atom j is true if bit j of i is set."""
    return lambda v: all((v >> bit & 1) == (number >> j & 1) for j, bit in enumerate(bits))


def _bracketed(reader: _Reader, header: _Header) -> _Label | None:
    if not reader.take("["):
        return None
    label = _label(reader, header)
    reader.need("]", what="']'")
    return label


def _sets(reader: _Reader, header: _Header) -> frozenset[int]:
    found = set()
    if reader.take("{"):
        while not reader.take("}"):
            found.add(_set(reader, header))
    return frozenset(found)


def _automaton(
    reader: _Reader, header: _Header, edges: list[_Edge], letters: Sequence[int]
) -> Automaton:
    states = max(
        (header.states or 0, header.start[0] + 1, *(max(e.source, e.target) + 1 for e in edges))
    )
    if (states + 1) * len(letters) * (1 + header.sets) > _MAX_EDGES:
        raise reader.fault(
            f"an automaton with {states:,} states and {len(letters):,} letters is too large"
        )
    sink = states  # takes the edges that are missing
    table = np.full((states + 1, len(letters)), sink, dtype=np.int32)
    seen = np.zeros(table.shape, dtype=bool)
    marks = np.zeros((header.sets, *table.shape), dtype=bool)
    for edge in edges:
        here = np.array([edge.label(v) for v in letters], dtype=bool)
        if np.any(seen[edge.source] & here & (table[edge.source] != edge.target)):
            raise reader.fault(
                "the automaton is not deterministic: "
                f"state {edge.source} has several edges for the same letter"
            )
        seen[edge.source] |= here
        table[edge.source, here] = edge.target
        for number in edge.sets:
            marks[number, edge.source] |= here
    assert header.condition is not None
    pairs = tuple(_pair(term, marks, sink) for term in header.condition)
    return reduced(Automaton(table, header.start[0], pairs))


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
