"""Describes the faults of a text in the words of the language, with a hint at what to do."""

from __future__ import annotations

import re
from collections.abc import Sequence

from symcheck.errors import Diagnostic, Source, Span
from symcheck.syntax.ast import LETTERS, MEASURE_WORDS
from symcheck.syntax.grammars import Language
from symcheck.syntax.hints import meant
from symcheck.syntax.model_hints import COMMAND, VARIABLE, initial_value
from symcheck.syntax.operators import Operator, function_hint
from symcheck.syntax.recovery import FOREIGN, RESERVED, Fault
from symcheck.syntax.words import Word

__all__ = ["diagnose"]


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


_OPERATORS = frozenset(["QMARK", *Operator.__members__])
_STARTS = _set(
    "INTEGER REAL TRUE FALSE NAME STRING FUNCTION MIN MAX FUNC MULTI FILTER LPAR MINUS NOT "
    "P PMIN PMAX PMINMAX PMAXMIN PMINMIN PMAXMAX RELEASE RMIN RMAX RMINMAX RMAXMIN RMINMIN "
    "RMAXMAX S ALL EXISTS"
)
_DECLARATIONS = _set("CONST LABEL FORMULA RATE PROB")
_MODEL_PARTS = _set(
    "MODULE REWARDS PLAYER OBSERVABLE OBSERVABLES GLOBAL INIT SYSTEM "
    "DTMC CTMC MDP PROBABILISTIC STOCHASTIC NONDETERMINISTIC"
)
_BOUNDS = _set("LT LE GT GE EQ")

# A phrase stands for a group of words: it is used if all words of the first set are expected, and
# then replaces those of the second.
_PHRASES = (
    ("a path formula", {"NEXT", "INTEGER"}, _STARTS | {"NEXT", "FINALLY", "GLOBALLY"}),
    ("an expression", {"INTEGER", "LPAR"}, _STARTS),
    ("'U', 'W' or 'R'", {"UNTIL", "WEAK"}, {"UNTIL", "WEAK", "RELEASE"}),
    ("an operator", {"AND", "PLUS"}, _OPERATORS),
    ("an operator", {"AND", "OR"}, _OPERATORS),
    ("a bound", {"LT", "EQ", "LSQB"}, _BOUNDS | {"LSQB", "POWER", "LBRACE"}),
    ("a bound such as =? or >=0.5", {"LT", "EQ"}, _BOUNDS),
    ("'min' or 'max'", {"MINMAX", "MIN"}, _set("MIN MAX MINMAX MAXMIN MINMIN MAXMAX")),
    (
        "a module or another declaration",
        {"MODULE", "CONST", "REWARDS"},
        _DECLARATIONS | _MODEL_PARTS,
    ),
    ("a declaration", {"CONST", "LABEL"}, _DECLARATIONS),
)
_WORDS = {
    "NAME": "a name",
    "STRING": 'a "name" in quotes',
    "INTEGER": "a number",
    "REAL": "a number",
    "$END": "the end of the text",
}
_SIGNS = {
    "≤": "<=",
    "≥": ">=",
    "≠": "!=",
    "∧": "&",
    "∨": "|",
    "¬": "!",
    "~": "! for not, or != for unequal",
    "◇": "F",
    "□": "G",
    "○": "X",
    "∞": "no bound: F x=1 has none",
    "→": "-> before updates, and => for implication",
    "⇒": "=> for implication, and -> before updates",
    "⇔": "<=>",
    "×": "*",
    "·": "*",
    "÷": "/",
    "−": "-",
    "–": "-",
    "—": "-",
    "“": '"',
    "”": '"',
    "„": '"',
    "‘": "'",
    "’": "'",
    "′": "'",
    "´": "'",
    "\u00a0": "a plain space",
    "\u200b": "nothing",
    "\ufeff": "nothing",
}
_PROPERTY_WORDS = MEASURE_WORDS | _set("filter multi multilex quantile E A")
_FOREIGN_OPERATORS = {
    "and": "&",
    "or": "|",
    "not": "!",
    "implies": "=>",
    "iff": "<=>",
    "in": "(x=1 | x=2) for one of several values",
}
_FOREIGN_PATHS = {
    "eventually": "F",
    "finally": "F",
    "always": "G",
    "globally": "G",
    "next": "X",
    "until": "U",
    "unless": "W",
    "release": "R",
    "given": "||",
    "within": "a bound behind the operator: F<=10",
    "GF": "G F",
    "FG": "F G",
    "GG": "G",
    "FF": "F",
}
_MODEL_WORDS = _set("dtmc ctmc mdp module endmodule probabilistic stochastic nondeterministic")
_OTHER_MODELS = {
    "pta": "probabilistic timed automata",
    "popta": "partially observable timed automata",
    "pomdp": "partially observable decision processes",
    "idtmc": "chains with intervals of probabilities",
    "imdp": "decision processes with intervals of probabilities",
    "ipomdp": "partially observable decision processes with intervals",
    "csg": "concurrent stochastic games",
    "tptg": "timed games",
    "lts": "transition systems without probabilities",
    "ma": "Markov automata",
    "stpg": "stochastic games",
    "ta": "timed automata",
    "sta": "stochastic timed automata",
    "fdctmc": "chains with fixed delays",
    "gsmp": "generalised semi-Markov processes",
    "smp": "semi-Markov processes",
    "pdtmc": "chains with parameters",
    "pctmc": "chains with parameters",
    "pmdp": "decision processes with parameters",
}
_OTHER_WORDS = {
    "hole": "holes belong to sketches of models (PAYNT)",
    "evolve": "parts that evolve belong to models of EvoChecker",
    "param": "parameters belong to models of PARAM",
    "parameter": "parameters belong to parametric models",
    "fdelay": "fixed delays belong to chains with fixed delays",
    "event": "events belong to generalised semi-Markov processes",
    "formation": "formations belong to stochastic games",
    "endobservables": "observables belong to partially observable models",
    "observables": "observables belong to partially observable models",
    "observable": "observables belong to partially observable models",
}
_CHOSEN_VALUES = frozenset({"hole", "evolve", "param", "parameter"})
"""The words for constants whose values are sought."""
_PATH_OPERATORS = {
    "X": "next",
    "F": "eventually",
    "G": "always",
    "U": "until",
    "W": "weak until",
    "R": "release",
}
_UNITS = _set("step steps s sec second seconds min minutes h hour hours day days times units")
_QUANTIFIERS = frozenset({"AS", "ES", "A", "E", "forall", "exists", "Forall", "Exists"})
_CLOSERS = {"(": ")", "[": "]", "{": "}"}
_OPENERS = {close: opening for opening, close in _CLOSERS.items()}


def diagnose(fault: Fault, source: Source, language: Language) -> Diagnostic:
    """The diagnostic of one fault."""
    found = fault.token.value
    expected = set(fault.expected)
    if "ENDMODULE" in expected:
        expected.discard("LT")  # of a Markovian command, which stands where [ does
    if found in _MODEL_WORDS and "ENDMODULE" not in language.spelling:
        return Diagnostic(
            "this is a part of a model, where properties are expected",
            _span(source, fault),
            "model",
            "a run has one model: symcheck MODEL PROPERTIES",
        )
    if "MODULE" in expected and (found in _PROPERTY_WORDS or fault.token.type == "STRING"):
        return Diagnostic(
            "this is a property, where a model is expected",
            _span(source, fault),
            "model",
            "a run has a model and properties: symcheck MODEL PROPERTIES; in Python, "
            "model.check_all(path) checks a file of properties",
        )
    if "MODULE" in expected and found == "{" and not fault.before:
        return Diagnostic(
            "this is no model in the PRISM language",
            _span(source, fault),
            "model",
            "the name of a file in the JANI format ends in .jani",
        )
    special = (
        _other_model(fault, source, expected)
        or _lexical(fault, source)
        or _mistake(fault, source, expected)
    )
    if special is not None:
        return special
    if fault.mended is not None:
        if fault.last_but_one == "rewards":
            return _rewards_without_quotes(source, fault)
        if (mistaken := _mistaken_end(fault, source)) is not None:
            return mistaken
        listed = fault.mended == "RPAR" and "COMMA" in expected and found in _PROPERTY_WORDS
        missing = "','" if listed else f"'{language.spelling[fault.mended]}'"
        where = f"before {_found(found)}" if found else "at the end of the text"
        at = max(fault.previous - 1, 0)
        return Diagnostic(
            f"{missing} is missing {where}",
            Span(source, at, at + 1),
            "missing",
            f"put {missing} here",
        )
    message = f"unexpected {_found(found)}; expected {_listed(expected, language)}"
    hint = (
        meant(fault, source, language)
        or _unclosed(fault, source, expected)
        or _keyword(found, expected, language)
        or _not_a_name(found, expected, language)
    )
    if hint is None and "MODULE" in expected and not fault.before:
        hint = "a model begins with its type: dtmc, ctmc or mdp"
    return Diagnostic(message, _span(source, fault), "syntax", hint)


def _mistaken_end(fault: Fault, source: Source) -> Diagnostic | None:
    """What is wrong where a missing word would make the text fit, and is not what is missing."""
    found, span = fault.token.value, _span(source, fault)
    following = [str(word.value) for word in fault.after[1:3]]
    if fault.is_enclosed:
        message = f"a module cannot contain '{found}'"
        return Diagnostic(message, span, "order", "move it out of the module")
    if fault.mended == "COLON" and found == "[" and following == ["]", ":"]:
        message, hint = "there are no arrays", f"declare one variable for each: {fault.last}0 : …;"
        return Diagnostic(message, span, "syntax", hint)
    if fault.mended == "RPAR" and found == ":" and _in_update(fault):
        message = "an update has no parentheses around its probability"
        return Diagnostic(message, span, "update", "write 0.5 : (x'=…) + 0.5 : (x'=…)")
    return None


def _span(source: Source, fault: Fault) -> Span:
    """The span of the word that does not fit, or of the last visible character at the end."""
    if fault.token.value:
        return Span(source, fault.start, fault.end)
    start = max(len(source.text.rstrip()) - 1, 0)
    return Span(source, start, start + 1)


def _found(found: str) -> str:
    if not found:
        return "end of the text"
    return f"'{found}'" if found.isprintable() else repr(found)


def _listed(expected: set[str], language: Language) -> str:
    """The expected words in a list: phrases first, then single words and signs."""
    left = set(expected)
    phrases: list[str] = []
    for phrase, needed, covered in _PHRASES:
        if needed <= left:
            phrases.append(phrase)
            left -= covered
    singles = {
        _WORDS.get(t) or f"'{language.spelling[t]}'"
        for t in left
        if t in _WORDS or t in language.spelling
    }
    # The end of the text may follow every whole property, so it is named only if it is alone.
    everything = [*phrases, *sorted(singles, key=lambda w: (w.startswith("'"), w))]
    if len(everything) > 1 and _WORDS["$END"] in everything:
        everything.remove(_WORDS["$END"])
    if not everything:
        return "something else"
    return (
        everything[0]
        if len(everything) == 1
        else f"{', '.join(everything[:-1])} or {everything[-1]}"
    )


def _keyword(found: str, expected: set[str], language: Language) -> str | None:
    """A hint at an expected keyword that is spelled nearly like the word found."""
    from difflib import get_close_matches

    keywords = [word for t, word in language.spelling.items() if t in expected and word.isalpha()]
    if not found.isidentifier():
        return None
    if found.lower() == "end" and "endmodule" in keywords:
        return "did you mean 'endmodule'?"
    near = get_close_matches(found.lower(), keywords, 1, 0.75)
    return f"did you mean '{near[0]}'?" if near else None


def _not_a_name(found: str, expected: set[str], language: Language) -> str | None:
    """A hint that a name may not be a word of the language, unless the name was forgotten."""
    words = {word for word in language.spelling.values() if word.isidentifier()}
    if expected != {"NAME"} or found not in words or found.startswith("end"):
        return None
    return f"'{found}' is a reserved word: choose another name, such as {found}_"


# --------------------------------------------------------------------------------- typical mistakes


def _other_model(fault: Fault, source: Source, expected: set[str]) -> Diagnostic | None:
    """Model types of other tools, and the words and signs that only these models have."""
    word, span = source.text[fault.start : fault.end], _span(source, fault)
    hint = "dtmc, ctmc and mdp are"
    if word in _OTHER_MODELS and (fault.token.type == RESERVED or "MODULE" in expected):
        return Diagnostic(
            f"models of type {word} ({_OTHER_MODELS[word]}) are not supported",
            span,
            "model-type",
            hint,
        )
    if word in _OTHER_WORDS and (
        fault.token.type == RESERVED or "MODULE" in expected or "ENDMODULE" in expected
    ):
        if word in _CHOSEN_VALUES:
            hint = (
                "a parameter is a constant that is left open: const double p; and -param p=0.1:0.9"
            )
        return Diagnostic(
            f"{_OTHER_WORDS[word]}, which are not supported", span, "model-type", hint
        )
    rest = source.text[fault.start :]
    if word == "<" and rest.startswith("<<") and "INTEGER" in expected:
        return Diagnostic(
            "this is no coalition",
            Span(source, fault.start, fault.start + 2),
            "model-type",
            "of an MDP, <<*>> is some strategy and <<>> are all strategies",
        )
    if (quantified := _quantified(fault)) is not None:
        return Diagnostic(
            "hyperproperties (HyperPCTL) quantify strategies and states, and are not supported",
            Span(source, quantified.start_pos, fault.end),
            "model-type",
            f"properties of {', '.join(LETTERS)}, A and E are, one path at a time",
        )
    return None


def _quantified(fault: Fault) -> Word | None:
    """The quantifier of `AS sigma . …` or `forall s : …` whose sign is the fault."""
    words = fault.before[-2:]
    if len(words) < 2 or fault.token.value not in (".", ":", "("):
        return None
    quantifier, name = words
    if quantifier.value not in _QUANTIFIERS or not str(name.value).isidentifier():
        return None
    return quantifier if fault.token.value != "(" or quantifier.value in ("AS", "ES") else None


def _lexical(fault: Fault, source: Source) -> Diagnostic | None:
    """Characters that start no word, and reserved words."""
    text, start = source.text, fault.start
    if fault.token.type == RESERVED:
        word, span = text[start : fault.end], _span(source, fault)
        if word == "init" and "INTEGER" in fault.expected:
            hint = 'the label is written "init"'
            return Diagnostic("'init' is a reserved word", span, "reserved", hint)
        return _reserved(word, span)
    if fault.token.type != FOREIGN:
        return None
    character = text[start]
    span = Span(source, start, fault.end)
    if character in _SIGNS:
        return Diagnostic(
            f"'{character}' is not a sign of the language",
            span,
            "character",
            f"write {_SIGNS[character]}",
        )
    if character == '"':
        line = text[start:].split("\n", 1)[0]
        if '"' not in line[1:]:
            span = Span(source, start, start + len(line.rstrip()))
            return Diagnostic(
                "this quote is not closed", span, "quote", 'close it on this line: "name"'
            )
        inner = Span(source, start, start + line.index('"', 1) + 1)
        quoted = inner.text[1:-1].strip()
        if re.search(r"[=<>&|!]", quoted):
            return Diagnostic("a condition has no quotes", inner, "quote", f"write {quoted}")
        name = re.sub(r"\W+", "_", quoted, flags=re.ASCII).strip("_")
        return Diagnostic(
            "a quoted name is made of letters, digits and _",
            inner,
            "quote",
            f'write "{name}"' if name[:1].isalpha() else "it starts with a letter or _",
        )
    if character == "#" and not re.match(_PREPROCESSOR, text[start:]):
        return Diagnostic("'#' begins no comment", span, "character", "a comment begins with //")
    if character == "#":
        return Diagnostic(
            "preprocessor text cannot be read",
            span,
            "character",
            "write out what the preprocessor would make of it",
        )
    if character == "%" and not text[text.rfind("\n", 0, start) + 1 : start].strip():
        return Diagnostic("'%' begins no comment", span, "character", "a comment begins with //")
    if character == "%" and re.match(r"%[ \t]*[\w(]", text[start:]):
        hint = "the remainder of x by 2 is written mod(x, 2)"
        return Diagnostic("'%' is no operator of the language", span, "character", hint)
    if character == "%":
        message = "there is no sign of per cent"
        return Diagnostic(message, span, "character", "a probability is from 0 to 1: 50% is 0.5")
    if character == "." and fault.last.isidentifier() and fault.previous == start:
        message, hint = "a name has no point", "a variable has the same name in all modules"
        return Diagnostic(message, span, "character", hint)
    if text.startswith("..", start):
        message, hint = "'..' has no place here", "an interval of time is [low,high]"
        return Diagnostic(message, span, "character", hint)
    if character == "." and fault.last[-1:].isdigit():
        return Diagnostic("a number does not end with a point", span, "number", "write 1.0 or 1")
    name = repr(character) if not character.isprintable() else f"'{character}'"
    if character == "@" and not text[:start].strip():
        message = "this is no model in the PRISM language"
        return Diagnostic(
            message, span, "model", "the name of a file in the DRN format ends in .drn"
        )
    if character == "'":
        return _prime(fault, source)
    plain = "names are made of plain letters, digits and _" if character.isalpha() else None
    return Diagnostic(
        f"{name} (U+{ord(character):04X}) has no place in the language", span, "character", plain
    )


def _reserved(word: str, span: Span) -> Diagnostic:
    before, rest = span.source.text[: span.start], span.source.text[span.end :]
    if word in ("int", "bool", "double") and re.match(r"\s+\w+\s*[:;=\[,]", rest):
        if before.rstrip().endswith("formula"):
            message, hint = "a formula has no type", "its expression tells: formula name = …;"
            return Diagnostic(message, span, "reserved", hint)
        message = f"'{word}' does not begin the declaration of a variable"
        return Diagnostic(message, span, "reserved", VARIABLE)
    hint = f"choose another name, such as {word}_"
    if word in ("min", "max") and re.search(r"R\s*{\s*$", before):
        hint = f"write R{word}=?"
    elif word == "rate" and (value := re.match(r"\s*\(([^()]+)\)", rest)):
        hint = f"write the rate alone: {value[1]} : …"
    return Diagnostic(f"'{word}' is a reserved word", span, "reserved", hint)


def _mistake(fault: Fault, source: Source, expected: set[str]) -> Diagnostic | None:
    """Frequent mistakes that the words around the fault tell apart."""
    text, start = source.text, fault.start
    glued = fault.previous == start
    two = text[start : start + 2]
    around = text[start - 1 : start + 1] if glued else ""

    def wrong(message: str, hint: str, length: int = 1, at: int = start) -> Diagnostic:
        return Diagnostic(message, Span(source, at, at + length), "syntax", hint)

    if around == "=<":
        return wrong("'=<' is no comparison", "at most is written <=", 2, start - 1)
    if around == "<>" and _ends_operand(fault.before[:-1]):
        return wrong("'<>' is no comparison", "different is written !=", 2, start - 1)
    if two == ":=" or around == ":=":
        at = start if two == ":=" else start - 1
        if text.startswith(":=?", at):
            return wrong("':=' begins no bound", "a value is asked for by =?", 2, at)
        if {"INIT", "SEMICOLON"} <= expected:
            return wrong("':=' gives no value", initial_value(fault), 2, at)
        if fault.last == "init":
            return wrong("':=' gives no value", "leave out the ':='", 2, at)
        return wrong("':=' is no assignment", "an update is written (x'=…), a definition =", 2, at)
    if around in ("[]", "<>") and fault.last_but_one not in _PATH_OPERATORS:
        pass  # empty brackets of another kind
    elif glued and text[start - 1 : start + 1] in _DOUBLED:
        message, hint = _DOUBLED[text[start - 1 : start + 1]]
        hint = "a value is asked for by =?" if text[start:].startswith("=?") else hint
        return wrong(message, hint, 2, start - 1)
    for word, at in ((fault.token.value, start), (fault.last, fault.previous - len(fault.last))):
        if word.lower() == "or" and "SEMICOLON" in expected and "OR" not in expected:
            continue  # between updates
        if word in _UNITS and _ends_bound(fault.before if at == start else fault.before[:-1]):
            return wrong("a bound has no unit", f"leave out {word}", len(word), at)
        if word.lower() in _FOREIGN_OPERATORS:
            hint = f"write {_FOREIGN_OPERATORS[word.lower()]}"
            return wrong(f"'{word}' is no operator of the language", hint, len(word), at)
        path = _FOREIGN_PATHS.get(word) or _FOREIGN_PATHS.get(word.lower())
        if path is not None and _inside_path(fault.before):
            hint = f"write {path}"
            return wrong(f"'{word}' is no operator of paths", hint, len(word), at)
    if glued and "TIMES" in expected and fault.before[-1].type in ("INTEGER", "REAL"):
        name = fault.token.value
        is_name = fault.token.type == "NAME" and name != "mod" and fault.last != "0"
        if is_name or (name == "(" and fault.mended is None):
            factor = name if is_name else "(…)"
            at, hint = fault.previous - len(fault.last), f"write {fault.last}*{factor}"
            length = len(fault.last) + len(name)
            return wrong(f"'*' is missing before '{name}'", hint, length, at)
    if fault.token.type in _BOUNDS and "NEXT" in expected and len(fault.after) > 1:
        bound, operator = fault.after[:2]
        if operator.value in ("F", "G", "X"):
            hint = f"write {operator.value}{fault.token.value}{bound.value}"
            length = operator.end_pos - start
            return wrong("a bound stands behind its operator", hint, length)
    if _inside_path(fault.before) and fault.last.isdigit() and "RSQB" in expected:
        words = [str(word.value) for word in fault.before[-2:]]
        if words[0] in ("F", "G", "U", "W"):
            at = fault.previous - len(words[1])
            return wrong("a bound has a sign", f"write {words[0]}<={words[1]}", len(words[1]), at)
    if fault.token.value == "mod" and fault.last.isalnum() and fault.after:
        parts = f"{fault.last}, {fault.after[0].value}"
        return wrong("'mod' is no operator", f"the remainder is written mod({parts})", 3)
    if around == "**" or (two == "**" and glued):
        return wrong(
            "'**' is no operator", "a power is written pow(x, 2)", 2, start - (two != "**")
        )
    if two in ("[]", "<>") and "NEXT" in expected:
        return wrong(*_DOUBLED[two], 2)
    if two in ("||", "/*"):
        return wrong(*_DOUBLED[two], 2)
    if two == "->":
        if fault.last == "]" and "INTEGER" in expected:
            hint = "write true for a command that is always enabled"
            return wrong("the guard is missing before '->'", hint, 2)
        if fault.last == "-" and glued:
            return wrong("'-->' is no arrow", "write ->", 3, start - 1)
        if "INTEGER" in expected:
            return wrong("an expression is missing before '->'", COMMAND, 2)
        if "RPAR" not in expected and "ENDMODULE" not in expected and expected != {"EQ"}:
            rewards = any(word.value == "rewards" for word in fault.before)
            hint = "a reward is guard : value;" if rewards else "implication is written =>"
            if _in_update(fault):
                hint = "a probability stands before ':', as in 0.5 : (x'=1)"
            return wrong("'->' has no place here", hint, 2)
    if two[:1] == "'" and "ENDMODULE" not in expected and expected != {"COLON"}:
        return _prime(fault, source)
    if two[:1] == "=" and glued and text[start - 1 : start] in ("<", ">"):
        return wrong("this is no comparison", "comparisons are < <= > >= = !=")
    return _misplaced(fault, source, expected)


def _ends_bound(words: Sequence[Word]) -> bool:
    """Whether the words end with the bound of an operator: `F<=2`."""
    operator, sign, bound = ("", "", "", *(str(word.value) for word in words))[-3:]
    return operator in (*_PATH_OPERATORS, "C") and sign in ("<", "<=") and bound[-1:].isdigit()


def _prime(fault: Fault, source: Source) -> Diagnostic:
    """A prime that is not behind the name of an update."""
    text, start, words = source.text, fault.start, fault.before
    span = Span(source, start, start + 1)
    quoted = re.match(r"'(\w+)'", text[start:])
    if quoted and (fault.previous < start or not fault.last.isidentifier()):
        span = Span(source, start, start + quoted.end())
        hint = f'write "{quoted[1]}"'
        return Diagnostic("a name stands in double quotes", span, "quote", hint)
    if _in_command(fault) and not _has(fault.after, "->"):
        arrows = [word for word in words if word.value == "=>"]
        if arrows:
            span = Span(source, arrows[-1].start_pos, arrows[-1].end_pos)
            message = "'=>' is implication, and no arrow of a command"
            return Diagnostic(message, span, "syntax", COMMAND)
        message = "'->' is missing between the guard and the updates"
        return Diagnostic(message, span, "syntax", COMMAND)
    if _in_update(fault) and fault.last.isidentifier() and len(words) > 3:
        signs = [str(word.value) for word in words[-4:-1]]
        if signs[-1] != "(":
            message, hint = "an assignment stands in parentheses", f"write ({fault.last}'=…)"
            return Diagnostic(message, span, "syntax", hint)
        if signs[1] == "*":
            span = Span(source, words[-3].start_pos, words[-3].end_pos)
            message, hint = "a probability stands before ':'", f"write 0.5 : ({fault.last}'=…)"
            return Diagnostic(message, span, "syntax", hint)
        if signs[:2] in ([")", "+"], ["true", "+"]):
            span = Span(source, words[-2].start_pos, fault.end)
            message = "the probability of this update is missing"
            return Diagnostic(message, span, "probability", f"write 0.5 : ({fault.last}'=…)")
    if _in_update(fault) and fault.last in ("(", "->", ":", "&"):
        name = str(fault.after[0].value) if fault.after else "x"
        return Diagnostic("a prime stands behind a name", span, "syntax", f"write ({name}'=…)")
    message = "a prime belongs to the left side of an update only"
    hint = "write (x'=…) in an update, and x without prime elsewhere"
    return Diagnostic(message, span, "syntax", hint)


def _misplaced(fault: Fault, source: Source, expected: set[str]) -> Diagnostic | None:
    """Words that are right in another place."""
    text, start, end = source.text, fault.start, fault.end
    found, before = text[start:end], text[: fault.previous]
    span = Span(source, start, end)
    if "'" in text[fault.previous : start]:
        return None
    last = fault.last
    if (operator := _operator_as_name(fault, found)) is not None:
        name = str(operator.value)
        return Diagnostic(
            f"{name} is the operator '{_PATH_OPERATORS[name]}' of paths here, and no name",
            Span(source, operator.start_pos, operator.end_pos),
            "path",
            f"X, F, G, U, W and R are no names in properties: rename it, to {name}_ for example",
        )
    if (opening := _interval_bracket(fault, found)) is not None:
        at = opening.start_pos
        letter = text[:at].rstrip()[-1:]
        return Diagnostic(
            "an interval of time stands in square brackets",
            Span(source, at, end),
            "bound",
            f"write {letter}[low,high], or {letter}<=high",
        )
    if found in ("C", "I") and "NEXT" not in expected and "INTEGER" in expected:
        hint = "write R=? [ C<=k ] for the reward up to k, R=? [ I=k ] for that at k"
        return Diagnostic(f"{found} stands in the brackets of R only", span, "reward", hint)
    if found in ("X", "F", "G") and "INTEGER" in expected and "NEXT" not in expected:
        steady = [word.value for word in fault.before[-4:]] == ["S", "=", "?", "["]
        hint = (
            "S=? [ … ] has a condition on states: leave the operator out"
            if steady
            else f"put it in parentheses: ({found} …)"
            if _inside_path(fault.before)
            else f"write P=? [ {found} … ]"
        )
        return Diagnostic(f"the path operator {found} cannot stand here", span, "path", hint)
    if found in ("U", "W") and "INTEGER" in expected and "AND" in expected:
        message = f"the path operator {found} cannot stand here"
        return Diagnostic(message, span, "path", f"write P=? [ … {found} … ]")
    if found in _CLOSERS.values() and _open_bracket(fault.before, _OPENERS[found]) is None:
        return Diagnostic(
            f"this '{found}' closes nothing",
            span,
            "bracket",
            f"leave it out, or put '{_OPENERS[found]}' where it belongs",
        )
    if last == "=" and "QMARK" in expected and len(expected) == 1:
        hint = "an exact bound is not meaningful; compare with <, <=, > or >="
        measure = fault.last_but_one
        if found in ("min", "max"):
            hint = f"write {measure}{found}=? [ … ]"
        elif found == "[":
            hint = f"write {measure}=? [ … ]"
        return Diagnostic(
            f"unexpected {_found(found)} after '='; expected '?'", span, "bound", hint
        )
    if last == "C" and "LE" in expected and found in ("<", ">", ">=", "=", "["):
        return Diagnostic("C takes a bound of the form C<=k only", span, "bound", "write C<=k")
    if (
        found in ("U", "W", "R")
        and "UNTIL" not in expected
        and "AND" in expected
        and _inside_path(fault.before)
    ):
        hint = f"put what belongs together in parentheses: (… {found} …)"
        return Diagnostic(f"the path operator {found} cannot stand here", span, "path", hint)
    if expected == {"QUOTE"} and last.isidentifier():
        named = _last_span(source, fault)
        return Diagnostic(
            f"the prime is missing in the update of {last}", named, "prime", f"write ({last}'=…)"
        )
    if expected == {"LPAR"} and last in ("min", "max") and found in _LETTERS_WITH_DIRECTION:
        message = f"'{last}' stands behind {found}"
        return Diagnostic(message, _last_span(source, fault), "syntax", f"write {found}{last}=?")
    if expected == {"LPAR"} and last in ("min", "max"):
        return _reserved(last, _last_span(source, fault))
    if found in (";", "+") and "COLON" in expected and _in_update(fault):
        return _no_update(source, fault, span)
    if last == "->" and "INTEGER" in expected:
        if found in _KEYWORD_NAMES:
            return _reserved(found, span)
        return Diagnostic(f"an update is missing before {_found(found)}", span, "update", _UPDATE)
    if (
        found == "("
        and "SEMICOLON" in expected
        and last == ")"
        and "AND" in expected
        and "OR" not in expected
    ):
        return Diagnostic(
            "'&' is missing between two assignments", span, "update", "write (x'=…) & (y'=…)"
        )
    if found in (":", "(") and "ARROW" in expected and not last.isidentifier():
        return Diagnostic(
            "'->' is missing between the guard and the updates", span, "arrow", COMMAND
        )
    if (
        fault.token.type not in (FOREIGN, RESERVED)
        and found.isidentifier()
        and expected == {"LSQB", "ENDMODULE"}
        and [token.value for token in fault.after[:1]] == [":"]
    ):
        return Diagnostic(
            "a variable is declared behind a command",
            span,
            "order",
            "declare the variables of a module before its commands",
        )
    if (
        found == "("
        and last.isidentifier()
        and before.endswith(last)
        and "LPAR" not in expected
        and "AND" in expected
    ):
        named = _last_span(source, fault)
        return Diagnostic(
            f"there is no function '{last}'",
            named,
            "function",
            function_hint(last),
        )
    if found == "init" and "ENDMODULE" in expected:
        message = "init … endinit stands outside of modules"
        hint = "one variable is given its initial value as x : [0..3] init 0;"
        return Diagnostic(message, span, "order", hint)
    if last == "(" and fault.last_but_one == "filter" and found in _PROPERTY_WORDS:
        hint = "filter(max, P=? [ … ])"
        return Diagnostic("the kind of the filter comes first", span, "filter", hint)
    if (
        found.isidentifier()
        and fault.token.type not in (FOREIGN, RESERVED)
        and "NAME" in expected
        and "INTEGER" not in expected
        and found in _KEYWORD_NAMES
    ):
        return _reserved(found, span)
    if (
        found
        and found[0].isalpha()
        and "STRING" in expected
        and last in ("label", "rewards")
        and "INTEGER" not in expected
    ):
        return Diagnostic(
            f"the name of this {last} needs quotes", span, "quotes", f'write "{found}"'
        )
    if fault.last_but_one == "rewards" and last.isidentifier():
        return _rewards_without_quotes(source, fault)
    if fault.token.type == "STRING" and "NAME" in expected and "INTEGER" not in expected:
        message, hint = "this name has no quotes", "write " + found.strip('" \t')
        return Diagnostic(message, span, "quotes", hint)
    if (
        "EQ" in expected <= {"EQ", "SEMICOLON"}
        and fault.last_but_one in _NAMED
        and (found[:1].isalnum() or found in ('"', "(", "!", "-"))
        and not (found == "(" and fault.last_but_one == "formula")
        and not (fault.last_but_one == "const" and found.isidentifier())
    ):
        place = Span(source, fault.previous - 1, fault.previous)
        message = f"'=' is missing before {_found(found)}"
        return Diagnostic(message, place, "missing", "put '=' here")
    if last.isidentifier() and (ending := _ending_meant(fault, expected)) is not None:
        named = _last_span(source, fault)
        return Diagnostic(f"unexpected '{last}'", named, "syntax", f"did you mean '{ending}'?")
    return None


def _ending_meant(fault: Fault, expected: set[str]) -> str | None:
    """The end of a block that was read as the name of a variable, or as the guard of a reward."""
    from difflib import get_close_matches

    if fault.last_but_one not in ("", ";") and expected != {"COLON"}:
        return None
    end = "endmodule" if expected == {"COLON"} else "endrewards"
    is_end = "COLON" in expected and get_close_matches(fault.last.lower(), [end], 1, 0.75)
    return end if is_end and fault.last.lower().startswith("end") else None


def _rewards_without_quotes(source: Source, fault: Fault) -> Diagnostic:
    message = "the name of these rewards needs quotes"
    return Diagnostic(message, _last_span(source, fault), "quotes", f'write "{fault.last}"')


def _operator_as_name(fault: Fault, found: str) -> Word | None:
    """X, F or G that is compared with a number, and followed by no path: `(X = 2)`.

    Its comparison was read as a bound, so that a path is expected behind it. Or it stands where no
    path can.
    """
    if found in ("X", "F", "G"):
        return fault.token if [word.value for word in fault.after[:1]] in (["="], ["!="]) else None
    if found not in (")", "&", "|", "]", "=>", "") or "NEXT" not in fault.expected:
        return None
    words = fault.before
    start = len(words)
    while start and words[start - 1].value not in ("(", "[", "&", "|", "=>", "!", ";"):
        start -= 1
    word, sign = (*(str(w.value) for w in words[start : start + 2]), "", "")[:2]
    if sign == "=" and word in ("X", "F", "G"):
        return words[start]
    return words[start] if word == "X" and sign in ("<", "<=", ">", ">=") else None


def _interval_bracket(fault: Fault, found: str) -> Word | None:
    """The bracket of an interval with the wrong brackets: `F(1,2]`, `F[1,2)`, `F{1,2}`."""
    i = _open_bracket(fault.before)
    if i is None or i == 0 or fault.before[i - 1].value not in ("X", "F", "G", "U", "W", "R"):
        return None
    opening = str(fault.before[i].value)
    inside = [word.value for word in fault.before[i + 1 :]]
    wrong = found == "," if opening != "[" else found in (")", "}") and "," in inside
    wrong = wrong and not _BOUNDS & {word.type for word in fault.before[i + 1 :]}
    return fault.before[i] if wrong else None


def _ends_operand(words: Sequence[Word]) -> bool:
    """Whether the words end with a name, a number or a closing bracket."""
    last = str(words[-1].value) if words else ""
    return last in (")", "]") or last[-1:].isalnum()


def _last_span(source: Source, fault: Fault) -> Span:
    """The word before the fault."""
    return Span(source, fault.before[-1].start_pos, fault.previous)


def _no_update(source: Source, fault: Fault, span: Span) -> Diagnostic:
    """The diagnostic of an update without an assignment; perhaps its prime was forgotten."""
    words = fault.before
    if fault.last.lower() == "true":
        message = f"unexpected '{fault.last}'"
        return Diagnostic(message, _last_span(source, fault), "update", "did you mean 'true'?")
    for i in range(len(words) - 1, 1, -1):
        if words[i].value in ("->", ";"):
            break
        name = words[i - 1].value
        if words[i].value == "=" and words[i - 2].value == "->" and name.isidentifier():
            where = Span(source, words[i - 1].start_pos, fault.previous)
            value = source.text[words[i].end_pos : fault.previous].strip()
            message = f"the prime and the parentheses are missing in the update of {name}"
            several = any(w.value in ("&", ",") for w in words[i + 1 :])
            written = "(x'=…) & (y'=…)" if several else f"({name}'={value})"
            return Diagnostic(message, where, "prime", f"write {written}")
        if words[i].value == "=" and words[i - 2].value == "(" and name.isidentifier():
            where = Span(source, words[i - 1].start_pos, words[i - 1].end_pos)
            return Diagnostic(
                f"the prime is missing in the update of {name}",
                where,
                "prime",
                f"write ({name}'=…)",
            )
    return Diagnostic("this command does not say what changes", span, "update", _UPDATE)


_DOUBLED = {
    "==": ("'==' is not an operator", "equality is written ="),
    "&&": ("'&&' is not an operator", "and is written &"),
    "||": ("'||' is not an operator of expressions", "or is written |"),
    "->": ("'->' is not an operator of properties", "implication is written =>"),
    "[]": ("'[]' is not an operator of paths", "always is written G"),
    "<>": ("'<>' is not an operator of paths", "eventually is written F"),
    "/*": ("this comment cannot be read", "comments start with // and end with the line"),
}
_NAMED = _set("const int double bool formula") | {"label", "rate", "prob"}
_LETTERS_WITH_DIRECTION = _set("P R S T")
_PREPROCESSOR = r"#(define|include|undef|ifn?def|if|else|endif|const|for|end|[-+&|*]|\w+#)"
_UPDATE = "an update is true, (x'=…), or probability : (x'=…)"
_STATE_OPERATORS = MEASURE_WORDS | _set("A E")
_KEYWORD_NAMES = _set(
    "A bool C double E false F filter func G I int max min P Pmax Pmin prob R rate Rmax Rmin S "
    "true U W X minmax maxmin minmin maxmax dtmc ctmc mdp system init"
)


def _inside_path(words: Sequence[Word]) -> bool:
    """Whether these words end within the brackets of an operator that holds a path."""
    i = _open_bracket(words, "[")
    if i is None:
        return False
    for word in reversed(words[:i]):
        if word.value in _STATE_OPERATORS:
            return str(word.value)[0] != "S"
        if word.value in (";", "]"):
            return False
    return False


def _open_bracket(words: Sequence[Word], sign: str | None = None) -> int | None:
    """The index of the last bracket (of the kind `sign`) since the last semicolon that is open."""
    closed = 0
    for i in range(len(words) - 1, -1, -1):
        word = words[i].value
        if word == ";":
            return None
        if word in _OPENERS:
            closed += 1
        elif word in _CLOSERS:
            if not closed and sign in (None, word):
                return i
            closed = max(closed - 1, 0)
    return None


def _in_command(fault: Fault) -> bool:
    """Whether the fault is in a command before its arrow."""
    words = [word for word in fault.before if word.value != ";"]
    return bool(words) and words[0].value == "[" and not _has(words, "->")


def _in_update(fault: Fault) -> bool:
    """Whether the fault is behind the arrow of a command."""
    return _has(fault.before, "->")


def _has(words: Sequence[Word], sign: str) -> bool:
    return any(str(word.value) == sign for word in words)


def _unclosed(fault: Fault, source: Source, expected: set[str]) -> str | None:
    """A hint at the last bracket that is open where its closing one could stand."""
    if not expected & {"RPAR", "RSQB", "RBRACE"}:
        return None
    i = _open_bracket(fault.before)
    if i is None:
        return None
    line, column = source.position(fault.before[i].start_pos)
    return f"the '{fault.before[i].value}' at {line}:{column} is still open"
