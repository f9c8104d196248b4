"""Module renaming: modules that are copies of other modules with new names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from symcheck.errors import Span
from symcheck.semantics.diagnostics import Report, suggest
from symcheck.syntax.declarations import Module, Program, RenamedModule

__all__ = ["Copy", "copies"]


@dataclass(frozen=True, slots=True)
class Copy:
    """A module to be bound: the declaration of its base module, and the renaming of its names."""

    name: str
    text: Module
    renaming: Mapping[str, str] = field(default_factory=dict)
    span: Span = field(kw_only=True)


def copies(program: Program, report: Report) -> tuple[Copy, ...]:
    """All modules of a program, in order; a faulty module is reported and omitted.

    A copy of a copy is renamed by the composition of both renamings.
    """
    named: dict[str, Module | RenamedModule] = {}
    for module in program.modules:
        if module.name in named:
            report.name("duplicate-module", f"there is a module {module.name} already", module.span)
        named.setdefault(module.name, module)
    found = (_copy(m, named, report) for m in named.values())
    return tuple(c for c in found if c is not None)


def _copy(
    module: Module | RenamedModule, named: Mapping[str, Module | RenamedModule], report: Report
) -> Copy | None:
    renaming: dict[str, str] = {}
    base, seen = module, [module.name]
    while isinstance(base, RenamedModule):
        # Compose the renaming of the base with the renamings that are applied after it.
        step = _step(base, report if base is module else Report())
        renaming = {old: renaming.get(new, new) for old, new in step.items()} | {
            o: n for o, n in renaming.items() if o not in step
        }
        if base.base in seen:
            report.name(
                "cycle",
                f"module {module.name} is a copy of itself: {' -> '.join([*seen, base.base])}",
                module.span,
            )
            return None
        if base.base not in named:
            if base is module:
                report.name(
                    "unknown-module",
                    f"unknown module {base.base}",
                    base.span,
                    suggest(base.base, named),
                )
            return None
        seen.append(base.base)
        base = named[base.base]
    copy = Copy(module.name, base, renaming, span=module.span)
    return copy if _complete(copy, report) else None


def _step(module: RenamedModule, report: Report) -> dict[str, str]:
    step: dict[str, str] = {}
    for old, new in module.renaming:
        if step.setdefault(old, new) != new:
            report.name(
                "duplicate-renaming", f"{old} is renamed to both {step[old]} and {new}", module.span
            )
    return step


def _complete(copy: Copy, report: Report) -> bool:
    missing = (
        [v.name for v in copy.text.variables if v.name not in copy.renaming]
        if copy.renaming or copy.name != copy.text.name
        else []
    )
    for name in missing:
        message = (
            f"module {copy.name} is a copy of {copy.text.name} but does not rename its variable "
            f"{name}"
        )
        report.name(
            "missing-renaming", message, copy.span, f"add {name}={name}_{copy.name} to the renaming"
        )
    return not missing
