"""What stops time in a timed automaton, as a fault with an invariant as its place and a state."""

from __future__ import annotations

from enum import Enum

from symcheck.errors import NO_SPAN, Diagnostic, ModelFault, Span

__all__ = ["Stop", "time_stops"]

_ENABLE = "let a command be enabled {} the invariant ends, or let the invariant hold longer"


class Stop(Enum):
    """How time stops: code, message, and hint."""

    TIMELOCK = (
        "timelock",
        "time stops: neither may it pass, nor is a command enabled",
        _ENABLE.format("when"),
    )
    LIMIT = (
        "timelock",
        "time stops: it may pass up to a limit that is excluded, and no command is enabled before",
        _ENABLE.format("before"),
    )
    ZENO = (
        "zeno",
        "time cannot go on for ever: commands follow each other within a finite time",
        "let time pass in each cycle of commands: let one of them wait for a clock (x>=1) that "
        "one of them sets (x'=0)",
    )


def time_stops(stop: Stop, state: str, span: Span | None) -> ModelFault:
    """The fault that time stops.

    Args:
        stop: how.
        state: where, as a text.
        span: of an invariant that does not let time pass for ever; None if none is known.
    """
    code, message, hint = stop.value
    message = f"{message}, for example from state {state}"
    return ModelFault(Diagnostic(message, span or NO_SPAN, code, hint))
