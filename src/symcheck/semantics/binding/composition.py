"""Flattening of the parallel composition: the events in which commands of modules synchronise.

A composition has a set of events and an alphabet. `A || B` synchronises on the actions in both
alphabets, `A |[a]| B` on the listed ones, `A ||| B` on none. On a synchronised action every event
of one operand joins every event of the other, and an action that only one operand has is blocked.
All other events of both operands are independent. Hiding makes events unlabelled; renaming may map
two actions to one. The alphabet of a module consists of the actions of its commands, whether or not
their guards are satisfiable.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import assert_never

from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.model import BoundCommand, BoundModule, Event
from symcheck.syntax.declarations import (
    Composition,
    Hiding,
    Interleaving,
    ModuleReference,
    Parallel,
    Renaming,
    Synchronised,
)

__all__ = ["events"]


@dataclass(frozen=True, slots=True)
class _Process:
    """The events and the alphabet (in order of first appearance) of a composition."""

    alphabet: dict[str, None]
    events: tuple[Event, ...]


def events(modules: Sequence[BoundModule], system: Composition | None = None) -> tuple[Event, ...]:
    """The events of a composition.

    Args:
        modules: the modules, bound.
        system: the composition; None: all modules in parallel, synchronised on shared actions.

    Returns:
        The unlabelled events in the order of the modules and commands, then the events by action;
        those that take time in a Markov automaton after all others.
    """
    named = {m.name: m for m in modules}
    if system is None:
        system = Parallel(tuple(ModuleReference(m.name) for m in modules))
    whole = _flatten(system, named)
    order: dict[str | None, int] = {None: -1} | {a: i for i, a in enumerate(whole.alphabet)}
    return tuple(sorted(whole.events, key=lambda e: (e.is_markovian, order[e.action])))


def _flatten(node: Composition, modules: Mapping[str, BoundModule]) -> _Process:
    match node:
        case ModuleReference(name):
            return _module(modules[name])
        case Parallel(operands) | Interleaving(operands):
            parts = [_flatten(o, modules) for o in operands]
            whole = parts[0]
            for part in parts[1:]:
                shared = (
                    whole.alphabet.keys() & part.alphabet.keys()
                    if isinstance(node, Parallel)
                    else ()
                )
                whole = _join(whole, part, frozenset(shared))
            return whole
        case Synchronised(left, right, actions):
            return _join(_flatten(left, modules), _flatten(right, modules), frozenset(actions))
        case Hiding(operand, actions):
            part = _flatten(operand, modules)
            return _relabel(part, dict.fromkeys(actions))
        case Renaming(operand, pairs):
            return _relabel(_flatten(operand, modules), dict(pairs))
        case _:
            assert_never(node)


def _module(module: BoundModule) -> _Process:
    alphabet = dict.fromkeys(c.action for c in module.commands if c.action is not None)
    unlabelled = [Event(None, ((c,),)) for c in module.commands if c.action is None]
    grouped: dict[tuple[str, bool], list[BoundCommand]] = {}
    for command in module.commands:
        if command.action is not None:
            grouped.setdefault((command.action, command.is_markovian), []).append(command)
    labelled = [Event(action, (tuple(commands),)) for (action, _), commands in grouped.items()]
    return _Process(alphabet, (*unlabelled, *labelled))


def _join(left: _Process, right: _Process, shared: frozenset[str]) -> _Process:
    alphabet = left.alphabet | right.alphabet
    apart = [e for e in (*left.events, *right.events) if e.action not in shared]
    partners: dict[str | None, list[Event]] = {}
    for event in right.events:
        partners.setdefault(event.action, []).append(event)
    synchronised = [
        Event(a.action, (*a.participants, *b.participants))
        for a in left.events
        if a.action in shared
        for b in partners.get(a.action, ())
    ]
    return _Process(alphabet, (*apart, *synchronised))


def _relabel(part: _Process, new: Mapping[str, str | None]) -> _Process:
    """Rename actions simultaneously; an action with the new name None is hidden."""
    alphabet = dict.fromkeys(b for b in (new.get(a, a) for a in part.alphabet) if b is not None)
    return _Process(
        alphabet,
        tuple(Event(e.action and new.get(e.action, e.action), e.participants) for e in part.events),
    )
