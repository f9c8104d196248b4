"""Module renaming: modules that are copies of other modules with new names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from symcheck.errors import Span
from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.diagnostics import DiagnosticCollector, suggest
from symcheck.syntax.declarations import Module, Program, RenamedModule

__all__ = ["ModuleInstance", "module_instances"]


@dataclass(frozen=True, slots=True)
class ModuleInstance:
    """A module to be bound: the declaration of its base module, and the renaming of its names."""

    name: str
    base_module: Module
    renaming: Mapping[str, str] = field(default_factory=dict)
    span: Span = field(kw_only=True)


def module_instances(program: Program, report: DiagnosticCollector) -> tuple[ModuleInstance, ...]:
    """All modules of a program, in order; a faulty module is reported and omitted.

    A copy of a copy is renamed by the composition of both renamings.
    """
    named: dict[str, Module | RenamedModule] = {}
    for module in program.modules:
        if module.name in named:
            report.name("duplicate-module", f"there is a module {module.name} already", module.span)
        named.setdefault(module.name, module)
    result = (_instance(m, named, report) for m in named.values())
    return tuple(c for c in result if c is not None)


def _instance(
    module: Module | RenamedModule,
    named: Mapping[str, Module | RenamedModule],
    report: DiagnosticCollector,
) -> ModuleInstance | None:
    renaming: dict[str, str] = {}
    base, seen = module, [module.name]
    while isinstance(base, RenamedModule):
        # Compose the renaming of the base with the renamings that are applied after it.
        step = _step(base, report if base is module else DiagnosticCollector())
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
    instance = ModuleInstance(module.name, base, renaming, span=module.span)
    return instance if _complete(instance, report) else None


def _step(module: RenamedModule, report: DiagnosticCollector) -> dict[str, str]:
    step: dict[str, str] = {}
    for old, new in module.renaming:
        if step.setdefault(old, new) != new:
            report.name(
                "duplicate-renaming", f"{old} is renamed to both {step[old]} and {new}", module.span
            )
    return step


def _complete(instance: ModuleInstance, report: DiagnosticCollector) -> bool:
    missing = (
        [v.name for v in instance.base_module.variables if v.name not in instance.renaming]
        if instance.renaming or instance.name != instance.base_module.name
        else []
    )
    for name in missing:
        message = (
            f"module {instance.name} is a copy of {instance.base_module.name} but does not rename "
            f"its variable {name}"
        )
        report.name(
            "missing-renaming",
            message,
            instance.span,
            f"add {name}={name}_{instance.name} to the renaming",
        )
    return not missing
