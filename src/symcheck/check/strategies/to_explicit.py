"""The explicit engine for a model of another engine, for algorithms that need rows.

They take it from here. The others that ask for this capability choose by it what is cheaper, and
list no rows: bisimulation has an algorithm for rows and one for diagrams, and a result on rows is
lifted to the diagrams that they are those of.
"""

from __future__ import annotations

from symcheck.check import tuning
from symcheck.check.context import Context
from symcheck.engines.base import Engine, erased
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.registry import on_rows
from symcheck.errors import UnsupportedError
from symcheck.machine import available_memory

__all__ = ["check_rows_fit", "rows_engine", "to_explicit"]


def check_rows_fit(
    engine: Engine, what: str, hint: str = "", *, most: int | None = tuning.LISTED_ROWS
) -> None:
    """Check that the rows of all states can be listed, before anything is computed.

    They must fit into the free memory. An explicit engine has them already.

    Args:
        engine: the built model.
        what: what needs the rows, for the message.
        hint: what to do instead, for the message.
        most: the most states, choices and transitions together; None for no limit.

    Raises:
        UnsupportedError: they do not fit, or are too many.
    """
    if engine.capability(ExplicitEngine) is not None:
        return
    size = tuning.EXPLICIT_ENTRY_BYTES * engine.transitions + tuning.EXPLICIT_ROW_BYTES * (
        engine.states + engine.choices
    )
    free = available_memory()
    if size > free:
        raise UnsupportedError(
            f"{what} the rows of all {engine.states:,} states, which take about "
            f"{size / 1e9:,.1f} GB, and {free / 1e9:,.1f} GB are free",
            hint=hint,
        )
    if most is not None and engine.states + engine.choices + engine.transitions > most:
        raise UnsupportedError(
            f"{what} the rows of all {engine.states:,} states; with {engine.transitions:,} "
            "transitions they take minutes",
            hint=f"{hint}{'; ' * bool(hint)}-ex (engine='explicit') lists them nevertheless",
        )


def to_explicit(context: Context) -> Context:
    """The context with an explicit engine: the rows of diagrams are listed.

    Raises UnsupportedError: see `check_rows_fit`.
    """
    check_rows_fit(context.engine, "this query needs", most=None)
    engine = erased(rows_engine(context))
    if engine is context.engine:
        return context
    return context.on(engine)


def rows_engine(context: Context) -> ExplicitEngine:
    """The explicit engine of a context: its own, or rows that are listed, whatever their size."""
    return on_rows(context.engine, context.options)
