"""Hints at what a writer meant, where the rules of `diagnostics` know only what was expected."""

from __future__ import annotations

import re

from symcheck.errors import Source
from symcheck.syntax.grammars import Language
from symcheck.syntax.recovery import Fault

__all__ = ["meant"]

_MODEL_TYPES = frozenset(("dtmc", "ctmc", "mdp", "probabilistic", "stochastic", "nondeterministic"))
_MEASURES = frozenset(("P", "Pmin", "Pmax", "R", "Rmin", "Rmax", "T", "Tmin", "Tmax"))
_OTHER = {
    spelling: measure + direction
    for measure in "PR"
    for direction in ("min", "max")
    for spelling in ((measure + direction).lower(), (direction + measure).lower())
}
"""Names that stand for measures in other tools, in lower case."""
_STRUCTURE = re.compile(r"[\[{]\s*\"?(\w+)\"?\s*[\]}]\s*(min|max|)")
_RANGE = "a variable is declared as name : [low..high] or name : bool"
_BRACKETS = "its path stands in brackets: P=? [ F … ]"
_COMMAND = "a command starts with [action] or []: [] guard -> updates;"


def meant(fault: Fault, source: Source, language: Language) -> str | None:
    """What was perhaps meant, as a hint; None if the words do not tell."""
    found, last, expected = fault.token.value, fault.last, fault.expected
    before = [str(word.value) for word in fault.before]
    in_model = "ENDMODULE" in language.spelling
    signs = {language.spelling.get(name) for name in expected}
    after_fault = source.text[fault.start :]
    if found == ",":
        if ".." in signs:
            return _RANGE
        if re.match(r",\d", after_fault) and last.isdigit():
            return f"a decimal has a point: {last}.{after_fault[1]}"
        if "->" in before:
            return "alternatives are joined by +: 0.5 : (x'=1) + 0.5 : (x'=2)"
        return None if in_model else "properties are separated by ;"
    if last == ":" and {"[", "bool"} <= signs:
        return _RANGE
    if not in_model and re.match(r"\[(exp|var)\]", after_fault):
        return "R=? is the expected value; variances are not supported"
    if found == "[" and last == "int" and ";" in signs:
        return _RANGE
    if in_model and found.lower() in _MODEL_TYPES and not before:
        return f"write {found.lower()}"
    if found == ";" and last in _MODEL_TYPES:
        return "leave out the semicolon"
    if last == "if":
        return "a condition is written condition ? value : other value"
    if in_model and signs == {":"} and "->" in after_fault.partition(";")[0]:
        return _COMMAND
    if "[" in signs and (last == "?" or (not found and _MEASURES & set(before))):
        return _BRACKETS
    if not in_model and (hint := _measure_meant(found, last, after_fault)) is not None:
        return hint
    if found == "?" and last == "=" and before[-2:-1] and (name := _OTHER.get(before[-2].lower())):
        return f"write {name}=?"
    if found == "?" and last == "=" and before[-2:-1] and before[-2].isidentifier():
        return "P, R, S and T ask for values: P=? [ F … ]"
    if not in_model and re.match(r"\[\s*\]|<>", after_fault):
        letter, name = ("G", "always") if found == "[" else ("F", "eventually")
        return f"{name} is written {letter}: P>=1 [ {letter} … ], or A [ {letter} … ]"
    if in_model and found.isdigit() and not before:
        return "explicit files are read by -importtrans and -importmodel"
    return None


def _measure_meant(found: str, last: str, after_fault: str) -> str | None:
    """A hint at a measure whose parts are in the wrong order or in the wrong brackets."""
    if last not in _MEASURES or not (part := _STRUCTURE.match(after_fault)):
        return None
    if found == "[" and not (last == "R" and '"' in part[0]):
        return None  # a path
    structure, direction = '{"' + part[1] + '"}', part[2] or last[1:]
    if last[0] == "R" and last != "R":
        return f"the reward structure comes before {direction}: R{structure}{direction}"
    if last == "R":
        return f"a reward structure stands in braces: R{structure}{direction}"
    if last[0] == "P":
        return f"P reads no rewards; R does: R{structure}{direction}"
    return None
