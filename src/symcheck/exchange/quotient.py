"""The quotient of a model by strong bisimulation, as a model of its own.

Source: Baier & Katoen (2008), 10.4.2; Derisavi, Hermanns & Sanders (2003).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Set
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from symcheck.api.arguments import properties_file
from symcheck.api.model import Model
from symcheck.check.bisimulation.atomic_observations import atomic_observations
from symcheck.check.context import Context
from symcheck.check.property_instance import PropertyInstance
from symcheck.constant_values import GivenConstants, constant_values
from symcheck.engines.capabilities import HasImportedStates
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.states import States
from symcheck.engines.transition_actions import state_columns
from symcheck.errors import UnsupportedError, UsageError
from symcheck.exchange.api_io import ImportedModel
from symcheck.exchange.explicit_data import ExplicitData, ExplicitRewards, imported_program
from symcheck.exchange.python.from_matrix import label
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, starts_of
from symcheck.numerics.bisimulation import Lumping, distinct_rows, lump
from symcheck.semantics.diagnostics import suggest
from symcheck.semantics.features import Feature, require
from symcheck.semantics.rewards import Structure, bounded_reward
from symcheck.syntax.ast import (
    Expression,
    Filter,
    LabelReference,
    Name,
    RewardBound,
    RewardOperator,
    StateFilter,
    StateOperator,
    Type,
)
from symcheck.syntax.declarations import Program, PropertiesFile
from symcheck.syntax.printer import pretty
from symcheck.syntax.traversal import names, nodes, with_labels
from symcheck.tables import counted

if TYPE_CHECKING:
    from symcheck.engines.base import Engine

__all__ = ["QuotientModel", "quotient"]

_PREDEFINED = ("init", "deadlock")


@dataclass(frozen=True, eq=False, repr=False)
class QuotientModel(ImportedModel):
    """A model whose states are the blocks of bisimilar states of another one.

    The variable `block` is the number of the block, in the order of the first states. A variable of
    the original on which the states of each block agree is a variable of the quotient too.

    Attributes:
        original: the model whose states are lumped, on explicit states.
        block: the block of each state of the original, int32[states].
        mixed: those of "init" and "deadlock" on which states of one block differ. A block has them
            if one of its states does.
        uneven: the reward structures of which only the mean over the transitions of a choice is
            known.
    """

    original: Model | None = None
    block: Int32s = field(default_factory=lambda: np.zeros(0, np.int32))
    mixed: frozenset[str] = frozenset()
    uneven: frozenset[str | None] = frozenset()

    def members(self, block: int) -> States:
        """The states of the original in a block.

        Args:
            block: the number of the block.

        Raises:
            IndexError: there is no such block.

        Examples:
            >>> import symcheck
            >>> die = symcheck.load("models/die/die.pm")
            >>> smaller = symcheck.quotient(die, labels={"six": "d=6"})
            >>> print(*smaller.members(0))
            (s=0, d=0)
        """
        blocks = int(self.block.max()) + 1
        if not 0 <= block < blocks:
            raise IndexError(f"block {block} of {counted(blocks, 'block')}")
        engine = self._original.engine
        return States(engine, engine.from_bools(self.block == block))

    def texts(self, most: int = 3) -> list[str]:
        r"""The states of each block as a text, a state in a line; `view.state_graph` draws them.

        Args:
            most: the most states of a block that are listed.

        Returns:
            A text for each block.

        Raises:
            UnsupportedError: there are too many blocks to list.

        Examples:
            >>> import symcheck
            >>> text = "dtmc module m x:[0..2]; [] x=0 -> 0.5:(x'=1) + 0.5:(x'=2); [] x>0 -> true;"
            >>> model = symcheck.loads(text + " endmodule label \"end\" = x>0;")
            >>> symcheck.quotient(model).texts()
            ['(x=0)', '(x=1)\n(x=2)']
        """
        listed = []
        for number in range(int(self.block.max()) + 1):
            states = self.members(number)
            more = len(states) - most
            listed.append("\n".join([*map(str, states[:most]), *[f"and {more} more"] * (more > 0)]))
        return listed

    @property
    def _original(self) -> Model:
        assert self.original is not None
        return self.original

    def _require_answerable(self, instance: PropertyInstance) -> None:
        """Refuse a property in which the states of a block may differ. Raises UnsupportedError."""
        super()._require_answerable(instance)
        bound, labels = instance.bind(self.bound)
        for operator in nodes(bound.formula):
            if not isinstance(operator, StateOperator) or isinstance(
                operator, Filter | StateFilter
            ):
                continue  # a filter speaks of blocks
            if not operator.is_bisimulation_invariant:
                raise UnsupportedError(f"bisimilar states may differ in '{pretty(operator)}'")
            for node in with_labels(operator, labels):
                if isinstance(node, LabelReference) and node.name in self.mixed:
                    raise UnsupportedError(
                        f'states of one block differ in "{node.name}"',
                        hint=f'symcheck.quotient(model, labels=["{node.name}", …]) keeps it',
                    )
                if isinstance(node, RewardBound):
                    reward = bounded_reward(node, self.bound)
                    if isinstance(reward, Structure) and (
                        self.bound.rewards[reward.index].name in self.uneven
                    ):
                        raise UnsupportedError(
                            "bounds on transition rewards of a chain are not checked on a quotient"
                        )


def quotient(
    model: Model,
    properties: str | Path | PropertiesFile | None = None,
    constants: GivenConstants | str | None = None,
    *,
    labels: Iterable[str] | Mapping[str, str] | None = None,
    rewards: Iterable[str] | None = None,
    actions: bool = False,
) -> QuotientModel:
    """The quotient of a model by strong bisimulation: the coarsest that keeps what is named.

    Bisimilar states agree in the labels, earn the same rewards, and lead to each block with the
    same probability (rate); in an MDP, they have the same choices. If nothing is named, all labels
    and reward structures of the model are kept. The quotient is checked, drawn, exported and
    simulated as every model, and its blocks have the values of their states. Numbers are compared
    in floating point: states that differ by less than about 6e-14 are lumped.

    Args:
        model: a DTMC, a CTMC or an MDP.
        properties: those that keep their values: the labels, the rewards, and all values of the
            variables that they name are kept. A label in place of `x=3` leads to fewer blocks. A
            file, its name, or a text, as for `Model.check_all`.
        constants: one value for each constant that the properties leave open.
        labels: names of labels to keep, "init" and "deadlock" among them; or a mapping from names
            to formulas, which are labels of the quotient.
        rewards: names of reward structures to keep; "" for one without a name.
        actions: bisimilar states of an MDP agree in the actions of their choices, too; otherwise
            the quotient has no actions.

    Raises:
        UnsupportedError: the model is of another class, or is computed in rationals; or bisimilar
            states may differ in a property.
        UsageError: there is no such label or reward structure.
        SymcheckError: the model cannot be built, or a formula is faulty.

    Examples:
        >>> import symcheck
        >>> die = symcheck.load("models/die/die.pm")
        >>> smaller = symcheck.quotient(die, labels={"six": "d=6"})
        >>> len(die.states), len(smaller.states)
        (13, 5)
        >>> smaller.check('P=? [ F "six" ]').value == die.check("P=? [ F d=6 ]").value
        True
    """
    if not isinstance(cast(object, model), Model):
        raise UsageError(f"a model is expected, not {model!r}", hint="symcheck.load reads a file")
    clocks = model.bound.clocks
    require(model.bound if clocks is None else clocks.automaton, Feature.BISIMULATION)
    options = model.options
    if options.exact or model.engine.is_rational:
        raise UnsupportedError(
            "quotients compare numbers in floating point, and this model has rationals",
            hint="model.with_options(exact=False)",
        )
    if options.fairness:
        raise UnsupportedError("quotients by bisimulation do not keep fair strategies")
    if actions and not model.type.has_choices:
        raise UsageError(f"actions=True is for the choices of an MDP, not of a {model.type.name}")
    engine = model.engine.capability(ExplicitEngine)
    if engine is None:
        model = model.with_options(engine="explicit")
        engine = model.engine.capability(ExplicitEngine)
        assert engine is not None
    kept = _kept(model, properties, constants, labels, rewards)
    masks = {name: model.where(formula).mask for name, formula in kept.labels.items()}
    columns = state_columns(model.engine)
    colours: list[Bools | Floats] = list(masks.values())
    colours += [columns[i].astype(np.float64) for i in sorted(kept.variables)]
    everything = engine.system(engine.all)
    earned = []
    for i in sorted(kept.rewards):
        colours.append(everything.state_rewards(Structure(i)).astype(np.float64))
        earned.append(everything.earned(Structure(i)).astype(np.float64))
    acting = engine.explored.choice_actions
    lumping = lump(engine.weights, colours, [*earned, *[acting.astype(np.float64)] * actions])
    return _model(model, engine, lumping, kept, masks, actions=actions)


# ------------------------------------------------------------------------------- what is kept


@dataclass(frozen=True)
class _Kept:
    """What a quotient keeps: formulas of labels, numbers of variables and of reward structures."""

    labels: Mapping[str, str]
    variables: frozenset[int] = frozenset()
    rewards: frozenset[int] = frozenset()


def _kept(
    model: Model,
    properties: str | Path | PropertiesFile | None,
    constants: GivenConstants | str | None,
    labels: Iterable[str] | Mapping[str, str] | None,
    rewards: Iterable[str] | None,
) -> _Kept:
    """What the arguments of `quotient` name. Raises UsageError, InputError, UnsupportedError."""
    bound = model.bound
    structures = [r.name or "" for r in bound.rewards]
    if properties is None and labels is None and rewards is None:
        return _Kept({n: f'"{n}"' for n in bound.labels}, rewards=frozenset(range(len(structures))))
    for what, given in (("labels", labels), ("rewards", rewards)):
        if isinstance(given, str) or not isinstance(cast(object, given or ()), Iterable):
            raise UsageError(f"{what}: expected several names, such as [{given!r}], not {given!r}")
    chosen: dict[str, str] = {}
    if isinstance(labels, Mapping):
        chosen = {label(name): formula for name, formula in labels.items()}
    else:
        known = (*bound.labels, *_PREDEFINED)
        chosen = {name: f'"{name}"' for name in _known("label", labels or (), known)}
    numbers = {structures.index(r) for r in _known("reward structure", rewards or (), structures)}
    variables: frozenset[int] = frozenset()
    if properties is not None:
        file = properties_file(properties)
        variables = _variables(model, file)
        for formula, of_file in _formulas(model, file, constants):
            context = Context(model.engine, model.options, of_file)
            seen = atomic_observations(context, formula)
            numbers |= seen.structures
            chosen |= {name: f'"{name}"' for name in seen.names}
            for node in with_labels(formula, of_file):
                if isinstance(node, LabelReference) and node.name in bound.labels:
                    chosen.setdefault(node.name, f'"{node.name}"')
                by_number = isinstance(node, RewardOperator | RewardBound) and isinstance(
                    node.structure, Expression
                )
                if by_number:  # R{2} stays the second structure
                    numbers |= set(range(max(numbers, default=-1) + 1))
    return _Kept(chosen, variables, frozenset(numbers))


def _known(what: str, names: Iterable[str], known: Iterable[str]) -> Iterator[str]:
    """The names. Raises UsageError for one that is unknown."""
    for name in names:
        if name not in known:
            raise UsageError(f"there is no {what} {name!r}", hint=suggest(str(name), known))
        yield name


def _formulas(
    model: Model, file: PropertiesFile, constants: GivenConstants | str | None
) -> Iterator[tuple[Expression, Mapping[str, Expression]]]:
    given = {name: (value,) for name, value in constant_values(constants).items()}
    for instance in model.instances(file, given):
        bound, labels = instance.bind(model.bound)
        yield bound.formula, labels


def _variables(model: Model, file: PropertiesFile) -> frozenset[int]:
    """The variables that properties name, as they are written."""
    labels = {label.name: label.expression for label in file.labels}
    formulas = {f.name: f.expression for f in (*model.program.formulas, *file.formulas)}
    whole = [node for p in file.properties for node in with_labels(p.formula, labels)]
    found: set[str] = set()
    fresh = {node.name for node in whole if isinstance(node, Name)}
    while fresh:
        found |= fresh
        fresh = {n for f in fresh & formulas.keys() for n in names(formulas[f])} - found
    return frozenset(i for i, v in enumerate(model.bound.variables) if v.name in found)


# --------------------------------------------------------------------------------- the blocks


def _model(
    model: Model,
    engine: ExplicitEngine,
    lumping: Lumping,
    kept: _Kept,
    masks: Mapping[str, Bools],
    *,
    actions: bool,
) -> QuotientModel:
    bound, block, first = model.bound, lumping.block, lumping.first
    system = engine.system(engine.all)
    structures = sorted(kept.rewards)
    earned = [system.rewards(Structure(i)) for i in structures]
    acting = engine.explored.choice_actions[lumping.rows].astype(np.int32)
    matrix, rows = lumping.matrix, lumping.rows
    if matrix.groups is not None:  # equal choices are one
        of_rows = [of_choices[rows].astype(np.float64) for _, of_choices in earned]
        distinct = distinct_rows(matrix, [*of_rows, *[acting.astype(np.float64)] * actions])
        groups = starts_of(np.bincount(matrix.state_of_row[distinct], minlength=len(first)))
        matrix, rows, acting = matrix.choose(distinct, groups), rows[distinct], acting[distinct]
    predefined = {
        "init": engine.to_bools(engine.initial),
        "deadlock": engine.to_bools(engine.deadlocks),
    }
    columns = _columns(model.engine, lumping)
    data = ExplicitData(
        bound.type,
        columns,
        matrix,
        bound.actions if actions else (),
        acting if actions else np.full(matrix.rows, -1, np.int32),
        {n: mask[first] for n, mask in masks.items() if n not in predefined}
        | {n: np.bincount(block[mask], minlength=len(first)) > 0 for n, mask in predefined.items()},
        [
            ExplicitRewards(bound.rewards[i].name, states[first], of_choices[rows])
            for i, (states, of_choices) in zip(structures, earned, strict=True)
        ],
        names=_names(model, {name for name, _, _ in columns}),
        delays=bound.delays,
    )
    return QuotientModel(
        imported_program(data),
        model.given_constants,
        replace(model.options, bisim=False, strategy=False),
        data.type,
        data=data,
        original=model,
        block=block,
        mixed=frozenset(n for n, m in predefined.items() if (m != m[first][block]).any()),
        uneven=frozenset(bound.rewards[i].name for i in structures if _is_uneven(engine, i)),
    )


def _names(model: Model, variables: Set[str]) -> Program:
    """The constants, and the formulas over them and these variables."""
    constants = model.instantiated().constants
    known = variables | {c.name for c in constants}
    formulas = list(model.program.formulas)
    while True:
        meant = [f for f in formulas if names(f.expression) <= known | {f.name for f in formulas}]
        if len(meant) == len(formulas):
            return Program(None, constants, tuple(meant))
        formulas = meant


def _columns(engine: Engine, lumping: Lumping) -> list[tuple[str, Type, Int64s]]:
    """The number of each block, and the variables on which the states of each block agree."""
    variables, first = engine.model.variables, lumping.first
    number = "block"
    while any(number == v.name for v in variables) or number in engine.model.constants:
        number += "_"
    columns = zip(variables, state_columns(engine), strict=True)
    return [(number, Type.INT, np.arange(len(first)))] + [
        (v.name, v.type, values[first])
        for v, values in columns
        if (values == values[first][lumping.block]).all()
    ]


def _is_uneven(engine: ExplicitEngine, structure: int) -> bool:
    """Whether transitions of one choice may have different rewards."""
    imported = engine.capability(HasImportedStates)
    if imported is not None:
        entries, matrix = imported.entry_rewards[structure], engine.matrix
        if entries is None:
            return False
        return bool((entries != np.repeat(entries[matrix.indptr[:-1]], matrix.lengths)).any())
    model = engine.model
    return not model.type.has_choices and any(
        not item.on_states for item in model.rewards[structure].items
    )
