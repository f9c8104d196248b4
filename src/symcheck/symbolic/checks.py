"""Rules for reachable states, checked on diagrams: sums and signs of probabilities, ranges of
variables, deadlocks.

The states that break a rule are computed as a set. The interpreter
(`symcheck.semantics.interpreter`) describes the fault in its lowest state, so that all engines
report the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache, partial
from itertools import islice
from operator import and_
from typing import TYPE_CHECKING

from symcheck.errors import Diagnostic, InputError, ModelFault
from symcheck.options import Options
from symcheck.semantics import interpreter, state_faults
from symcheck.symbolic.events.commands import positive, possible
from symcheck.symbolic.model import EncodedCommand, EncodedEvent, StateSpace, SymbolicModel

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd

LazySet = Callable[[], "Bdd"]
"""A set that is computed on first use."""

__all__ = ["check_initial", "check_model"]


def check_initial(symbolic: SymbolicModel) -> None:
    """Raise ModelFault if no state satisfies `init … endinit`, or if it has no value in one."""
    condition = symbolic.model.initial
    if condition is None:
        return
    symbolic.raise_fault(condition, symbolic.translator.valuations())
    if not symbolic.initial:
        raise ModelFault(state_faults.no_initial_state(condition.span))


def check_model(space: StateSpace, options: Options) -> None:
    """Raise ModelFault if a reachable state breaks a rule, with an example of each fault."""
    result: dict[Diagnostic, None] = {}
    almost: list[state_faults.AlmostOne] = []
    seen = space.symbolic.manager.false
    for states in _violations(space, options):
        # The interpreter reports the first fault of a state, so states without an earlier violation
        # are preferred.
        fault = _explain(space, states - seen or states, options)
        if isinstance(fault, state_faults.AlmostOne):
            almost.append(fault)
        elif fault is not None:
            result.update(dict.fromkeys(fault.diagnostics))
        seen = seen | states
    if space.deadlocks and not options.fix_deadlocks:
        some = [
            state_faults.describe_state(space.symbolic.model.variables, s)
            for s in islice(space.valuations(space.deadlocks), 3)
        ]
        result[
            state_faults.deadlocks(
                some, space.symbolic.manager.count(space.deadlocks, space.symbolic.encoding.rows)
            )
        ] = None
    if result:
        raise ModelFault(*result)
    if almost:
        raise almost[0]


def _explain(space: StateSpace, states: Bdd, options: Options) -> InputError | None:
    state = next(space.valuations(states))
    try:
        interpreter.choices(space.symbolic.model, state, check_sums=options.check_sums)
    except InputError as fault:
        return fault
    return None


def _violations(space: StateSpace, options: Options) -> Iterator[Bdd]:
    """Non-empty sets of reachable states that break a rule, one per command and rule.

    Guards are small and reachable sets may be large: they meet only where a command could break a
    rule somewhere.
    """
    translator = space.symbolic.translator
    for event in space.symbolic.events:
        guards = [c.command.guard for commands in event.participants for c in commands]
        yield from filter(None, (translator.faults(g) & space.states for g in guards))
        enabled = cache(partial(and_, event.guard, space.states))
        happens = cache(partial(_happening, space, event, enabled))
        if event.guard.disjoint(space.states):
            continue
        for command in (c for commands in event.participants for c in commands):
            yield from filter(None, _command_violations(space, command, enabled, happens, options))


def _happening(space: StateSpace, event: EncodedEvent, enabled: LazySet) -> Bdd:
    return enabled() & possible(space.symbolic.translator, event.participants)


def _command_violations(
    space: StateSpace,
    command: EncodedCommand,
    enabled: LazySet,
    happens: LazySet,
    options: Options,
) -> Iterator[Bdd]:
    translator = space.symbolic.translator
    where = cache(lambda: command.guard & enabled())
    for update in command.updates:
        if isinstance(update.probability, float):
            if not 0 <= update.probability < float("inf"):
                yield where()
        elif where():
            infinite = update.probability.compare("=", float("inf"))
            yield where() & (
                update.probability.compare("<", 0.0)
                | infinite
                | translator.undefined(update.update.probability)
                | translator.faults(update.update.probability)
            )
        outside = (command.guard - update.in_range) & positive(translator, update)
        if outside:
            yield outside & happens()
    has_rates = command.command.is_markovian or not space.symbolic.model.type.has_probabilities
    if options.check_sums and not has_rates:
        yield _wrong_sum(space, command, where)


def _wrong_sum(space: StateSpace, command: EncodedCommand, where: LazySet) -> Bdd:
    manager = space.symbolic.manager
    constant = sum(u.probability for u in command.updates if isinstance(u.probability, float))
    variable = [u.probability for u in command.updates if not isinstance(u.probability, float)]
    if not variable:
        return manager.false if state_faults.sums_to_one(constant) else where()
    total = manager.sum([p.times_bdd(where()) for p in variable]) + constant
    # The bounds as the scalar rule computes them: |total - 1| <= tolerance.
    distance = (total - 1.0).maximum(1.0 - total)
    return where() & distance.compare(
        ">", state_faults.sum_tolerance(space.symbolic.model.unchecked_sums)
    )
