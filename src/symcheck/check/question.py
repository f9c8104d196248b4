"""One property of a file with values of its constants: what is asked of a model, and again of its exact version."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from symcheck.semantics.bind import BoundProperty, bind_properties
from symcheck.semantics.model import BoundModel, Value
from symcheck.syntax.ast import Expression, PropertiesFile

__all__ = ["Question"]


@dataclass(frozen=True)
class Question:
    """Property number `index` of `file`. `formula` is what `check` takes as `rebind`."""

    file: PropertiesFile = field(repr=False)
    index: int
    constants: Mapping[str, Value | str]

    def bind(self, model: BoundModel) -> tuple[BoundProperty, Mapping[str, Expression]]:
        """The property bound to a model, and the labels that it may use. Raises InputError."""
        bound = bind_properties(self.file, model, self.constants)
        return bound.properties[self.index], bound.labels

    def formula(self, model: BoundModel) -> Expression:
        """The formula alone. Raises InputError."""
        return self.bind(model)[0].formula
