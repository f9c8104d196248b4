"""Modules that stay as they are while others are typed: they are bound once."""

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
    """The modules of the program without faults that was bound last.

    A program shares a module with it if the module is the same object, and if nothing that its
    expressions may refer to has changed: constants, formulas, names and types of variables, and
    how modules rename them. Such a module has no faults either, and is bound to the same.
    """

    def __init__(self) -> None:
        self._known: object = None
        self._context: object = None
        self._same = False
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
        self._same = self._context == self._known

    def has(self, number: int, instance: ModuleInstance) -> bool:
        """Whether module `number` is known to be without faults."""
        return self._found(number, instance.base_module) is not None

    def bound(self, number: int, instance: ModuleInstance) -> BoundModule | None:
        """What module `number` is bound to, if that is known."""
        found = self._found(number, instance.base_module)
        return None if found is None else found.bound

    @property
    def sums_to_one(self) -> frozenset[int]:
        """The ids of the bound modules whose probabilities are known to sum to 1."""
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
            sums_to_one: the ids of those bound modules that `sums_to_one` is to know.
        """
        self._known = self._context
        self._kept = tuple(
            _Kept(instance.base_module, module, id(module) in sums_to_one)
            for instance, module in zip(instances, bound, strict=True)
        )

    def _found(self, number: int, module: Module) -> _Kept | None:
        kept = self._kept[number] if self._same else None
        return kept if kept is not None and kept.module is module else None


def _definitions(definitions: Iterable[Constant | Formula]) -> Iterator[object]:
    """The definitions with their texts and places, to which faults of states refer."""
    for definition in definitions:
        start, end = definition.span.start, definition.span.end
        yield definition, start, definition.span.source.text[start:end]
