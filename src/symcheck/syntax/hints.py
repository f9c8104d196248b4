"""Hints at what a writer meant, where the rules of `diagnostics` know only what was expected."""

from __future__ import annotations

import re

from symcheck.errors import Source
from symcheck.syntax.ast import MEASURE_WORDS, TYPE_WORDS, AnyMeasure, letters_of
from symcheck.syntax.grammars import Language
from symcheck.syntax.recovery import Fault

__all__ = ["meant"]

_MEASURES = frozenset(word for word in MEASURE_WORDS if word[0] != "S")  # S has no path
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
        return None if in_model or "(" in before else "properties are separated by ;"
    if before[-2:-1] == ["const"] and found.isidentifier() and last.isidentifier():
        return "a constant is of type int, double or bool: const double p = 0.5;"
    if in_model and found in ("int", "double", "bool") and "module" in signs:
        return f"a constant is declared as const {found} …;, a variable as name : [low..high];"
    if in_model and last == "end" and found:
        return f"write end{found}, one word"
    if in_model and found == "{" and before[-2:-1] == ["module"]:
        return "a module ends with endmodule, and has no braces"
    if found == "=" and {";", "init"} <= signs:
        return "the initial value is written init 0"
    if in_model and found == "]" and ".." in signs:
        return _RANGE
    if found.isidentifier() and {"(", "true"} <= signs and "->" in before:
        return f"an update stands in parentheses: ({found}'=…)"
    if last == "I" and signs == {"="}:
        return "I takes a point of time, I=k; C<=k is the reward up to k"
    if last == ":" and {"[", "bool"} <= signs:
        return _RANGE
    if not in_model and re.match(r"\[(exp|var)\]", after_fault):
        return "R=? is the expected value; variances are not supported"
    if found == "[" and last == "int" and ";" in signs:
        return _RANGE
    if in_model and found.lower() in TYPE_WORDS and not before:
        return f"write {found.lower()}"
    if found == ";" and last in TYPE_WORDS:
        return "leave out the semicolon"
    if last == "if":
        return "a condition is written condition ? value : other value"
    if in_model and signs == {":"} and "->" in after_fault.partition(";")[0]:
        return _COMMAND
    if not in_model and (last in _MEASURES or last in ("S", "E")) and found != "{":
        if last == "R" and re.match(r"\(\s*\"", after_fault):
            return 'a reward structure stands in braces: R{"name"}=? [ F … ]'
        if last == "E" and found == "=":
            return "E [ … ] asks for a path; its probability is P=? [ … ], a reward R=? [ … ]"
        if last != "E" and ">=" in signs and not _STRUCTURE.match(after_fault):
            return f"{last}=? [ … ] asks for the value, {last}>=0.5 [ … ] whether a bound holds"
    if not in_model and found in ("F", "G", "X") and "[" in signs:
        return f"its path stands in brackets: {last} [ {found} … ]" if last in "AE" else _BRACKETS
    if "[" in signs and (last == "?" or (not found and _MEASURES & set(before))):
        return _BRACKETS
    if not in_model and (hint := _measure_meant(found, last, after_fault)) is not None:
        return hint
    if found == "?" and last == "=" and before[-2:-1] and (name := _OTHER.get(before[-2].lower())):
        return f"write {name}=?"
    if found == "?" and last == "=" and before[-2:-1] and before[-2].isidentifier():
        return f"{letters_of(AnyMeasure)} ask for values: P=? [ F … ]"
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
