"""Automata from an external translator, a program called with an input and an output file."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from symcheck.automata.automaton import Automaton
from symcheck.automata.formula import Kind, LtlFormula
from symcheck.automata.hoa import read
from symcheck.errors import UnsupportedError, UsageError

__all__ = ["SYNTAXES", "format_formula", "translate_externally"]

SYNTAXES = ("lbt", "spin", "spot", "rabinizer")

_INFIX = {
    "spin": {
        "AND": "&&",
        "OR": "||",
        "UNTIL": "U",
        "RELEASE": "V",
        "NEXT": "X",
        "F": "<>",
        "G": "[]",
    },
    "spot": {"AND": "&", "OR": "|", "UNTIL": "U", "RELEASE": "R", "NEXT": "X", "F": "F", "G": "G"},
    "rabinizer": {
        "AND": "&",
        "OR": "|",
        "UNTIL": "U",
        "RELEASE": "R",
        "NEXT": "X",
        "F": "F",
        "G": "G",
    },
}
_PREFIX = {"AND": "&", "OR": "|", "UNTIL": "U", "RELEASE": "V", "NEXT": "X", "F": "F", "G": "G"}


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
    unary, binary = (
        (_prefix_unary, _prefix_binary) if syntax == "lbt" else (_infix_unary, _infix_binary)
    )
    words = _PREFIX if syntax == "lbt" else _INFIX[syntax]
    true, false = ("t", "f") if syntax == "lbt" else ("true", "false")
    texts: dict[int, str] = {}
    for f in formula.subformulas():
        parts = [texts[p.number] for p in f.parts]
        match f.kind:
            case Kind.TRUE:
                text = true
            case Kind.FALSE:
                text = false
            case Kind.POSITIVE | Kind.NEGATIVE:
                text = f"p{f.atom}" if f.kind is Kind.POSITIVE else unary("!", f"p{f.atom}")
            case Kind.AND | Kind.OR:
                text = parts[0]
                for part in parts[1:]:
                    text = binary(words[f.kind.name], text, part)
            case Kind.NEXT:
                text = unary(words["NEXT"], parts[0])
            case Kind.UNTIL | Kind.RELEASE if f.bound is not None:
                text = _unrolled(f, parts, words, unary, binary)
            case _:
                inner = f.eventually or f.always
                short = words["F" if f.eventually is not None else "G"]
                text = (
                    binary(words[f.kind.name], *parts) if inner is None else unary(short, parts[1])
                )
        texts[f.number] = text
    return texts[formula.number]


def _unrolled(
    f: LtlFormula,
    parts: list[str],
    words: dict[str, str],
    unary: Callable[[str, str], str],
    binary: Callable[[str, str, str], str],
) -> str:
    """`left U<=k right` is right | left & X (left U<=k-1 right); R is its dual."""
    left, right = parts
    outer, inner = (
        (words["OR"], words["AND"]) if f.kind is Kind.UNTIL else (words["AND"], words["OR"])
    )
    text = right
    for _ in range(f.bound or 0):
        text = binary(outer, right, binary(inner, left, unary(words["NEXT"], text)))
    return text


def _prefix_unary(word: str, part: str) -> str:
    return f"{word} {part}"


def _prefix_binary(word: str, left: str, right: str) -> str:
    return f"{word} {left} {right}"


def _infix_unary(word: str, part: str) -> str:
    return f"{word}({part})"


def _infix_binary(word: str, left: str, right: str) -> str:
    return f"({left} {word} {right})"


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
        asked, answer = Path(folder, "formula.ltl"), Path(folder, "automaton.hoa")
        asked.write_text(text + "\n")
        try:
            run = subprocess.run(
                [program, str(asked), str(answer)],
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
        written = answer.read_text(errors="replace")
    atoms = {f"p{f.atom}": f.atom for f in formula.subformulas() if f.atom >= 0}
    return read(written, letters, atoms, name=f"<automaton of {Path(program).name}>")
