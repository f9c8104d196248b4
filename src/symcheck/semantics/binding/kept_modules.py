"""Reuses the bound form of modules that an edit of the text did not change."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Set

from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.binding.module_renaming import ModuleInstance
from symcheck.semantics.model import BoundModule
from symcheck.syntax.declarations import Constant, Formula, Module, Program

__all__ = ["KeptModules"]


@dataclass(frozen=True, slots=True)
class _Kept:
    module: Module
    bound: BoundModule
    sums_to_one: bool


class KeptModules:
    """The bound modules of the last program without faults.

    One is used again if its `Module` is the same object, and nothing that its expressions may refer
    to has changed: constants, formulas, names and types of variables, and how modules rename them.
    Such a module has no faults either. Binding calls `begin`, then asks for modules, and calls
    `keep` if no faults were found.
    """

    def __init__(self) -> None:
        self._kept_context: object = None
        self._context: object = None
        self._is_unchanged = False
        self._kept: tuple[_Kept, ...] = ()

    def begin(self, program: Program, settings: tuple[object, ...]) -> None:
        """Begin with a program.

        Args:
            program: the program.
            settings: all else that decides what its modules are bound to.
        """
        self._context = (
            *(*settings, program.type, program.globals, program.initial is None),
            *_definitions((*program.constants, *program.formulas)),
            *((m.name, m.variables) if isinstance(m, Module) else m for m in program.modules),
        )
        self._is_unchanged = self._context == self._kept_context

    def has(self, number: int, instance: ModuleInstance) -> bool:
        """Whether the module at place `number` of the program is known, and so has no faults."""
        return self._found(number, instance.base_module) is not None

    def bound(self, number: int, instance: ModuleInstance) -> BoundModule | None:
        """What the module at place `number` of the program is bound to, if that is known."""
        found = self._found(number, instance.base_module)
        return None if found is None else found.bound

    @property
    def sums_to_one(self) -> frozenset[int]:
        """The ids of the bound modules whose probabilities are known to sum to 1; the modules live
        until `keep`.
        """
        return frozenset(id(kept.bound) for kept in self._kept if kept.sums_to_one)

    def keep(
        self,
        instances: Iterable[ModuleInstance],
        bound: Iterable[BoundModule],
        sums_to_one: Set[int],
    ) -> None:
        """End with the program that was begun, which has no faults.

        Args:
            instances: its modules after renaming.
            bound: what they are bound to, in the same order.
            sums_to_one: the ids of those whose probabilities sum to 1.
        """
        self._kept_context, self._is_unchanged = self._context, True
        self._kept = tuple(
            _Kept(instance.base_module, module, id(module) in sums_to_one)
            for instance, module in zip(instances, bound, strict=True)
        )

    def _found(self, number: int, module: Module) -> _Kept | None:
        kept = self._kept[number] if self._is_unchanged else None
        return kept if kept is not None and kept.module is module else None


def _definitions(definitions: Iterable[Constant | Formula]) -> Iterator[object]:
    """The definitions with their texts and places, to which faults of states point."""
    for definition in definitions:
        start, end = definition.span.start, definition.span.end
        yield definition, start, definition.span.source.text[start:end]
