"""The result of explicit exploration: states, a sparse matrix and rewards."""

from __future__ import annotations

from typing import TYPE_CHECKING

from symcheck.explicit.compile import compile_expression
from symcheck.explicit.states import StateTable
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rows import Floats, Int32s, Int64s, SparseMatrix
from symcheck.semantics.expressions.vectorised import Column
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import Expression

if TYPE_CHECKING:
    from symcheck.explicit.orbits import Represented

__all__ = ["ExplicitModel"]


@dataclass(frozen=True, eq=False)
class ExplicitModel:
    """An explored model with n states, numbered lexicographically by the variables in declaration
    order.

    Attributes:
        matrix: probabilities (rates in a CTMC); the choices of an MDP are its row groups. Deadlocks
            have a loop of weight 1.
        choice_actions: int32[rows], index into `model.actions`; -1 for none, or for several in a
            row of a DTMC or CTMC; `RACE` for the rates of a Markov automaton.
        initial, deadlocks: int64 arrays of state numbers, ascending.
        state_rewards: per structure, float64[n].
        choice_rewards: per structure, float64[rows]: the transition rewards times probability
            (rate), summed over the row.
        levels: number of breadth-first levels, the initial states included.
        seconds: duration of the exploration.
        represented: if not None, the states are representatives of orbits, the matrix leads to the
            representatives of successors, and these are the counts of the whole model.
        terms: the most transitions of a row before those to the same state were added; None: that
            is not known.
        shares: whether choices of a DTMC may share its probability, other than by powers of 2.
        boundary: states that were not expanded and have a loop, int64, ascending; None: there are
            none, because the whole model was explored.
    """

    model: BoundModel
    states: StateTable
    matrix: SparseMatrix
    choice_actions: Int32s
    initial: Int64s
    deadlocks: Int64s
    state_rewards: list[Floats]
    choice_rewards: list[Floats]
    levels: int = 0
    seconds: float = 0.0
    represented: Represented | None = None
    terms: int | None = None
    shares: bool = True
    boundary: Int64s | None = None

    def __repr__(self) -> str:
        m = self.matrix
        choices = f", {m.rows} choices" if m.groups is not None else ""
        dead = f", {len(self.deadlocks)} deadlocks" if len(self.deadlocks) else ""
        return (
            f"ExplicitModel({self.model.type.value}: {len(self.states)} states "
            f"({len(self.initial)} initial){choices}, "
            f"{m.entries} transitions{dead}, {self.nbytes / 1e6:.1f} MB, {self.seconds:.3g} s)"
        )

    @property
    def nbytes(self) -> int:
        """Memory of all arrays, in bytes."""
        rewards = sum(r.nbytes for r in (*self.state_rewards, *self.choice_rewards))
        return self.states.rows.nbytes + self.matrix.nbytes + self.choice_actions.nbytes + rewards

    def evaluate(self, expression: Expression) -> Column:
        """The value of an expression over the variables in each state.

        Returns:
            bool[n], int64[n] or float64[n] by the type of the expression.

        Raises:
            ModelFault: it has no value in some state.
        """
        return evaluate_states(self.model, self.states, expression)


def evaluate_states(model: BoundModel, states: StateTable, expression: Expression) -> Column:
    """The value of an expression in each of the states."""
    return compile_expression(expression, model).run_packed(states.layout, states.rows)
