"""A driver for the LALR(1) tables, with recovery: after an error it goes on behind the next semicolon or keyword.

Source of the recovery: panic mode, Aho, Lam, Sethi and Ullman, Compilers (2007), 4.8.3; before that it tries to put in one
missing word.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from symcheck.syntax.grammars import Grammar
from symcheck.syntax.lexer import FOREIGN, Words
from symcheck.syntax.tree_builder import Builder

__all__ = ["MAX_NESTING", "Fault", "Parser"]

MAX_NESTING = (
    2000 if sys.version_info[:2] != (3, 12) else 1000 if sys.version_info >= (3, 12, 2) else 320
)
"""Expressions deeper than this are refused: later stages follow them by recursion.

CPython 3.12 alone has a fixed limit for recursion that passes through C, as comparing and hashing trees does; its first
two releases had a third of that of the others.
"""

_MAX_FAULTS = 20
_MENDING = (
    "';'",
    "')'",
    "']'",
    "'}'",
    "':'",
    '"\'"',
    "'endmodule'",
    "'endrewards'",
    "'endinit'",
    "'endsystem'",
)

Build = Callable[[list[Any], int, int], Any]


@dataclass(frozen=True, slots=True)
class Fault:
    """Word number `at` does not fit: one of the kinds `expected` should stand there. `mended`: the kind that was put in."""

    at: int
    start: int
    end: int
    previous: int
    kind: int
    expected: frozenset[int]
    mended: int | None = None
    too_deep: bool = False


class Parser:
    """One parse. `build` has a function for every action of the grammar: f(values, start, end) makes a node.

    `resume` names the rules after which a broken text can go on: the parts that lists are made of. `openers` are the kinds
    of words that start such a part.
    """

    def __init__(
        self,
        grammar: Grammar,
        words: Words,
        build: Builder,
        resume: frozenset[str],
        openers: frozenset[int],
    ) -> None:
        self.grammar = grammar
        self.words = words
        self.build = build
        self.faults: list[Fault] = []
        self.deepest = 0
        self._resume = resume
        self._openers = openers
        self._builders: list[Build | None] = [
            getattr(build, r.action) if r.action else None for r in grammar.rules
        ]
        self._plain = [tuple(range(r.length)) == r.shape for r in grammar.rules]
        self._climbs: dict[tuple[int, int, int], int] = {}
        self._states: list[int] = []
        self._values: list[Any] = []
        self._starts: list[int] = []
        self._ends: list[int] = []
        self._depths: list[int] = []
        self._checkpoint: tuple[list[int], int] = ([], 0)

    def parse(self, start: str) -> Any:
        """The value of the start symbol, or None where a fault leaves none. `faults` tells what is wrong."""
        first, last = self.grammar.starts[start]
        self._states.append(first)
        self._checkpoint = ([first], 0)
        i = 0
        while True:
            stopped = self._run(i, last)
            if stopped is None:
                return self._values[-1]
            i = stopped
            resumed = self._recover(i)
            if resumed is None:
                return None
            i = resumed
            self._checkpoint = (self._states.copy(), i)

    def _run(self, i: int, last: int) -> int | None:
        """Parse from word i on. Returns None at the end, or the number of the word that does not fit."""
        rows, rules = self.grammar.rows, self.grammar.rules
        states, values, starts, ends, depths = (
            self._states,
            self._values,
            self._starts,
            self._ends,
            self._depths,
        )
        words, climbs = self.words, self._climbs
        text, kinds, word_starts, word_ends = words.text, words.kinds, words.starts, words.ends
        end_kind = self.grammar.end
        kind = kinds[i]
        while True:
            action = rows[states[-1]].get(kind)
            if action is None:
                return i
            if action >= 0:
                start, end = word_starts[i], word_ends[i]
                states.append(action)
                values.append(text[start:end])
                starts.append(start)
                ends.append(end)
                depths.append(0)
                i += 1
                kind = kinds[i]
                continue
            number = ~action
            rule = rules[number]
            n = rule.length
            if n == 1 and rule.action is None:
                # Most reductions climb the ladder of operators one rung at a time: remember where such a climb ends.
                key = (states[-2], number, kind)
                landing = climbs.get(key)
                if landing is None:
                    landing = climbs[key] = self._climb(*key)
                states[-1] = landing
            elif n:
                if self._reduce(number, n) > MAX_NESTING:
                    return i
            else:
                self._reduce_nothing(number, word_starts[i])
            if kind == end_kind and states[-1] == last:
                return None

    def _climb(self, below: int, number: int, kind: int) -> int:
        """The state after all reductions by rules of one symbol that pass it on, from rule `number`, before a word of `kind`."""
        grammar = self.grammar
        while True:
            state = grammar.gotos[below][grammar.rules[number].head]
            action = grammar.rows[state].get(kind, 0)
            if action >= 0:
                return state
            number = ~action
            if grammar.rules[number].length != 1 or grammar.rules[number].action is not None:
                return state

    def _reduce(self, number: int, n: int) -> int:
        """Put what rule `number` makes of the last n symbols in their place; how deep it is nested."""
        states, starts, ends, depths, rule = (
            self._states,
            self._starts,
            self._ends,
            self._depths,
            self.grammar.rules[number],
        )
        start, end, depth = starts[-n], ends[-1], max(depths[-n:])
        value = self._value(number, self._values[-n:], start, end)
        if rule.action and value is not self.build.balanced:
            depth += 1
            self.deepest = max(self.deepest, depth)
        self._values[-n:] = [value]
        del states[-n:], starts[-n:], ends[-n:], depths[-n:]
        states.append(self.grammar.gotos[states[-1]][rule.head])
        starts.append(start)
        ends.append(end)
        depths.append(depth)
        return depth

    def _reduce_nothing(self, number: int, at: int) -> None:
        """Put what a rule makes of no symbols before the word that begins at `at`."""
        build = self._builders[number]
        self._values.append(build([], at, at) if build else [])
        self._states.append(self.grammar.gotos[self._states[-1]][self.grammar.rules[number].head])
        self._starts.append(at)
        self._ends.append(at)
        self._depths.append(0)

    def _value(self, number: int, symbols: list[Any], start: int, end: int) -> Any:
        """The value of a rule, from those of its symbols."""
        rule = self.grammar.rules[number]
        if self._plain[number]:
            kept = symbols
        else:
            kept = []
            for place in rule.shape:
                if place is None:
                    kept.append(None)
                elif place >= 0:
                    kept.append(symbols[place])
                elif kept:
                    kept += symbols[~place]
                else:
                    kept = symbols[~place]
        build = self._builders[number]
        if build is not None:
            return build(kept, start, end)
        return kept if rule.action == "" else kept[0]

    # -------------------------------------------------------------------------------------------- faults

    def accepts(self, states: Sequence[int], *kinds: int) -> bool:
        """Whether words of these kinds can come next, one after the other."""
        grammar = self.grammar
        height, above = (
            len(states),
            list[int](),
        )  # the stack is states[:height], then above: states may be long, and stays
        for kind in kinds:
            action = -1
            while action < 0:
                top = above[-1] if above else states[height - 1]
                entry = grammar.rows[top].get(kind)
                if entry is None:
                    return False
                action = entry
                if action >= 0:
                    above.append(action)
                    break
                rule = grammar.rules[~action]
                height -= max(rule.length - len(above), 0)
                del above[max(len(above) - rule.length, 0) :]
                above.append(grammar.gotos[above[-1] if above else states[height - 1]][rule.head])
                if (
                    kind == grammar.end
                    and height == 1
                    and len(above) == 1
                    and (states[0], above[0]) in grammar.starts.values()
                ):
                    break
        return True

    def _before(self, i: int) -> list[int]:
        """The states before word i was looked at: reductions made on its account would hide what else could stand there."""
        states, at = self._checkpoint
        stack = states.copy()
        grammar = self.grammar
        for kind in self.words.kinds[at:i]:
            action = grammar.rows[stack[-1]].get(kind)
            while action is not None and action < 0:
                rule = grammar.rules[~action]
                if rule.length:
                    del stack[-rule.length :]
                stack.append(grammar.gotos[stack[-1]][rule.head])
                action = grammar.rows[stack[-1]].get(kind)
            if action is None:
                return self._states
            stack.append(action)
        return stack

    def _recover(self, i: int) -> int | None:
        """Note the fault at word i and mend the stack. Returns the word to go on with; None to give up."""
        words = self.words
        place = (i, words.starts[i], words.ends[i], words.ends[i - 1] if i else 0, words.kinds[i])
        if self.deepest > MAX_NESTING:
            self.faults.append(Fault(*place, frozenset(), too_deep=True))
            return None
        before = self._before(i)
        expected = frozenset(
            kind for kind in range(len(self.grammar.terminals)) if self.accepts(before, kind)
        )
        fault = Fault(*place, expected, self._mend(i, expected))
        self.faults.append(fault)
        if len(self.faults) >= _MAX_FAULTS:
            return None
        if fault.mended is not None:
            words.insert(i, fault.mended)
            return i
        if self._repeated(i):
            words.delete(i)
            return i
        return self._panic(i)

    def _mend(self, i: int, expected: frozenset[int]) -> int | None:
        """The kind of a single missing word that makes words i and i+1 fit."""
        kinds = self.words.kinds
        spelling = self.grammar.spelling
        for kind in sorted(
            expected,
            key=lambda k: (
                _MENDING.index(f"'{spelling[k]}'") if f"'{spelling.get(k)}'" in _MENDING else 99
            ),
        ):
            if f"'{spelling.get(kind)}'" not in _MENDING:
                return None
            if self.accepts(self._states, kind, *kinds[i : i + 2]):
                return kind
        return None

    def _repeated(self, i: int) -> bool:
        """Whether word i merely repeats the sign before it, as in == and &&."""
        words = self.words
        return (
            i > 0
            and words[i] in ("=", "&", "|")
            and words[i] == words[i - 1]
            and words.starts[i] == words.ends[i - 1]
            and self.accepts(self._states, words.kinds[i + 1])
        )

    def _panic(self, i: int) -> int | None:
        """Leave out words up to the end of this part of the text, and what stands on the stack of it."""
        words = self.words
        semicolon = self.grammar.literals[";"]
        for j in range(i, len(words)):
            kind = words.kinds[j]
            if kind == semicolon and j + 1 < len(words) and self._cut(words.kinds[j + 1]):
                return j + 1
            if (
                kind == self.grammar.end
                or (kind in self._openers and kind != FOREIGN and self._first_on_line(j))
            ) and self._cut(kind):
                return j
        return None

    def _first_on_line(self, j: int) -> bool:
        """Whether only white space stands before word j on its line."""
        start = self.words.starts[j]
        return not self.words.text[self.words.text.rfind("\n", 0, start) + 1 : start].strip()

    def _cut(self, kind: int) -> bool:
        """Take the broken part off the stack, if a word of this kind can then come."""
        gotos = self.grammar.gotos
        for height in range(len(self._states), 0, -1):
            if self._resume.isdisjoint(gotos[self._states[height - 1]]):
                continue
            if self.accepts(self._states[:height], kind):
                del self._states[height:], self._values[height - 1 :], self._starts[height - 1 :]
                del self._ends[height - 1 :], self._depths[height - 1 :]
                return True
        return False
