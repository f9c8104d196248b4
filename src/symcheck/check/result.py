"""What a check gives back: a value, how accurate it is, and where it comes from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from symcheck.engines.base import Engine, StateSet, Values
from symcheck.semantics.expressions.literals import format_state, format_value

__all__ = [
    "Accuracy",
    "Answer",
    "Certified",
    "Estimate",
    "Exact",
    "Line",
    "Number",
    "Result",
    "SolverRun",
    "Statistical",
    "show_value",
]

Number = int | float | Fraction
Answer = bool | Number | tuple[Number, Number] | list[tuple[Number, Number]] | None


@dataclass(frozen=True, slots=True)
class Exact:
    """The value is right: logically, as a rational, or (`rounding`) up to the rounding of floating-point operations."""

    rounding: bool = False

    def __str__(self) -> str:
        return "exact up to rounding" if self.rounding else "exact"


@dataclass(frozen=True, slots=True)
class Certified:
    """The true value is proved to lie between `lower` and `upper`; the value given is in the middle."""

    lower: float
    upper: float

    @property
    def epsilon(self) -> float:
        """The largest distance between the value given and the true one."""
        return (self.upper - self.lower) / 2

    def __str__(self) -> str:
        return f"certified: +/- {self.epsilon:.1E}"


@dataclass(frozen=True, slots=True)
class Estimate:
    """The iteration stopped when its change was below epsilon, which proves nothing."""

    def __str__(self) -> str:
        return "estimate"


@dataclass(frozen=True, slots=True)
class Statistical:
    """The true value lies between `lower` and `upper` with probability `confidence`, which is over the random samples."""

    confidence: float
    lower: float
    upper: float
    samples: int

    def __str__(self) -> str:
        return f"in [{self.lower:.6g}, {self.upper:.6g}] with probability {self.confidence:.6g}, {self.samples} samples"


Accuracy = Exact | Certified | Estimate | Statistical


@dataclass(frozen=True, slots=True)
class Line:
    """A line that a print filter asks for: a state's index, its variable values and the formula's value there."""

    index: int
    state: tuple[bool | int, ...]
    value: bool | Number

    def __str__(self) -> str:
        return f"{self.index}:{format_state(self.state)}={format_value(self.value)}"


@dataclass(frozen=True, slots=True)
class SolverRun:
    """One numerical computation behind a result. `kind`: 'linear', 'steps', 'transient', 'steady', 'exact' or 'graph' (no numbers)."""

    kind: str
    method: str
    unknowns: int
    iterations: int
    seconds: float = 0.0
    explanation: str = ""
    certified: bool = True


@dataclass(frozen=True, eq=False)
class Result:
    """The answer to one property.

    value: a bool, an int, a float (a Fraction where arithmetic is rational), a pair (lowest, highest) over several initial
    states, a list of points (Pareto), or None where there is none (argmin and print filters as the outermost).
    satisfying: the states where a boolean formula holds; values: the numbers per state, of a numeric one.
    lines: what print filters ask to be printed. runs: the numerical computations. witness: a path that shows why.
    """

    value: Answer
    accuracy: Accuracy = field(default_factory=Exact)
    explanation: str = ""
    satisfying: StateSet | None = field(default=None, repr=False)
    values: Values | None = field(default=None, repr=False)
    lines: tuple[Line, ...] = field(default=(), repr=False)
    runs: tuple[SolverRun, ...] = field(default=(), repr=False)
    witness: Sequence[Mapping[str, int | bool]] | None = field(default=None, repr=False)
    strategy: Any = field(default=None, repr=False)
    warnings: tuple[str, ...] = ()
    seconds: float = field(default=0.0, repr=False)
    engine: Engine | None = field(default=None, repr=False)

    @property
    def iterations(self) -> int:
        """Iterations of all numerical computations together."""
        return sum(r.iterations for r in self.runs)

    @property
    def method(self) -> str:
        """The numerical methods used, in order; empty where graph analysis was enough."""
        return ", ".join(dict.fromkeys(r.method for r in self.runs))

    @property
    def by_steps(self) -> bool:
        """Whether the numbers come from as many products with the matrix as the property has steps, and nothing else."""
        kinds = [r.kind for r in self.runs if r.kind != "graph"]
        return bool(kinds) and all(k == "steps" for k in kinds)

    def __str__(self) -> str:
        shown = show_value(self.value)
        return (
            shown
            if isinstance(self.value, bool) or self.value is None
            else f"{shown} ({self.accuracy})"
        )


def show_value(value: Answer) -> str:
    """A result's value: a number, `true`, `[low,high]`, or a list of points."""
    match value:
        case None:
            return "none"
        case tuple():
            return f"[{format_value(value[0])},{format_value(value[1])}]"
        case list():
            return "[" + ", ".join(f"({format_value(x)},{format_value(y)})" for x, y in value) + "]"
        case _:
            return format_value(value)
