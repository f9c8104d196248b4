"""The partitioned transition relation: the events of a model, united where they touch the same
variables.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from symcheck.symbolic.encoding.variables import Encoding
from symcheck.symbolic.model import EncodedEvent, Relation

if TYPE_CHECKING:
    from symcheck.dd.manager import DiagramManager

__all__ = ["group_relations"]


def group_relations(
    manager: DiagramManager, encoding: Encoding, events: Sequence[EncodedEvent]
) -> tuple[Relation, ...]:
    """One relation per set of touched variables, sorted from the lowest topmost variable to the
    highest.
    """
    groups: dict[tuple[int, ...], list[int]] = {}
    for number, event in enumerate(events):
        if event.relation or event.evaluated is not None:
            groups.setdefault(event.touched, []).append(number)
    relations = [_united(manager, encoding, events, numbers) for numbers in groups.values()]
    return tuple(sorted(relations, key=lambda r: -r.top))


def _united(
    manager: DiagramManager,
    encoding: Encoding,
    events: Sequence[EncodedEvent],
    numbers: Iterable[int],
) -> Relation:
    """The union of events that touch the same variables."""
    numbers = tuple(numbers)
    touched = events[numbers[0]].touched
    relation = manager.disjunction([events[n].relation for n in numbers])
    variables = encoding.sorted(encoding.variables[i].name for i in touched)
    rows = [bit for v in variables for bit in v.rows]
    columns = [bit for v in variables for bit in v.columns]
    top = min((encoding.rank[v.name] for v in variables), default=len(encoding.variables))
    return Relation(relation, manager.transition(rows, columns), top, numbers, touched)
