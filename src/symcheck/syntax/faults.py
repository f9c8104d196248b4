from __future__ import annotations
from symcheck.errors import Diagnostic, Source, Span
from symcheck.syntax.grammars import Grammar
from symcheck.syntax.lalr import Fault
from symcheck.syntax.lexer import Words

__all__ = ["diagnose"]
def diagnose(fault: Fault, source: Source, grammar: Grammar, words: Words) -> Diagnostic:
    return Diagnostic("unexpected "+source.text[fault.start:fault.end]+" expected "+ " ".join(grammar.terminals[k] for k in fault.expected)+f" {fault.mended}",Span(source,fault.start,fault.end),"syntax")
