"""Commands of a DTMC that are enabled in the same state, among which a fair coin decides."""

from __future__ import annotations

from symcheck.engines.base import Engine
from symcheck.errors import Diagnostic
from symcheck.semantics.model import BoundCommand
from symcheck.semantics.state_faults import describe_state

__all__ = ["overlapping_commands"]

_STATES, _RATIONAL_STATES = 100_000, 1_000
"""States up to which commands are looked at: some hundredths of a second, or tenths by rationals,
which decide a guard state by state."""


def overlapping_commands(engine: Engine) -> list[Diagnostic]:
    """A warning for each command of a DTMC that is enabled in some state together with an earlier
    one of the same module and action.

    Larger models are not looked at, nor other types, in which a choice or a race is meant.

    Examples:
        >>> import symcheck
        >>> text = "dtmc module m x : [0..3]; [] x<3 -> (x'=x+1); [] x>1 -> (x'=0); endmodule"
        >>> print(overlapping_commands(symcheck.loads(text).engine)[0].message)
        in state (x=2), this command and an earlier one are enabled: a fair coin decides
    """
    model = engine.model
    most = _RATIONAL_STATES if engine.is_rational else _STATES
    if model.type.has_choices or model.type.continuous_time or engine.states > most:
        return []
    found = []
    for module in model.modules:
        groups: dict[str | None, list[BoundCommand]] = {}
        for command in module.commands:
            groups.setdefault(command.action, []).append(command)
        for commands in groups.values():
            if len(commands) == 1:
                continue
            seen = engine.none
            for command in commands:
                enabled = engine.where(command.guard)
                both = seen & enabled
                seen = seen | enabled
                if both:
                    values = next(iter(engine.valuations(both, 1)))
                    state = describe_state(model.variables, values)
                    found.append(_warning(command, state))
    return found


def _warning(command: BoundCommand, state: str) -> Diagnostic:
    return Diagnostic(
        f"in state {state}, this command and an earlier one are enabled: a fair coin decides",
        command.guard.span,
        "overlap",
        hint="make the guards exclude each other, or use the type mdp, in which a choice is open",
        severity="warning",
    )
