"""Hints at what the writer of a model meant, for each part of a model."""

from __future__ import annotations

import re
from collections.abc import Sequence, Set
from typing import NamedTuple

from symcheck.errors import Source
from symcheck.syntax.ast import TYPE_WORDS
from symcheck.syntax.recovery import FOREIGN, RESERVED, Fault
from symcheck.syntax.words import Word

__all__ = ["COMMAND", "VARIABLE", "initial_value", "meant_in_model"]

VARIABLE = "a variable is declared as name : [low..high] or name : bool"
COMMAND = "a command is [action] guard -> updates;"
_NO_ACTION = "a command starts with [action] or []: [] guard -> updates;"
_ALTERNATIVES = "updates are joined by +, each with its probability: 0.5 : (x'=1) + 0.5 : (x'=2)"
_CHOICE = "a choice is several commands: [a] … -> (x'=1); [b] … -> (x'=2);"
_DECIMAL = "a variable is an int or a bool; constants, probabilities and rewards may be doubles"
_COPY = "a copy of a module is written module copy = original [ x=y, a=b ] endmodule"
_CASES = "each case is a command: [] guard & case -> updates;"
_CONDITION = "a choice of values is written condition ? value : other value"
_OTHER_OPERATORS = frozenset({"?", "*", "/", "-", "|", "^", "=", "!=", "<", "<=", ">", ">=", "=>"})
_LONGEST = 60
"""What is written anew in a hint has at most so many characters."""


class _Place(NamedTuple):
    fault: Fault
    source: Source
    signs: Set[str | None]
    found: str
    last: str
    before: list[str]


def meant_in_model(fault: Fault, source: Source, signs: Set[str | None]) -> str | None:
    """What was perhaps meant in a model, as a hint; None if the words do not tell.

    Args:
        fault: the word that does not fit, and those around it.
        source: the text.
        signs: how the expected words are written; None for those with several spellings.
    """
    parts = (_in_module_head, _in_copy, _in_variable, _in_update, _statement, _definition)
    at = _Place(fault, source, signs, fault.token.value, fault.last, _values(fault.before))
    return next((hint for part in parts if (hint := part(at)) is not None), None)


def _in_module_head(at: _Place) -> str | None:
    """Behind `module`, and behind the name of a module."""
    fault, source, found, last, before = at.fault, at.source, at.found, at.last, at.before
    if last == "module" and found in ("[", ";", "("):
        return "a module has a name: module name … endmodule"
    if before[-2:-1] == ["module"]:
        if found == ":" and _values(fault.after[:1]) in (["["], ["int"], ["bool"]):
            return "a module has a name: module name … endmodule"
        return {
            "{": "a module ends with endmodule, and has no braces",
            ";": "leave out the semicolon",
            ":": _COPY,
            "(": "a module has no parameters: module name … endmodule",
        }.get(found)
    if before[-4:-3] == ["module"] and before[-2:-1] == ["["] and found in ("=", ","):
        return _COPY  # its `= original` is missing
    if last == "endmodule" and found.isidentifier():
        line = source.text[fault.previous : fault.start]
        if found == last:
            return "leave out the second endmodule"
        return None if "\n" in line else f"leave out {found}: endmodule has no name"
    return None


def _in_copy(at: _Place) -> str | None:
    """In `module copy = original [ x=y ] endmodule`."""
    signs, found, before = at.signs, at.found, at.before
    if "module" not in before:
        return None
    head = before[len(before) - 1 - before[::-1].index("module") :]
    if head[2:3] != ["="]:
        return None
    if signs == {"["} or (found == "]" and head[-1] == "["):
        original = head[3] if len(head) > 3 else "original"
        return f"a copy gives new names: module {head[1]} = {original} [ old=new ] endmodule"
    if found == "]" and head[-1] == ",":
        return "leave out the comma"
    if signs == {"="} or "min" in signs:
        new = found.isdigit() and " (a constant, where a number is meant)"
        return f"a renaming is old=new, of two names{new or ''}"
    if signs == {",", "]"} and found in (";", "&"):
        return "renamings are separated by ,"
    return None


def _in_variable(at: _Place) -> str | None:
    """In the declaration of a variable."""
    fault, signs, found, last, before = (
        at.fault,
        at.signs,
        at.found,
        at.last,
        at.before,
    )
    if ".." in signs:
        return VARIABLE
    if found == "]" and last == "..":
        return VARIABLE
    if last == ":" and {"[", "bool"} <= signs:
        if "->" in _statement_words(fault):
            return _NO_ACTION
        if found in ("double", "float", "real"):
            return _DECIMAL
        if found == "{":
            name = (*_values(fault.after), last)[0]
            return f"values are numbers, which constants name: const int {name} = 0;"
        meant = {"integer": "int", "boolean": "bool"}.get(found, found).lower()
        return f"did you mean '{meant}'?" if meant in ("int", "bool") else VARIABLE
    if last == "int" and found == "[" and ";" in signs:
        return VARIABLE
    if found in ("=", ":") and {";", "init"} <= signs:
        return initial_value(fault)
    if last == "init" and found in ("=", ":") and before[-3:-2] != [";"]:
        return f"leave out the '{found}'"
    if last == "init" and found == ";" and before[-3:-2] != [";"]:
        return "a value stands behind init: init 0"
    if signs == {":"} and _values(fault.after[:1]) == [":"]:
        if last in ("var", "let", "variable", "local", "private"):
            return f"leave out {last}: {found} : [low..high];"
        return f"a name is one word, such as {last}_{found}"
    if signs == {":"} and found in ("-", ".", "/", "+"):
        return "a name is made of letters, digits and _"
    if found == "," and signs == {":"}:
        return f"each variable has a declaration of its own: {last} : …; …"
    return None


def _in_update(at: _Place) -> str | None:
    """Behind the arrow of a command."""
    fault, source, signs, found, last, before = (
        at.fault,
        at.source,
        at.signs,
        at.found,
        at.last,
        at.before,
    )
    if "->" not in before:
        return None
    if last == "if" or found == "if":
        inside = ")" in signs
        return _CONDITION if inside else _CASES
    if found == ":" and last == ")" and "'" in before and "&" in signs:
        return "the probability comes first: 0.5 : (x'=1)"
    if found in (",", ";") and ")" in signs and "'" in before:
        return _joined_assignments(fault, source)
    if found == "," and (last == ")" or signs == {"&", ";"}):
        others = _values(fault.after[:3])
        if others[:1] == ["("] and others[2:] == ["'"]:
            return "assignments are joined by &: (x'=…) & (y'=…)"
        return _ALTERNATIVES
    if last == "&" and signs == {"("}:
        return "an update has one probability: 0.5 : (x'=…) & (y'=…)"
    if found in ("+", "|", "or") and signs == {"&", ";"}:
        return f"{_ALTERNATIVES}; {_CHOICE}" if _has_choices(source) else _ALTERNATIVES
    if last in (")", "true") and {"+", "&", ";"} == signs - {None} - _OTHER_OPERATORS:
        return _ALTERNATIVES
    if found.isidentifier() and {"(", "true"} <= signs:
        if found.lower() == "true":
            return "did you mean 'true'?"
        return f"an assignment stands in parentheses: ({found}'=…)"
    if (name := _changed(fault)) is not None:
        return f"an assignment is written ({name}'=…)"
    return None


def _statement(at: _Place) -> str | None:
    """Where a variable, a command or the end of a module is expected, or a guard."""
    fault, source, signs, found, last, before = (
        at.fault,
        at.source,
        at.signs,
        at.found,
        at.last,
        at.before,
    )
    words = _statement_words(fault)
    if "endmodule" in signs or signs == {":"}:
        end = found if "endmodule" in signs else last
        if found == last == ";":
            return "leave out the semicolon"
        if found and last == "end":
            return f"write end{found}, one word"
        if end == "}":
            return "a module ends with endmodule, and has no braces"
        if end == "init":
            return "init … endinit stands outside of modules; a variable has init 0 of its own"
        if found[:1].isdigit() and "->" not in words[:2] and last == ";":
            return _ALTERNATIVES
        if source.text.startswith("--", fault.start):
            return "a comment begins with //"
        if found.isdigit() and fault.after and fault.after[0].start_pos == fault.end:
            return "a name begins with a letter or _"
        if "->" in words or {found, last} & {"if", "while", "for", "do"}:
            return _NO_ACTION
        if found == "=" or words[1:2] == ["="] or "'" in words[:3]:
            return "a variable is declared as x : [0..3] init 0; commands change it: [] guard -> …"
        return None
    if before[-2:-1] == ["["] and "]" in signs and found in ("-", ".", "/", "+"):
        return "a name is made of letters, digits and _"
    if before[-2:-1] == ["["] and "]" in signs and found == "(":
        return f"an action is one name: [{last}]"
    if found == ">" and last == "-":
        return "write ->"
    if "->" in signs:
        if found.lower() == "then":
            return "write -> in place of then"
        if last == "if":
            return _CASES if before[-2:-1] == ["]"] else _NO_ACTION
    if last == "if":
        return _NO_ACTION if before[:1] == [";"] and "->" in words else _CONDITION
    return None


def _definition(at: _Place) -> str | None:
    """Outside of modules."""
    fault, signs, found, last, before = at.fault, at.signs, at.found, at.last, at.before
    if before[-2:-1] == ["const"] and last.isidentifier():
        if found.isidentifier() or found == ":":
            return "a constant is of type int, double or bool: const double p = 0.5;"
    if found == "," and "const" in before and ";" in signs:
        return "each constant has a declaration of its own"
    if last == "rewards" and found in ("=", ":"):
        return f"leave out the '{found}': rewards \"name\" … endrewards"
    if found == "{" and (last == "rewards" or before[-2:-1] == ["rewards"]):
        return "rewards end with endrewards, and have no braces"
    if found in (";", "=", "->") and ":" in signs and not {";", "->"} & signs and "?" not in before:
        return "a reward is guard : value; such as true : 1;"
    if found == ";" and "endinit" in signs:
        return "leave out the semicolon: init condition endinit"
    if found == "(" and before[-2:-1] == ["formula"]:
        return "a formula has no parameters: formula name = …;"
    if "module" not in signs:
        return None
    following = _values(fault.after[:2])
    if found == "[":
        return "a command stands in a module: module name … endmodule"
    if found in ("int", "double", "bool"):
        return f"a constant is declared as const {found} …;, a variable as name : [low..high];"
    if found == ";" and (last in TYPE_WORDS or last.startswith("end")):
        return "leave out the semicolon"
    if found.lower() in TYPE_WORDS and not before:
        return f"write {found.lower()}"
    if found.isdigit() and not before:
        return "explicit files are read by -importtrans and -importmodel"
    if not found.isidentifier() or fault.token.type in (FOREIGN, RESERVED):
        return None
    if following[:1] == ["="] or (following[1:] == ["="] and found in ("let", "var", "define")):
        return "a constant is declared as const double p = 0.5; and a formula as formula f = …;"
    if following[:1] == [":"]:
        return "a variable stands in a module, or behind the word global"
    return None


def initial_value(fault: Fault) -> str:
    """A hint at the word init before an initial value, which is the end of the statement."""
    value = "".join(word for word in _values(fault.after) if word not in (";", "="))
    return f"the initial value is written init {value if len(value) < _LONGEST else 0}"


def _has_choices(source: Source) -> bool:
    """Whether the text has the type of a model with choices."""
    return re.search(r"^\s*(mdp|nondeterministic)\b", source.text, re.MULTILINE) is not None


def _values(words: Sequence[Word]) -> list[str]:
    return [str(word.value) for word in words]


def _statement_words(fault: Fault) -> list[str]:
    """The words from the last semicolon to the next one, without these."""
    words = _values((*fault.before, fault.token, *fault.after))
    start = 1 if words[:1] == [";"] else 0
    return words[start:-1] if words[-1:] == [";"] else words[start:]


def _changed(fault: Fault) -> str | None:
    """The name in `x++`, `x--`, `x+=1` or `x'+=1`."""
    words = [*fault.before[-3:], fault.token]
    for one, sign, other in zip(words, words[1:], words[2:], strict=False):
        if one.value.isidentifier() and sign.value in ("+", "-") and other.value in ("+", "-", "="):
            return one.value if sign.end_pos == other.start_pos else None
    if fault.last == "'" and len(fault.before) > 1:
        return str(fault.before[-2].value)
    return None


def _joined_assignments(fault: Fault, source: Source) -> str:
    """A hint at `&` between assignments that stand in the same parentheses."""
    words = [*fault.before, fault.token, *fault.after]
    first = max(i for i, word in enumerate(fault.before) if word.value == "'") - 1
    parts: list[str] = []
    begin, depth = first, 0
    for i in range(first, len(words)):
        sign = words[i].value
        joins = sign in (",", ";", ")") or (sign == "&" and _values(words[i + 2 : i + 3]) == ["'"])
        if joins and not depth:
            parts.append(source.text[words[begin].start_pos : words[i - 1].end_pos])
            begin = i + 1
            if sign == ")":
                break
        depth += (sign == "(") - (sign == ")")
    text = " & ".join(f"({part})" for part in parts)
    if len(parts) < 2 or len(text) > _LONGEST or not all("'" in part for part in parts):
        text = "(x'=…) & (y'=…)"
    return f"assignments are joined by &, each in its own parentheses: {text}"
