"""Properties of the chain of a strategy of a timed automaton: a step is a delay or a command.

Probabilities and rewards without a bound on time are those of the automaton. What would count steps
as time is refused: the reward structure of time counts it.
"""

from __future__ import annotations

from collections.abc import Mapping

from symcheck.errors import Diagnostic, UnsupportedError
from symcheck.semantics.model import Delays
from symcheck.syntax import ast
from symcheck.syntax.ast import Expression
from symcheck.syntax.traversal import Tree, with_labels

__all__ = ["refuse_steps"]

_OF_STEPS = (
    *(ast.Next, ast.SteadyState, ast.SteadyStateReward),
    *(ast.CumulativeReward, ast.InstantaneousReward, ast.DiscountedReward),
)


def refuse_steps(formula: Expression, labels: Mapping[str, Expression], delays: Delays) -> None:
    """Refuse a property that counts steps, or reads a clock; its names are resolved.

    Raises UnsupportedError.
    """
    for node in with_labels(formula, labels):
        if hint := _hint(node, delays):
            message = "this is not available for the chain of a strategy of a timed automaton: "
            reads = "clocks are counters of units in it"
            what = reads if isinstance(node, ast.Name) else "its steps are not units of time"
            raise UnsupportedError(Diagnostic(message + what, node.span, "delays", hint))


def _hint(node: Tree, delays: Delays) -> str:
    """What to write instead of an operator or name; '' if it is allowed."""
    match node:
        case ast.ExpectedTime():
            return f'R{{"{delays.time}"}}=? [ F … ] is the expected time'
        case ast.TimeBound() | ast.RewardBound(structure=None):
            return f'F^{{rew{{"{delays.time}"}}<=3}} bounds the time'
        case ast.Name(name) if name in delays.clocks:
            return "a label of the model may compare a clock"
        case _:
            rest = f'P and R [ F … ] with no bound but on rewards, such as rew{{"{delays.time}"}}'
            return f"{rest}, are" if isinstance(node, _OF_STEPS) else ""
