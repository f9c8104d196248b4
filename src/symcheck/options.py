"""What a run is asked to do: passed explicitly, no globals."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Options"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """Settings of a check.

    engine: 'auto', 'hybrid', 'mtbdd', 'sparse' or 'explicit'.
    method: 'auto' or the name of a method in `symcheck.numerics.linear.methods`.
    epsilon: width of the certified interval that is wanted, relative to the value (absolute below 1e-300).
    relative: False makes epsilon absolute.
    certify: False accepts an estimate (stop when the change is below epsilon).
    max_iterations: of one numerical solution.
    exact: rational arithmetic throughout.
    max_memory: of the diagram manager, in bytes.
    time_limit: of the whole run, in seconds.
    fix_deadlocks: give deadlock states a self-loop; False makes a deadlock an error.
    check_sums: False accepts probabilities that do not sum to 1.
    fairness: only fair strategies of an MDP are considered (each choice offered infinitely often is taken so).
    reduce: reset variables whose values nothing will read again (see `symcheck.semantics.reduction.reset_dead_variables`), before the model is built.
    strategy: find a strategy that attains the value (MDP): `Result.strategy`.
    bisim: check each formula on the quotient by the coarsest bisimulation that keeps what it speaks of.
    everywhere: find the answer to the accuracy wanted at every state, not only where the result reads it (the initial states, or
        those of a filter). Without it, large models may have wider bounds elsewhere, or undecided comparisons taken as false.
    order: variables from the top of the diagrams down (the rest follows as declared), or ('force',) or ('sift',): an order
        that is looked for. None: as declared. Another order numbers the states otherwise.
    ltl2da: program that makes automata of formulas of linear time, called with the names of a formula file and a HOA file.
    ltl2da_syntax: how it reads formulas: 'lbt', 'spin', 'spot' or 'rabinizer'.
    """

    engine: str = "auto"
    method: str = "auto"
    epsilon: float = 1e-6
    relative: bool = True
    certify: bool = True
    max_iterations: int = 1_000_000
    exact: bool = False
    max_memory: int | None = None
    time_limit: float | None = None
    fix_deadlocks: bool = True
    check_sums: bool = True
    fairness: bool = False
    reduce: bool = False
    strategy: bool = False
    bisim: bool = False
    everywhere: bool = False
    order: tuple[str, ...] | None = None
    ltl2da: str | None = None
    ltl2da_syntax: str = "lbt"
