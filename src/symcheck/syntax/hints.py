"""Hints at what a writer meant, where the rules of `diagnostics` know only what was expected."""

from __future__ import annotations

import re
from collections.abc import Set

from symcheck.errors import Source
from symcheck.syntax.ast import MEASURE_WORDS, AnyMeasure, letters_of
from symcheck.syntax.grammars import Language
from symcheck.syntax.model_hints import meant_in_model
from symcheck.syntax.recovery import Fault

__all__ = ["meant"]

_MEASURES = frozenset(word for word in MEASURE_WORDS if word[0] != "S")  # S has no path
_OTHER = (
    {
        spelling: measure + direction
        for measure in "PR"
        for direction in ("min", "max")
        for spelling in ((measure + direction).lower(), (direction + measure).lower())
    }
    | dict.fromkeys(("p", "pr", "prob", "probability"), "P")
    | {"r": "R", "s": "S"}
)
"""Names that stand for measures in other tools, in lower case."""
_STRUCTURE = re.compile(r"[\[{]\s*\"?(\w+)\"?\s*[\]}]\s*(min|max|)")


def meant(fault: Fault, source: Source, language: Language) -> str | None:
    """What was perhaps meant, as a hint; None if the words do not tell."""
    signs = {language.spelling.get(name) for name in fault.expected}
    after_fault = source.text[fault.start :]
    if re.match(r",\d", after_fault) and fault.last.isdigit() and ".." not in signs:
        return f"a decimal has a point: {fault.last}.{after_fault[1]}"
    if signs <= {"=", ";"} and fault.token.value == ":" and fault.last_but_one != "const":
        return "write = in place of :"
    if fault.token.value in ("<", "<=", ">", ">=", "=", "!=") and fault.last in ("&", "|"):
        return f"each comparison has two sides: x>=1 {fault.last} x{fault.token.value}…"
    if "ENDMODULE" in language.spelling:
        name = fault.token.value.strip('" \t')
        if fault.token.type == "STRING" and fault.last in ("=", "!=") and not _defines(fault):
            return f"there are no texts: name numbers by constants, const int {name} = 0;"
        if fault.token.type == "STRING" and "INTEGER" in fault.expected:
            return "a label is no expression of a model: use a formula, which has no quotes"
        return meant_in_model(fault, source, signs)
    return _meant_in_properties(fault, source, signs)


def _defines(fault: Fault) -> bool:
    """Whether the last = is that of a definition."""
    return any(w.value in ("formula", "label", "const") for w in fault.before[-4:-2])


def _meant_in_properties(fault: Fault, source: Source, signs: Set[str | None]) -> str | None:
    found, last, expected = fault.token.value, fault.last, fault.expected
    before = [str(word.value) for word in fault.before]
    measure = next((word for word in reversed(before) if word in _MEASURES), "P")
    brackets = f"its path stands in brackets: {measure}=? [ F … ]"
    after = [str(word.value) for word in fault.after[:1]]
    after_fault = source.text[fault.start :]
    if (
        before[-2:-1] == ["const"]
        and last.isidentifier()
        and (found.isidentifier() or found == ":")
    ):
        return "a constant is of type int, double or bool: const double p = 0.5;"
    if last == "if":
        return "a condition is written condition ? value : other value"
    if found == "," and "[" in before and "]" not in before:
        return None if "(" in before else "and is written &"
    if found == ",":
        return None if "(" in before else "properties are separated by ;"
    if found == "]" and "," in signs:
        is_name = before[-2:-1] == ["["] and last.isidentifier()
        return f"an interval of time is [low,high]{'; an action is no condition' * is_name}"
    if found == ":" and last.isidentifier() and before in ([last], [";", last]):
        return f'the name of a property stands in quotes: "{last}"'
    if found == "?" and last in ("<", "<=", ">", ">="):
        return "a value is asked for by =?"
    if last == "I" and signs == {"="}:
        return "I takes a point of time, I=k; C<=k is the reward up to k"
    if last == "C" and "<=" in signs and found.isalnum():
        return f"write C<={found}"
    if re.match(r"\[(exp|var)\]", after_fault):
        return "R=? is the expected value; variances are not supported"
    if found in ("<", "<=", ">", ">=") and "NEXT" not in expected and "INTEGER" in expected:
        asked = next((w.value for w in fault.after[:3] if w.value in _MEASURES | {"S"}), None)
        if asked is not None and after:
            return f"the bound stands behind {asked}: {asked}{found}{after[0]} [ … ]"
    if last in _MEASURES | {"S", "E"} and found != "{":
        if last == "R" and (named := re.match(r"\(?\s*(\"\w+\")", after_fault)):
            return f"a reward structure stands in braces: R{{{named[1]}}}=? [ F … ]"
        if last == "E" and found == "=":
            return "E [ … ] asks for a path; its probability is P=? [ … ], a reward R=? [ … ]"
        if found == "=>" and ">=" in signs:
            return f"at least is written >=: {last}>=0.5 [ … ]"
        if last != "E" and ">=" in signs and not _STRUCTURE.match(after_fault):
            return f"{last}=? [ … ] asks for the value, {last}>=0.5 [ … ] whether a bound holds"
    if last == "?" and found in ("min", "max"):
        if before[-3:-2] == ["}"]:
            return f'the direction comes before =?: R{{"…"}}{found}=? [ F … ]'
        return f"write {before[-3]}{found}=?" if before[-3:-2] else None
    if last == "?" and before[-3:-2] == ["R"] and (part := _STRUCTURE.match(after_fault)):
        return f'the reward structure comes before =?: R{{"{part[1]}"}}=? [ F … ]'
    if found == "[" and last == "}" and {"min", "max"} <= signs:
        return "=? asks for the value, >=0.5 whether a bound holds"
    if last == "}" and before[-3:-2] == ["{"] and before[-4:-3] in (["F"], ["G"], ["X"], ["U"]):
        return f"a bound is written {before[-4]}<={before[-2]}"
    if found in ("F", "G", "X") and "[" in signs:
        return f"its path stands in brackets: {last} [ {found} … ]" if last in "AE" else brackets
    if "[" in signs and (last == "?" or found == "(" or (not found and _MEASURES & set(before))):
        steady = before[-3:-2] == ["S"]
        return "its states stand in brackets: S=? [ x=1 ]" if steady else brackets
    if (hint := _measure_meant(found, last, after_fault)) is not None:
        return hint
    if found == "?" and last == "=" and before[-2:-1]:
        if before[-2] == "]":
            return "the bound stands before the brackets: P=? [ F … ]"
        if name := _OTHER.get(before[-2].lower().replace("_", "").replace("imum", "")):
            return f"write {name}=?"
        if before[-2].isidentifier():
            return f"{letters_of(AnyMeasure)} ask for values: P=? [ F … ]"
    if found == "[" and (name := _OTHER.get(last.lower())):
        return f"write {name}=? [ … ] for the value, {name}>=0.5 [ … ] for whether a bound holds"
    if re.match(r"\[\s*\]|<>", after_fault):
        letter, name = ("G", "always") if found == "[" else ("F", "eventually")
        return f"{name} is written {letter}: P>=1 [ {letter} … ], or A [ {letter} … ]"
    if "NEXT" in expected and found in ("U", "W", "R"):
        return f"{found} stands between two formulas: P=? [ x=1 {found} y=2 ]"
    if last in ("F", "G", "X") and found == "=>":
        return f"at least is written >=: {last}>=k"
    if fault.last_but_one in ("F", "G", "X", "U") and last in ("(", "{", "^"):
        operator = before[-2]
        if found.isdigit() or found in ("<", "<=", ">", ">=", "="):
            return f"a bound is written {operator}<=k"
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
