"""One property of a file with values of its constants: what is asked of a model, and again of its exact version."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from symcheck.semantics.binding.bind import BoundProperty, bind_properties
from symcheck.semantics.model import BoundModel, Value
from symcheck.syntax.ast import Expression
from symcheck.syntax.declarations import PropertiesFile

if TYPE_CHECKING:
    from symcheck.check.bisimulation.on_quotient import SharedQuotient
    from symcheck.engines.base import Engine
    from symcheck.options import Options
    from symcheck.semantics.reduction.reset_dead_variables import Reduction

__all__ = ["Question", "lumped", "reduced"]


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


def reduced(model: BoundModel, questions: Sequence[Question], *, steps: bool = True) -> Reduction:
    """The model with dead variables reset, for these questions; one that is at fault is not answered and needs nothing.

    steps: whether runs must keep their length although no question counts steps: distributions and exports do.
    Not for fair strategies: which strategies are fair depends on the states.
    """
    from symcheck.semantics.reduction.reset_dead_variables import observe, reduce

    bound = [q.bind(model) for q in questions]
    labels = {n: x for _, own in bound for n, x in own.items()}
    observed = observe(model, [p.formula for p, _ in bound if p.fault is None], labels)
    return reduce(model, replace(observed, steps=observed.steps or steps))


def lumped(
    engine: Engine, questions: Sequence[Question], options: Options
) -> SharedQuotient | None:
    """With the option `bisim`: one quotient for all of several questions, where that is a gain. Raises ResourceError."""
    if not options.bisim or len(questions) < 2:
        return None
    from symcheck.check.bisimulation.on_quotient import shared_quotient

    bound = [
        (p.formula, labels)
        for p, labels in (q.bind(engine.model) for q in questions)
        if p.fault is None
    ]
    return shared_quotient(engine, bound, options)
