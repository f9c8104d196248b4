"""What hints of faults name as the remedy, as edits of the text."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

from symcheck.errors import Diagnostic, Span

__all__ = ["Fix", "quick_fixes"]

Fix = tuple[str, int, int, str]
"""A title, and a piece of the text, by its offsets, with new text for it."""


def quick_fixes(diagnostic: Diagnostic) -> list[Fix]:
    """What the hint of a fault can put right.

    Examples:
        >>> from symcheck.errors import Source
        >>> span = Span(Source("m", "x==1"), 1, 3)
        >>> quick_fixes(Diagnostic("'==' is not an operator", span, hint="equality is written ="))
        [("Change to '='", 1, 3, '=')]
    """
    for form, fixes in _FIXES:
        if found := re.fullmatch(form, diagnostic.hint or ""):
            return list(fixes(diagnostic, found))
    return []


def _changed(span: Span, text: str, start: int | None = None, end: int | None = None) -> Fix:
    """New text for a piece, which is the span if nothing else is said."""
    first, last = span.start if start is None else start, span.end if end is None else end
    if not text.strip():
        return f"Leave out '{span.source.text[first:last].strip()}'", first, last, text
    return f"Change to '{text.strip()}'", first, last, text


def _inserted(text: str, at: int) -> Fix:
    return f"Insert '{text.strip()}'", at, at, text


def _replaced(d: Diagnostic, found: re.Match[str]) -> Iterator[Fix]:
    """What is underlined is wrong as a whole. A word stays apart from those beside it."""
    text, new = d.span.source.text, found[1]
    if new[0].isalnum() and text[: d.span.start][-1:].isalnum():
        new = f" {new}"
    if new[-1].isalnum() and text[d.span.end : d.span.end + 1].isalnum():
        new = f"{new} "
    yield _changed(d.span, new)


def _equals(d: Diagnostic, found: re.Match[str]) -> Iterator[Fix]:
    """`==?` or `:=?`; behind `<=?`, the bound or the question is meant."""
    if d.span.text in ("==", ":="):
        yield _changed(d.span, found[1])


def _left_out(d: Diagnostic, _: re.Match[str]) -> Iterator[Fix]:
    yield _changed(d.span, "")


def _word_left_out(d: Diagnostic, found: re.Match[str]) -> Iterator[Fix]:
    """A word or sign is too much: what is underlined, or what stands before it."""
    text, word = d.span.source.text, {"the comma": ","}.get(found[1], found[1])
    before = text[: d.span.start].rstrip()
    if d.span.text == word:
        yield _changed(d.span, "")
    elif before.endswith(word):
        yield _changed(d.span, "", len(before) - len(word), d.span.start)


def _operator_bounded(d: Diagnostic, found: re.Match[str]) -> Iterator[Fix]:
    """A bound on time has no sign, `F 5 a`, or stands before the operator, `a <=5 U b`."""
    if d.span.text == found[3]:
        yield _inserted("<=", d.span.start)
    elif d.span.text.endswith(found[2]):
        yield _changed(d.span, found[1])


def _multiplied(d: Diagnostic, found: re.Match[str]) -> Iterator[Fix]:
    """A product has no sign: `2x`."""
    yield _inserted("*", d.span.start + len(found[1]))


def _unquoted(d: Diagnostic, found: re.Match[str]) -> Iterator[Fix]:
    if d.span.text == f'"{found[1]}"':
        yield _changed(d.span, found[1])


def _spelled(d: Diagnostic, found: re.Match[str]) -> Iterator[Fix]:
    """A name is wrong: what is underlined, or the part of it that the message ends with."""
    plain = d.span.text.strip('"')
    last = re.search(r"(\w+)\W?$", d.message)
    name = plain if plain.isidentifier() or last is None else last[1]
    if wrong := re.search(rf"\b{re.escape(name)}\b", d.span.text):
        start = d.span.start + wrong.start()
        yield _changed(d.span, found[1], start, start + len(name))


def _primed(d: Diagnostic, found: re.Match[str]) -> Iterator[Fix]:
    if d.code == "prime":
        yield f"Change to {found[1]}'", d.span.end, d.span.end, "'"


def _assigned(d: Diagnostic, _: re.Match[str]) -> Iterator[Fix]:
    """`:=` is a prime and = behind the bracket of an update, elsewhere =."""
    in_update = re.search(r"\(\s*\w+\s*\Z", d.span.source.text[: d.span.start])
    yield _changed(d.span, "'=" if in_update else "=")


def _directed(d: Diagnostic, found: re.Match[str]) -> Iterator[Fix]:
    """The direction of a measure is missing: it follows the letter and the reward structure."""
    if head := re.match(r"[A-Z](\s*\{[^}]*\})?", d.span.text):
        for measure in (found[1], found[2]):
            end = d.span.start + head.end()
            yield f"Change to {measure}=?", end, end, measure[1:]


def _structured(d: Diagnostic, found: re.Match[str]) -> Iterator[Fix]:
    """A measure of rewards has its parts in another order or in other brackets."""
    text = d.span.source.text
    before = re.search(r"\w+\s*\Z", text[: d.span.start])
    after = re.match(r"[\[{][^\]}]*[\]}]\s*(?:min|max)?", text[d.span.start :])
    if before and after:
        yield _changed(d.span, found[1], before.start(), d.span.start + after.end())


def _asked(d: Diagnostic, found: re.Match[str]) -> Iterator[Fix]:
    """The measure before `=?` is wrong: `PMAX=?`."""
    if wrong := re.search(r"\w+(?=\s*=\s*\Z)", d.span.source.text[: d.span.start]):
        yield _changed(d.span, found[1], wrong.start(), wrong.end())


def _joined(d: Diagnostic, found: re.Match[str]) -> Iterator[Fix]:
    """`end module` is one word."""
    if before := re.search(r"end\s*\Z", d.span.source.text[: d.span.start]):
        yield _changed(d.span, found[1], before.start())


def _redeclared(d: Diagnostic, found: re.Match[str]) -> Iterator[Fix]:
    """The declaration of a constant, within which something is underlined, has another type."""
    text, name = d.span.source.text, found[2]
    end = text.find(";", d.span.start)
    before = re.finditer(rf"\bconst\s+(?:(?:int|double|bool)\s+)?{name}\s*=", text[: d.span.end])
    if (starts := [m.start() for m in before]) and end >= 0:
        yield _changed(d.span, found[1], starts[-1], end + 1)


def _bounded(d: Diagnostic, _: re.Match[str]) -> Iterator[Fix]:
    if d.span.text in ("<", ">", ">=", "="):
        yield _changed(d.span, "<=")


def _renaming(d: Diagnostic, found: re.Match[str]) -> Iterator[Fix]:
    """A pair is missing in the renaming of a module, which is underlined."""
    if "]" in d.span.text:
        at = d.span.start + len(d.span.text[: d.span.text.rindex("]")].rstrip())
        yield _inserted(f", {found[1]}", at)


def _unmarked(d: Diagnostic, _: re.Match[str]) -> Iterator[Fix]:
    """A command with <> has [] elsewhere than in Markov automata."""
    if angles := re.match(r"<\s*(\w*)\s*>", d.span.text):
        yield _changed(d.span, f"[{angles[1]}]", end=d.span.start + angles.end())


_FIXES: tuple[tuple[str, Callable[[Diagnostic, re.Match[str]], Iterator[Fix]]], ...] = (
    (r"put '(\w+)' here", lambda d, found: iter([_inserted(f"\n{found[1]}", d.span.end)])),
    (r"put '(.+)' here", lambda d, found: iter([_inserted(found[1], d.span.end)])),
    (r"did you mean '?(\w+)'?\?", _spelled),
    (r"write \((\w+)'=…\)", _primed),
    (r"write true for .*", lambda d, _: iter([_inserted("true ", d.span.start)])),
    (r"write \(x'=…\) & \(y'=…\)", lambda d, _: iter([_inserted("& ", d.span.start)])),
    (r"write 1\.0 or 1", lambda d, _: iter([_inserted("0", d.span.end)])),
    (r"write C<=k", _bounded),
    (r"write (\wmin)=\? or (\wmax)=\?(?:;.*)?", _directed),
    (r"write (\w+)=\?", _asked),
    (r"(?:.*: )?write (const \w+ (\w+) = [^;]*;)(?: or .*)?", _redeclared),
    (r"a value is asked for by (=)\?", _equals),
    (r"write (end\w+), one word", _joined),
    (r"write a( )plain space", _replaced),
    (r"write nothing|leave out the (?:semicolon|'[:=]+').*|leave it out, or .*", _left_out),
    (r"leave out (\w+|the comma)(?::.*)?", _word_left_out),
    (r"write (\S+) in place of \S+", _replaced),
    (r"write (\(\w+'=[^…]*\))", _replaced),
    (r"write init (\S+)", _replaced),
    (r"write (([CFGXUWR])(?:<=?|>=?)(\w+))", _operator_bounded),
    (r"write ([FGX] [FGX])", _replaced),
    (r"write ([\d.eE+-]+)\*(?:\w+|\(…\))", _multiplied),
    (r"write \[low(\.\.)high\]", _replaced),
    (r"write (\w+(?:<|<=|=|>=|>)\w+)", _unquoted),
    (r".*or write \[\] in place of <>", _unmarked),
    (r"an update is written \(x'=…\), a definition =", _assigned),
    (r"the initial value is written (init) .*", _replaced),
    (r".*: (R\{\"\w+\"\}(?:min|max)?)", _structured),
    (r"a reward structure is named in quotes: \{(\"\w+\")\}", _replaced),
    (r"add (\w+=\w+) to the renaming", _renaming),
    (r".*choose another name, such as (\w+)", _replaced),
    (r".*rename it, to (\w+) for example", _replaced),
    (r"(?:write|.* (?:is|are) written) (\"\w+\"|[^\s\w….]+|\w+)(?:;.*)?", _replaced),
)
"""The forms of hints, and what they say is wrong."""
