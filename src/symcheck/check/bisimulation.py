"""Checking a formula on the quotient by strong bisimulation, which keeps what the formula speaks of."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from symcheck.check.context import Context
from symcheck.check.filters import Outcome, apply_filter
from symcheck.check.formulas import is_plain, modern_filter, numbers, satisfying, states_of
from symcheck.check.lumped import BothQuotient, DiagramQuotient, ListedQuotient, Quotient, WrittenQuotient
from symcheck.engines.base import StateSet
from symcheck.engines.explicit import ExplicitEngine
from symcheck.errors import UnsupportedError
from symcheck.numerics.lump import lump
from symcheck.semantics.conditions import reward_index
from symcheck.syntax.ast import (
    Binary,
    Expression,
    Filter,
    LabelReference,
    MultiObjective,
    Name,
    PathQuantifier,
    RewardBound,
    RewardOperator,
    StateFilter,
    Type,
    Unary,
)
from symcheck.syntax.walk import children

if TYPE_CHECKING:
    from symcheck.engines.symbolic import SymbolicEngine
    from symcheck.engines.symbolic_lump import LumpedDiagrams

__all__ = ["filtered", "quotient"]

_ENTRY_BYTES = 12
_ROWS_BYTES = 2**30  # of compressed rows that are written out where diagrams do not lump
_ROWS_STATES = 20_000_000
_LONG = 1_000_000  # listed states above which diagrams, where they are there, are asked first
_ALIKE = 4  # states per block, on average, below which listing them is cheaper


@dataclass(frozen=True)
class _Observed:
    """What a formula speaks of: expressions over the variables, sets by name, and reward structures."""

    expressions: list[Expression] = field(default_factory=list)
    names: set[str] = field(default_factory=set)
    structures: set[int] = field(default_factory=set)


def quotient(context: Context, formula: Expression) -> Quotient:
    """The quotient that is good enough for a formula: on diagrams where the engine has them, else of listed states.

    Of a filter as the outermost operator, the formula within and what is not plain in its condition count. Raises
    UnsupportedError for formulas with filters, A, E or multi(...) within, and for engines that have neither.
    """
    if context.options.fairness:
        raise UnsupportedError("-bisim is not for fair strategies")
    observed = _observed(context, formula)
    engine: Any = context.engine
    if isinstance(engine, ExplicitEngine):
        source = getattr(engine, "source", None)
        if source is not None and engine.states > _LONG:
            try:
                return BothQuotient(source, _lumped(context, source, observed, engine.states // _ALIKE))
            except UnsupportedError:
                pass
        return _listed(context, engine, observed, ListedQuotient)
    if getattr(engine, "diagrams", None) is None:
        raise UnsupportedError("-bisim works on listed states (-ex) and on diagrams")
    return _on_diagrams(context, engine, observed)


def filtered(context: Context, smaller: Quotient, formula: Filter | StateFilter) -> Outcome:
    """What a filter says of all states, with the values of the formula within computed on a quotient."""
    node = formula if isinstance(formula, Filter) else modern_filter(formula)
    inner = replace(context, engine=smaller.engine)
    kind = context.type(node.formula)
    states = context.engine.all if node.states is None else _condition(context, smaller, node.states)
    if kind is Type.BOOL:
        return apply_filter(context, node, smaller.lift_set(satisfying(inner, node.formula, inner.engine.all)), states, kind)
    return apply_filter(context, node, smaller.lift(numbers(inner, node.formula, inner.engine.all)), states, kind)


def _condition(context: Context, smaller: Quotient, condition: Expression) -> StateSet:
    if is_plain(condition) or isinstance(condition, LabelReference):
        return states_of(context)(condition)
    found: StateSet = smaller.lift_set(states_of(replace(context, engine=smaller.engine))(condition))
    return found


def _listed(
    context: Context, engine: ExplicitEngine, observed: _Observed, make: Callable[..., ListedQuotient], **more: Any
) -> ListedQuotient:
    colours: list[Any] = [engine.initial.members for name in observed.names if name == "init"]
    colours += [engine.deadlocks.members for name in observed.names if name == "deadlock"]
    for part in observed.expressions:
        if _is_set(context, part):
            colours.append(satisfying(replace(context, engine=engine), part, engine.all).members)  # type: ignore[attr-defined]
        else:
            colours.append(engine.values(part, context.type(part)).lower)
    rewards = [engine.rewards(i) for i in sorted(observed.structures)]
    colours += [states for states, _ in rewards]
    return make(engine, lump(engine.matrix, colours, [rows for _, rows in rewards]), **more)


def _on_diagrams(context: Context, engine: SymbolicEngine, observed: _Observed) -> Quotient:
    """On diagrams; where few states are alike and their rows fit into memory, these are written out."""
    from symcheck.engines.written import written_out

    fits = engine.states <= _ROWS_STATES and engine.transitions * _ENTRY_BYTES <= _ROWS_BYTES
    try:
        return DiagramQuotient(engine, _lumped(context, engine, observed, engine.states // _ALIKE if fits else None))
    except UnsupportedError:
        if not fits:
            raise
    return _listed(context, written_out(engine), observed, WrittenQuotient, source=engine)


def _lumped(context: Context, engine: SymbolicEngine, observed: _Observed, most: int | None) -> LumpedDiagrams:
    from symcheck.engines.symbolic_lump import lump_diagrams

    colours: list[Any] = [engine.initial.bdd for name in observed.names if name == "init"]
    colours += [engine.deadlocks.bdd for name in observed.names if name == "deadlock"]
    for part in observed.expressions:
        if _is_set(context, part):
            colours.append(satisfying(replace(context, engine=engine), part, engine.all).bdd)  # type: ignore[attr-defined]
        else:
            colours += [engine.space.values(part), engine.space.symbolic.translator.undefined(part)]
    return lump_diagrams(engine.diagrams, colours, sorted(observed.structures), most=most)


def _is_set(context: Context, part: Expression) -> bool:
    # A model that was read has labels that are names of sets of states, which are no variables.
    return (isinstance(part, Name) and part.name.startswith('"')) or context.type(part) is Type.BOOL


def _observed(context: Context, formula: Expression) -> _Observed:
    found = _Observed()
    parts: tuple[Expression | None, ...] = (formula,)
    if isinstance(formula, Filter | StateFilter):
        condition = formula.states
        looked_up = condition is None or is_plain(condition) or isinstance(condition, LabelReference)
        parts = (formula.formula, None if looked_up else condition)
    for part in parts:
        if part is not None:
            _observe(context, part, found)
    return found


def _observe(context: Context, formula: Expression, found: _Observed) -> None:
    for part in _parts(context, formula):
        match part:
            case Filter() | StateFilter() | MultiObjective() | PathQuantifier():
                raise UnsupportedError("-bisim is not for filters within a formula, A and E, and multi(...)")
            case LabelReference("init" | "deadlock"):
                found.names.add(part.name)
            case RewardOperator() | RewardBound():
                if not (isinstance(part, RewardBound) and part.structure is None):
                    found.structures.add(reward_index(part.structure, context.engine.model))
            case _ if _is_combination(context, part):
                found.expressions.append(part)
            case _:
                pass


def _is_combination(context: Context, formula: Expression) -> bool:
    """Whether a formula is about the variables only, labels looked up: then only the whole tells states apart."""
    match formula:
        case LabelReference("init" | "deadlock"):
            return False
        case LabelReference():
            return _is_combination(context.inside(formula), context.referred(formula))
        case Unary("!", operand):
            return _is_combination(context, operand)
        case Binary("&" | "|" | "=>" | "<=>", left, right):
            return _is_combination(context, left) and _is_combination(context, right)
        case _:
            return is_plain(formula)


def _parts(context: Context, formula: Expression) -> Iterator[Expression]:
    """The largest expressions over variables only, the references to initial and deadlock states, and the operators above."""
    yield formula
    if _is_combination(context, formula):
        return
    if isinstance(formula, LabelReference):
        if formula.name not in ("init", "deadlock"):
            yield from _parts(context.inside(formula), context.referred(formula))
        return
    for child in children(formula):
        yield from _parts(context, child)  # type: ignore[arg-type]
