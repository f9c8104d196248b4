"""Binding of programs: a program and values of its constants give a bound model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING

from symcheck.errors import InputError, Span, UnsupportedError
from symcheck.semantics.binding.composition import events
from symcheck.semantics.binding.label_references import inline_labels
from symcheck.semantics.binding.module_renaming import ModuleInstance
from symcheck.semantics.binding.names import ConstantValue, Scope, SymbolTable
from symcheck.semantics.binding.probability_sums import NormalisedModules, normalised_modules
from symcheck.semantics.binding.static_checks import (
    CheckedProgram,
    DeclaredVariable,
    check_program,
    check_values_given,
    set_constants,
)
from symcheck.semantics.diagnostics import DiagnosticCollector
from symcheck.semantics.expressions.deep_recursion import with_deep_recursion
from symcheck.semantics.expressions.literals import format_value
from symcheck.semantics.features import require_type
from symcheck.semantics.model import (
    BoundCommand,
    BoundModel,
    BoundModule,
    BoundPlayer,
    BoundReward,
    BoundRewards,
    BoundUpdate,
    Event,
    Value,
    Variable,
)
from symcheck.syntax.ast import WITHOUT_KEYWORD, Expression, Literal, ModelType, Type, Weights
from symcheck.syntax.declarations import Command, Constant, Program, RewardStructure, Update

if TYPE_CHECKING:
    from symcheck.semantics.binding.kept_modules import KeptModules
    from symcheck.semantics.binding.parameters import Ranges

__all__ = ["bind", "check_constant_names", "exactly_bound", "undefined_constants"]

_ONE = Literal(Fraction(1), Type.DOUBLE)


def undefined_constants(program: Program) -> tuple[Constant, ...]:
    """The constants of a program that are defined without a value."""
    return tuple(c for c in program.constants if c.value is None)


def check_constant_names(program: Program, constants: Mapping[str, ConstantValue]) -> None:
    """Raise NameFault if a value is given for a constant that the program does not declare."""
    report = DiagnosticCollector()
    set_constants(SymbolTable(report, exact=False), program.constants, constants)
    report.raise_all()


@with_deep_recursion
def bind(
    program: Program,
    constants: Mapping[str, ConstantValue] | None = None,
    *,
    model_type: ModelType | None = None,
    exact: bool = False,
    normalise: bool | None = None,
    parameters: Ranges | None = None,
    kept: KeptModules | None = None,
) -> BoundModel:
    """Evaluate the constants of a program, expand its formulas, and check names and types.

    Args:
        program: the parsed text.
        constants: values of the constants that the program leaves undefined, as Python values or
            texts (`"1/3"`, `"2*N"`).
        model_type: the model type, which overrides the keyword of the program; an MDP if neither
            is given.
        exact: keep decimal constants as fractions.
        normalise: divide probabilities that almost sum to 1 by their sum, with a warning; by
            default unless `exact`, because the engine for rationals refuses them.
        parameters: the range of each constant that is left open; then numbers are exact.
        kept: the modules of the program before, for programs that differ in few modules. The
            result and the faults are the same.

    Raises:
        UnsupportedError: nothing is offered for models of this type.
        NameFault, TypeFault, InputError: all faults of the program, in the order of the text.

    Examples:
        >>> from symcheck import bind, parse_model
        >>> text = "dtmc const int N; module m x : [0..N]; [] x<N -> (x'=x+1); endmodule"
        >>> bind(parse_model(text), {"N": 3}).variables[0].high
        3
    """
    report = DiagnosticCollector()
    program = inline_labels(program, report)
    report.raise_all()
    exact = exact or bool(parameters)
    table = SymbolTable(report, exact)
    if parameters:
        from symcheck.semantics.binding.parameters import check_places, check_ranges

        check_ranges(parameters, program.constants, constants or {}, report)
        table.parameters = parameters.keys()
    set_constants(table, program.constants, constants or {})
    check_values_given(table, program.constants)
    kind = model_type or program.type or WITHOUT_KEYWORD
    divides = not exact if normalise is None else normalise and not parameters
    if kept is not None:
        settings = (kind, exact, divides, dict(constants or {}), dict(parameters or {}))
        kept.begin(program, settings)
    checked = check_program(program, table, kept)
    report.raise_all()
    require_type(kind)
    if program.players or kind.players > 1:
        from symcheck.semantics.binding.player_declarations import check_players

        check_players(checked, kind)
        report.raise_all()
    bound = _Builder(checked, constants or {}, kept).build(kind, divides)
    if not parameters:
        return bound
    if bound.weights is not Weights.NUMBERS:
        raise UnsupportedError("intervals of probabilities with parameters are not supported")
    bound = replace(bound, parameters=dict(parameters), weights=Weights.PARAMETERS)
    check_places(bound)
    return bound


def _of_chain(module: BoundModule) -> tuple[BoundCommand, ...]:
    """The commands of a module where none has a choice: all of them race, as in a CTMC."""
    return tuple(replace(command, is_markovian=False) for command in module.commands)


class _Builder:
    """Builds the bound model of a checked program; collects evaluation faults and raises them."""

    def __init__(
        self,
        checked: CheckedProgram,
        given: Mapping[str, ConstantValue],
        kept: KeptModules | None,
    ) -> None:
        self.program = checked.program
        self.kept = kept
        self.given = given
        self.checked = checked
        self.table = checked.table
        self.report = checked.table.report
        self.index = {name: i for i, name in enumerate(checked.declared)}

    def build(self, kind: ModelType, normalise: bool) -> BoundModel:
        root = self.checked.root
        known = (c for c in self.program.constants if not self.table.is_open(c.name))
        constants = {c.name: v for c in known if (v := self._value(c)) is not None}
        self.report.raise_all()
        self.table.check_repeated()
        variables = tuple(
            self._variable(name, variable) for name, variable in self.checked.declared.items()
        )
        modules = tuple(
            self._module(i, instance, scope)
            for i, (instance, scope) in enumerate(self.checked.modules)
        )
        weights = self._weights(modules, kind)
        labels = {x.name: root.expand(x.expression) for x in self.program.labels}
        observables = tuple(root.expand(x.expression) for x in self.program.observables)
        for x, seen in zip(self.program.observables, observables, strict=True):
            if x.name is not None and root.typer().state(seen) is Type.BOOL:
                labels.setdefault(x.name, seen)
        rewards = tuple(self._rewards(r) for r in self.program.rewards)
        initial = None if self.program.initial is None else root.expand(self.program.initial)
        if initial is not None:
            self._check_enumerable(variables)
        players = tuple(
            BoundPlayer(p.name, frozenset(p.modules), frozenset(p.actions))
            for p in self.program.players
        )
        composed = self._events(kind, modules, players, variables)
        if kind.concurrent:
            from symcheck.semantics.joint_actions import joint_rewards

            rewards = tuple(
                joint_rewards(r, modules, players, composed, self.report) for r in rewards
            )
        self._check_markovian(kind, composed)
        self.report.raise_all()
        racing = modules
        if (without_choices := self.program.model_type(kind)) is not kind:
            kind = without_choices
            racing = tuple(replace(m, commands=_of_chain(m)) for m in modules)
            composed = events(racing, self.program.system)
        self._check_clocks(kind, variables, modules)
        sums = NormalisedModules(racing)
        if normalise and kind.has_probabilities:
            right = frozenset() if self.kept is None else self.kept.sums_to_one
            sums = normalised_modules(modules, variables, right)
            if sums.modules is not modules:
                composed = self._events(kind, sums.modules, players, variables)
        if self.kept is not None:
            instances = (instance for instance, _ in self.checked.modules)
            self.kept.keep(instances, modules, sums.right)
        return BoundModel(
            program=self.program,
            type=kind,
            variables=variables,
            modules=sums.modules,
            events=composed,
            initial=initial,
            labels=labels,
            rewards=rewards,
            constants=constants,
            is_rational=self.table.exact,
            players=players,
            given=dict(self.given),
            system=self.program.system,
            warnings=sums.warnings,
            sums_divided=bool(sums.warnings),
            unchecked_sums=sums.gave_up,
            observables=observables,
            definitions={name: self.table.expression(name) for name in constants},
            weights=weights,
        )

    def _events(
        self,
        kind: ModelType,
        modules: tuple[BoundModule, ...],
        players: tuple[BoundPlayer, ...],
        variables: tuple[Variable, ...],
    ) -> tuple[Event, ...]:
        if not kind.concurrent:
            return events(modules, self.program.system)
        from symcheck.semantics.joint_actions import joint_events

        return joint_events(modules, players, [v.name for v in variables], self.report)

    def _weights(self, modules: tuple[BoundModule, ...], kind: ModelType) -> Weights:
        updates = (u for m in modules for c in m.commands for u in c.updates)
        intervals = [u for u in updates if u.upper is not None]
        if intervals and (kind.has_own_syntax or kind.continuous_time):
            message = f"{kind.called} with intervals are not supported"
            hint = "intervals of probabilities belong to a dtmc or an mdp"
            self.report.input("interval", message, intervals[0].span, hint)
        return Weights.INTERVALS if intervals else Weights.NUMBERS

    def _check_clocks(
        self, kind: ModelType, variables: tuple[Variable, ...], modules: tuple[BoundModule, ...]
    ) -> None:
        """Report clocks and invariants of another model."""
        if kind.has_clocks:
            return
        hint = f"begin the text with pta, not {kind.value}"
        for clock in (v for v in variables if v.clock):
            message = f"{clock.name} is a clock, and only timed automata have clocks"
            self.report.input("clock", message, clock.span, hint)
        for condition in (m.invariant for m in modules if m.invariant is not None):
            message = "only timed automata have invariants"
            self.report.input("clock", message, condition.span, hint)
        self.report.raise_all()

    # --------------------------------------------------------------------------------------- values

    def _value(self, constant: Constant) -> Value | None:
        try:
            return self.table.value(constant.name)
        except InputError as fault:
            self.report.absorb(fault)
            return None

    def _constant(self, scope: Scope, expression: Expression, kind: Type) -> Value | None:
        try:
            return scope.constant(expression, kind)
        except InputError as fault:
            self.report.absorb(fault)
            return None

    # ------------------------------------------------------------------------------------ variables

    def _variable(self, name: str, variable: DeclaredVariable) -> Variable:
        d = variable.declaration
        low, high = (0, 1) if d.type is Type.BOOL else (None, None)
        if d.low is not None and d.high is not None:
            low, high = self._int(variable.scope, d.low), self._int(variable.scope, d.high)
        if low is not None and high is not None and low > high:
            self.report.input(
                "empty-range", f"variable {name} has no values: [{low}..{high}]", d.span
            )
        initial = self._initial(name, variable, low, high)
        module = variable.module
        return Variable(name, d.type, low, high, initial, module, d.clock, span=d.span)

    def _int(self, scope: Scope, expression: Expression) -> int | None:
        value = self._constant(scope, expression, Type.INT)
        assert value is None or isinstance(value, int)
        return value

    def _initial(
        self, name: str, variable: DeclaredVariable, low: int | None, high: int | None
    ) -> bool | int | None:
        if self.program.initial is not None:
            return None
        given = variable.declaration.initial
        if given is None:
            return False if variable.declaration.type is Type.BOOL else low or 0
        value = self._constant(variable.scope, given, variable.declaration.type)
        assert value is None or isinstance(value, int)
        if value is not None and (
            (low is not None and value < low) or (high is not None and value > high)
        ):
            message = f"the initial value {format_value(value)} of variable {name} is not within "
            self.report.input("init-range", message + f"[{low}..{high}]", given.span)
        return value

    def _check_enumerable(self, variables: tuple[Variable, ...]) -> None:
        for v in variables:
            if not v.clock and (v.low is None or v.high is None):
                message = (
                    f"variable {v.name} has no bounds, so the states that satisfy the condition "
                    "on initial states cannot be enumerated"
                )
                self.report.input(
                    "init-unbounded", message, v.span, f"declare {v.name} : [low..high]"
                )

    # -------------------------------------------------------------------------- modules and rewards

    def _module(self, number: int, instance: ModuleInstance, scope: Scope) -> BoundModule:
        if self.kept is not None and (known := self.kept.bound(number, instance)) is not None:
            return known
        declared = self.checked.declared
        local = (i for name, i in self.index.items() if declared[name].module == instance.name)
        commands = (self._command(number, scope, c) for c in instance.base_module.commands)
        given = instance.base_module.invariant
        invariant = None if given is None else scope.expand(given)
        return BoundModule(instance.name, tuple(local), tuple(commands), invariant)

    def _command(self, module: int, scope: Scope, command: Command) -> BoundCommand:
        action = None if command.action is None else scope.renamed(command.action)
        updates = tuple(self._update(scope, u, command.span) for u in command.updates)
        guard, has_rates = scope.expand(command.guard), command.is_markovian
        others = tuple(map(scope.renamed, command.others))
        return BoundCommand(module, action, guard, updates, has_rates, others, span=command.span)

    def _check_markovian(self, kind: ModelType, composed: tuple[Event, ...]) -> None:
        """Markovian commands are for Markov automata, and none of them synchronises."""
        for event in composed:
            for command in (c for p in event.participants for c in p if c.is_markovian):
                if not kind.immediate_choices:
                    message = f"a {kind.value} has no Markovian commands <>"
                    hint = "the type of the model is ma, or write [] in place of <>"
                    self.report.input("markovian", message, command.span, hint)
                elif len(event.participants) > 1:
                    message = f"Markovian commands cannot synchronise, here on {command.action}"
                    hint = "let a command [] that follows it synchronise"
                    self.report.input("markovian", message, command.span, hint)

    def _update(self, scope: Scope, update: Update, span: Span) -> BoundUpdate:
        probability = _ONE if update.probability is None else scope.expand(update.probability)
        assignments = (
            (self.index[scope.renamed(a.variable)], scope.expand(a.expression))
            for a in update.assignments
        )
        position = update.span if update.span.source.text else span
        upper = None if update.upper is None else scope.expand(update.upper)
        return BoundUpdate(probability, tuple(assignments), upper, span=position)

    def _rewards(self, structure: RewardStructure) -> BoundRewards:
        scope = self.checked.root
        items = []
        for item in structure.items:
            on_states, action = item.action is False, item.action or None
            guard, value = scope.expand(item.guard), scope.expand(item.value)
            items.append(BoundReward(on_states, action, guard, value, item.others, span=item.span))
        return BoundRewards(structure.name, tuple(items))


def exactly_bound(model: BoundModel) -> BoundModel:
    """The model with the numbers of its text as rationals."""
    if model.is_rational:
        return model
    exact = bind(
        model.program,
        model.given,
        model_type=model.type if model.clocks is None else model.clocks.automaton.type,
        exact=True,
        normalise=model.sums_divided,
    )
    return exact if model.derivation is None else model.derivation(exact)
