"""Automata from an external translator, a program called with an input and an output file."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping, Sequence
from functools import partial, reduce
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import assert_never

from symcheck.automata.automaton import Automaton
from symcheck.automata.formula import Kind, LtlFormula
from symcheck.automata.hoa import read
from symcheck.errors import UnsupportedError, UsageError

__all__ = ["SYNTAXES", "format_formula", "translate_externally"]

SYNTAXES: Mapping[str, str] = {
    "lbt": "& | U V X F G t f",
    "spin": "&& || U V X <> [] true false",
    "spot": "& | U R X F G true false",
    "rabinizer": "& | U R X F G true false",
}
"""By the name of a syntax, its words for `_OPERATORS`."""

_OPERATORS = ("AND", "OR", "UNTIL", "RELEASE", "NEXT", "F", "G", "TRUE", "FALSE")


def format_formula(formula: LtlFormula, syntax: str = "lbt") -> str:
    """The formula as text for an external translator.

    Args:
        formula: atoms are written p0, p1, ...; bounds on steps are expanded with X.
        syntax: a member of SYNTAXES; 'lbt' is prefix notation.

    Raises:
        UsageError: the syntax is unknown.
    """
    if syntax not in SYNTAXES:
        raise UsageError(f"unknown syntax of formulas '{syntax}': known are {', '.join(SYNTAXES)}")
    words = dict(zip(_OPERATORS, SYNTAXES[syntax].split(), strict=True))

    def applied(word: str, *parts: str) -> str:
        if syntax == "lbt":
            return " ".join((word, *parts))
        return f"{word}({parts[0]})" if len(parts) == 1 else f"({f' {word} '.join(parts)})"

    texts: dict[int, str] = {}
    for f in formula.subformulas():
        parts = [texts[p.number] for p in f.parts]
        match f.kind:
            case Kind.TRUE | Kind.FALSE:
                text = words[f.kind.name]
            case Kind.POSITIVE:
                text = f"p{f.atom}"
            case Kind.NEGATIVE:
                text = applied("!", f"p{f.atom}")
            case Kind.AND | Kind.OR:
                text = reduce(partial(applied, words[f.kind.name]), parts)
            case Kind.NEXT:
                text = applied(words["NEXT"], *parts)
            case Kind.UNTIL | Kind.RELEASE if f.bound is not None:
                # left U<=k right is right | left & X (left U<=k-1 right); R is its dual.
                left, right = parts
                dual = f.kind is Kind.RELEASE
                outer, inner = ("AND", "OR") if dual else ("OR", "AND")
                text = right
                for _ in range(f.bound):
                    later = applied(words[inner], left, applied(words["NEXT"], text))
                    text = applied(words[outer], right, later)
            case Kind.UNTIL if f.eventually is not None:
                text = applied(words["F"], parts[1])
            case Kind.RELEASE if f.always is not None:
                text = applied(words["G"], parts[1])
            case Kind.UNTIL | Kind.RELEASE:
                text = applied(words[f.kind.name], *parts)
            case _:
                assert_never(f.kind)
        texts[f.number] = text
    return texts[formula.number]


def translate_externally(
    program: str, syntax: str, formula: LtlFormula, letters: Sequence[int]
) -> Automaton:
    """The automaton that an external program constructs for a formula.

    Args:
        program: called with two file names: the formula to read, and the HOA file to write.
        syntax: the syntax of the formula, a member of SYNTAXES.
        formula: the formula.
        letters: valuations, as in `symcheck.automata.translate.translate`.

    Raises:
        UsageError: the program cannot be run.
        UnsupportedError: the program fails or writes nothing.
        InputError: its output is not a deterministic automaton over the formula's atoms.
    """
    text = format_formula(formula, syntax)
    with TemporaryDirectory(prefix="symcheck-") as folder:
        formula_file, answer = Path(folder, "formula.ltl"), Path(folder, "automaton.hoa")
        formula_file.write_text(text + "\n", encoding="utf-8")
        try:
            run = subprocess.run(
                [program, str(formula_file), str(answer)],
                capture_output=True,
                text=True,
                errors="replace",
                check=False,
            )
        except OSError as error:
            raise UsageError(
                f"the translator '{program}' cannot be run: {error.strerror}"
            ) from error
        said = " ".join((run.stderr or run.stdout).split())[:300]
        if run.returncode != 0:
            raise UnsupportedError(
                f"the translator '{program}' failed with exit status {run.returncode}: "
                f"{said or 'no message'}"
            )
        if not answer.exists():
            raise UnsupportedError(
                f"the translator '{program}' wrote no automaton: {said or 'no message'}"
            )
        written = answer.read_text(encoding="utf-8", errors="replace")
    atoms = {f"p{f.atom}": f.atom for f in formula.subformulas() if f.atom >= 0}
    return read(written, letters, atoms, name=f"<automaton of {Path(program).name}>")
