"""Properties with values of their constants, to be bound to a model or its exact version."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, TypeVar

from symcheck.constant_values import ConstantValue, GivenConstants, combinations
from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.binding.bind import BoundProperty, bind_property, needed_constants
from symcheck.semantics.model import BoundModel, Observations
from symcheck.syntax.ast import Expression, Name, PathQuantifier
from symcheck.syntax.declarations import Program, PropertiesFile
from symcheck.syntax.printer import pretty
from symcheck.syntax.traversal import nodes

if TYPE_CHECKING:
    from symcheck.check.bisimulation.on_quotient import SharedQuotient
    from symcheck.engines.base import Engine
    from symcheck.options import Options
    from symcheck.semantics.reduction.reset_dead_variables import Reduction

V = TypeVar("V", bound=ConstantValue)
NO_LABELS: Mapping[str, Expression] = MappingProxyType({})
Derivation = Callable[[BoundModel], BoundModel]

__all__ = [
    "PropertyInstance",
    "observations_up_to_symmetry",
    "property_instances",
    "reduced",
    "shared_quotient",
    "stopped",
]


@dataclass(frozen=True)
class PropertyInstance:
    """One property of a file, with one value for each constant that the file leaves open.

    Attributes:
        file: the properties.
        index: of the property in `file`, from 0.
        constants: one value for each constant that the file leaves open.
        relevant: those of the constants on which the property depends.
    """

    file: PropertiesFile = field(repr=False)
    index: int
    constants: GivenConstants
    relevant: GivenConstants = field(default_factory=dict)

    @property
    def name(self) -> str | None:
        """The name of the property; None if it has none."""
        return self.file.properties[self.index].name

    @property
    def title(self) -> str:
        """The name of the property, or its text on one line."""
        return self.name or self.text

    @property
    def full_title(self) -> str:
        """The text on one line, after the name if there is one."""
        return f'"{self.name}": {self.text}' if self.name else self.text

    @property
    def text(self) -> str:
        """The property as the user wrote it, without its name, on one line.

        One that was written in another language (JANI) is printed in PRISM's.
        """
        given = self.file.properties[self.index]
        text = given.span.text.strip().rstrip(";") or pretty(given.formula)
        if given.name is not None and text.startswith('"'):
            text = text.partition(":")[2]
        return " ".join(text.split())

    def bind(self, model: BoundModel) -> tuple[BoundProperty, Mapping[str, Expression]]:
        """The property bound to a model, and the labels that it may use. Raises InputError.

        A property of a timed automaton is bound to the automaton, and read on the model that was
        made for it.
        """
        if model.clocks is None:
            return bind_property(self.file, self.index, model, self.constants)
        from symcheck.semantics.timed.properties import translated

        automaton = model.clocks.automaton
        given, labels = bind_property(self.file, self.index, automaton, self.constants)
        if given.bound is None:
            return given, labels
        bound, labels = translated(model, given.bound, labels)
        return replace(given, bound=bound), labels


def property_instances(
    program: Program,
    file: PropertiesFile,
    values: Mapping[str, Sequence[V]],
    indices: Sequence[int] | None = None,
) -> list[PropertyInstance]:
    """The properties of a file for every combination of values of their constants.

    Each property is combined with the constants on which it depends.

    Args:
        program: the model, whose names the properties may use.
        file: the properties.
        values: for each constant that the file leaves open, its values.
        indices: the properties, from 0; None for all.
    """
    needed = needed_constants(program, file)
    first = {name: of_constant[0] for name, of_constant in values.items()}
    return [
        PropertyInstance(file, i, {**first, **choice}, choice)
        for i in (range(len(file.properties)) if indices is None else indices)
        for choice in combinations({n: v for n, v in values.items() if n in needed[i]})
    ]


def reduced(model: BoundModel, instances: Sequence[PropertyInstance]) -> Reduction:
    """The model with dead variables reset: fewer states, the same values of these properties.

    Not for fair strategies: which strategies are fair depends on the states. Properties with a
    fault are not considered.
    """
    from symcheck.semantics.reduction.reset_dead_variables import reduce

    reduction = reduce(model, _observations(model, instances))
    if model.derivation is None:
        return reduction
    derivation = partial(_in_turn, model.derivation, reduction.model.derivation)
    return replace(reduction, model=replace(reduction.model, derivation=derivation))


def _in_turn(first: Derivation, second: Derivation | None, model: BoundModel) -> BoundModel:
    return first(model) if second is None else second(first(model))


def stopped(model: BoundModel, instances: Sequence[PropertyInstance]) -> BoundModel:
    """The model without what the properties do not need for their values in the initial states.

    It is the same model if a property may need every state, or if there is no property. Properties
    with a fault are not considered.
    """
    from symcheck.semantics.reduction.stop_at_targets import deciding_states, stop_at

    bound = [instance.bind(model) for instance in instances]
    formulas = [(p.formula, labels) for p, labels in bound if p.fault is None]
    states = deciding_states(model, formulas)
    if states is None:
        return model
    return replace(stop_at(model, states), derivation=partial(stopped, instances=instances))


def observations_up_to_symmetry(
    model: BoundModel, instances: Sequence[PropertyInstance]
) -> Observations | None:
    """What properties read of a model, if their values at the initial states are enough.

    None if a result contains states, as the witnesses of E and A do.
    """
    formulas = [p.formula for p, _ in (i.bind(model) for i in instances) if p.fault is None]
    if any(isinstance(node, PathQuantifier) for f in formulas for node in nodes(f)):
        return None
    return _observations(model, instances, {"init": Name('"init"')})


def _observations(
    model: BoundModel,
    instances: Sequence[PropertyInstance],
    further_labels: Mapping[str, Expression] = NO_LABELS,
) -> Observations:
    """What properties read of a model; those with a fault are not considered.

    Labels of a properties file may depend on its constants: each instance has its own.
    """
    from symcheck.semantics.reduction.reset_dead_variables import observe

    bound = [instance.bind(model) for instance in instances]
    observed = [
        observe(model, [property_.formula], {**labels, **further_labels})
        for property_, labels in bound
        if property_.fault is None
    ]
    return Observations(
        tuple(dict.fromkeys(e for o in observed for e in o.expressions)),
        any(o.rewards for o in observed),
    )


def shared_quotient(
    engine: Engine, instances: Sequence[PropertyInstance], options: Options
) -> SharedQuotient | None:
    """One quotient for several properties; None if it does not pay."""
    from symcheck.check.bisimulation import on_quotient

    bound = [instance.bind(engine.model) for instance in instances]
    formulas = [(p.formula, labels) for p, labels in bound if p.fault is None]
    return on_quotient.shared_quotient(engine, formulas, options)
