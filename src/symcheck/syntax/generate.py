"""Writes `symcheck.syntax.tables` from the grammar files: `python -m symcheck.syntax.generate`. Needs Lark."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from lark import Lark
from lark.grammar import Rule as LarkRule
from lark.lexer import PatternStr

from symcheck.syntax.grammars import Packed, read

__all__ = ["generate", "main", "pack"]

_STARTS = {"prism": ["program", "expression"], "properties": ["properties", "state"]}
_WIDTH = 139


def pack(name: str) -> Packed:
    """The tables of one grammar, from its text."""
    lark = Lark(
        read(f"{name}.lark"),
        parser="lalr",
        lexer="basic",
        start=_STARTS[name],
        maybe_placeholders=True,
    )
    definitions = sorted(
        (t for t in lark.terminals if t.name not in ("SPACE", "COMMENT")),
        key=lambda t: (-t.priority, t.name),
    )
    terminals = (*(t.name for t in definitions), "$END")
    kinds = {t: i for i, t in enumerate(terminals)}
    literals = tuple(
        (t.pattern.value, kinds[t.name]) for t in definitions if isinstance(t.pattern, PatternStr)
    )
    patterns = tuple(
        (kinds[t.name], t.pattern.value)
        for t in definitions
        if not isinstance(t.pattern, PatternStr)
    )
    rules = lark.rules
    number = {rule: i for i, rule in enumerate(rules)}
    table: Any = lark.parser.parser._parse_table
    order = _order(table, _STARTS[name])
    new = {state: i for i, state in enumerate(order)}
    rows: list[tuple[int, ...]] = []
    row_of, gotos = [], []
    for state in order:
        row: list[int] = []
        goto: list[str | int] = []
        for symbol, (action, argument) in sorted(
            table.states[state].items(), key=lambda item: str(item[0])
        ):
            if symbol not in kinds:
                goto += [str(symbol), new[argument]]
            else:
                row += [
                    kinds[symbol],
                    new[argument]
                    if str(action) == "Shift"
                    else ~number.setdefault(argument, len(number)),
                ]
        if tuple(row) not in rows:
            rows.append(tuple(row))
        row_of.append(rows.index(tuple(row)))
        gotos.append(tuple(goto))
    starts = tuple((s, new[table.start_states[s]], new[table.end_states[s]]) for s in _STARTS[name])
    shapes = tuple(_describe(rule) for rule in number)
    return terminals, literals, patterns, shapes, tuple(rows), tuple(row_of), tuple(gotos), starts


def _order(table: Any, starts: list[str]) -> list[int]:
    """The states, breadth first: Lark's own numbers differ from run to run."""
    order = [table.start_states[s] for s in starts]
    for state in order:
        entries = sorted(table.states[state].items(), key=lambda item: str(item[0]))
        shifts = dict.fromkeys(
            argument for _, (action, argument) in entries if str(action) == "Shift"
        )
        order += [s for s in shifts if s not in order]
    return order


def _describe(rule: LarkRule) -> tuple[str, int, str | None, tuple[int | None, ...]]:
    """One rule as `symcheck.syntax.grammars.Rule` has it; keeps and inlines what Lark would keep and inline in a tree."""
    options: Any = rule.options
    origin = str(rule.origin.name)
    gaps = (
        [len(ones) for ones in "".join(str(int(b)) for b in options.empty_indices).split("0")]
        if options.empty_indices
        else []
    )
    shape: list[int | None] = []
    for i, symbol in enumerate(rule.expansion):
        shape += [None] * (gaps[i] if gaps else 0)
        if not symbol.is_term:
            shape.append(~i if symbol.name.startswith("_") else i)
        elif not symbol.filter_out:  # type: ignore[attr-defined]
            shape.append(i)
    shape += [None] * (gaps[len(rule.expansion)] if gaps else 0)
    action: str | None = str(rule.alias or options.template_source or origin)
    if origin.startswith("_"):
        action = ""
    elif (
        options.expand1
        and not rule.alias
        and len(shape) == 1
        and shape[0] is not None
        and shape[0] >= 0
    ):
        action = None
    return origin, len(rule.expansion), action, tuple(shape)


def generate() -> str:
    """The text of `symcheck.syntax.tables`: JSON in strings, which start faster than Python literals when nothing is compiled yet."""
    lines = [
        '"""LALR tables of the grammars. Written by `python -m symcheck.syntax.generate`; not for editing."""',
        "",
        "from __future__ import annotations",
        "",
        '__all__ = ["PRISM", "PROPERTIES"]',
    ]
    for name in _STARTS:
        text = json.dumps(pack(name), separators=(",", ":"), ensure_ascii=True)
        chunks = [text[i : i + _WIDTH] for i in range(0, len(text), _WIDTH)]
        lines += ["", f'{name.upper()} = r"""', *chunks, '"""']
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the tables beside this file."""
    Path(__file__).with_name("tables.py").write_text(generate(), encoding="utf-8")


if __name__ == "__main__":
    main()
