"""The result of a check: a value, its accuracy, and how it was computed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, fields
from fractions import Fraction
from math import inf, isinf, nextafter
from sys import float_info
from typing import TYPE_CHECKING, TypeVar, assert_never

from symcheck.engines.base import ROUNDING, Engine, bracket
from symcheck.engines.states import States, StateValues
from symcheck.errors import NoStrategyError, NotInResultError, UnsupportedError, UsageError
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rational_functions import FunctionField, RationalFunction
from symcheck.semantics.expressions.literals import format_state, format_value, to_float
from symcheck.semantics.features import BY_DIGITAL_CLOCKS
from symcheck.tables import Table

if TYPE_CHECKING:
    from symcheck.check.certificate import Certificate
    from symcheck.check.counterexample import Counterexample
    from symcheck.check.pareto_front import ParetoFront
    from symcheck.check.regions import Regions
    from symcheck.engines.explicit.strategy import Strategy

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
    "bounds_text",
    "nearest_double",
    "show_value",
]

T = TypeVar("T")
_WITHOUT_PROOF = "estimates have none, nor what is computed on a part of the states (truncate)"
Number = int | float | Fraction
Answer = bool | Number | RationalFunction | tuple[Number, Number] | list[tuple[Number, ...]] | None


@dataclass(frozen=True, slots=True)
class Exact:
    """The value is exact; with `rounding`, up to the rounding of single operations.

    Attributes:
        rounding: whether numbers were rounded.
        lower, upper: between which the true value lies then; None: within 1e-12, relatively.
    """

    rounding: bool = False
    lower: float | None = field(default=None, compare=False)
    upper: float | None = field(default=None, compare=False)

    def __str__(self) -> str:
        return "exact up to rounding" if self.rounding else "exact"


@dataclass(frozen=True, slots=True)
class Certified:
    """The true value is proved to lie between `lower` and `upper`; the result is their midpoint."""

    lower: float
    upper: float

    @property
    def epsilon(self) -> float:
        """The largest distance between the result and the true value."""
        distance = self.upper - self.lower
        return distance / 2 or distance  # half the least double is none

    def __str__(self) -> str:
        return f"certified: +/- {self.epsilon:.1E}"


@dataclass(frozen=True, slots=True)
class Estimate:
    """The iteration stopped when its change was below epsilon; the error is unknown."""

    def __str__(self) -> str:
        return "estimate"


UNIFORM = "under the uniform strategy, "
"""How the text of the accuracy of a `Statistical` begins that is `uniform`."""


@dataclass(frozen=True, slots=True)
class Statistical:
    """The interval [lower, upper] contains the true value with probability `confidence`.

    Attributes:
        bound: by whose theorem.
        approximate: the probability is that of the limit of many samples.
        uniform: the true value is that of the strategy that takes each choice of an MDP with equal
            probability, which lies between the minimum and the maximum.
    """

    confidence: float
    lower: float
    upper: float
    samples: int
    bound: str = ""
    approximate: bool = False
    uniform: bool = False

    def __str__(self) -> str:
        about = "about " if self.approximate else ""
        return (
            (UNIFORM if self.uniform else "")
            + f"in [{self.lower:.6g}, {self.upper:.6g}] with probability {about}"
            f"{self.confidence:.6g}, {self.samples} samples"
            + (f", by {self.bound}" if self.bound else "")
            + (", an approximation" if self.approximate else "")
        )


Accuracy = Exact | Certified | Estimate | Statistical


def nearest_double(value: Fraction) -> tuple[float, Accuracy]:
    """A number that is known without error as a double, and how accurate that is."""
    near = to_float(value)
    if near == value:
        return near, Exact()
    if isinf(near) or abs(near) < float_info.min:  # no double is near
        return near, Certified(*bracket(value))
    return near, Exact(True, *bracket(value))


@dataclass(frozen=True, slots=True)
class Line:
    """A line of a print filter: index of a state, values of its variables, value of the formula."""

    index: int
    state: tuple[bool | int, ...]
    value: bool | Number

    def __str__(self) -> str:
        return f"{self.index}:{format_state(self.state)}={format_value(self.value)}"


@dataclass(frozen=True, slots=True)
class SolverRun:
    """One computation of a solver.

    Attributes:
        kind: 'linear', 'steps', 'transient', 'steady', 'exact', or 'graph' (without numbers).
        method: the name of the method.
        unknowns: the number of equations or states.
        iterations: iterations, products or rounds.
        explanation: how the method proceeded, in words.
        certified: whether its error is proved.
    """

    kind: str
    method: str
    unknowns: int
    iterations: int
    explanation: str = ""
    certified: bool = True


_PARTS = {
    "values": ("values per state", "a numeric property has them, such as P=? [ F x=1 ]"),
    "satisfying": ("satisfying states", "a property that is true or false has them"),
    "witness": ("witness", "E [ … ] that is true has a path, and A [ … ] that is false"),
    "regions": ("regions", "those of a model with parameters have them"),
    "function": ("function", "a number of a model with parameters is one, if there is one case"),
    "objectives": ("objectives", "an equilibrium has them: <<one:two>> max=? (P [ … ] + P [ … ])"),
    "front": ("Pareto front", "multi(Pmax=? [ … ], Pmax=? [ … ]) has one"),
}
"""Parts that only some results have: what they are, and which results have them."""

_STORMPY = {
    "at": "result.value is that of the initial state, result.values[i] that of state i",
    "get_values": "numpy.asarray(result.values) has the value of each state",
    "scheduler": "result.strategy, with the option strategy=True",
    "has_scheduler": "result.strategies is empty without one; the option strategy=True asks for it",
}
"""What stormpy calls the attributes of a result."""


@dataclass(frozen=True, eq=False)
class Result:
    """The result of one property.

    `float(result)`, `bool(result)` and `f"{result:.3f}"` read its value.

    Attributes:
        value: a bool, an int, a float (a Fraction in rational arithmetic), a pair (lowest, highest)
            over several initial states, a list of points (Pareto), or None (argmin and print
            filters as the outermost operator).
        accuracy: how close the value is to the true one.
        explanation: what the value refers to, such as the initial state.
        satisfying_or_none: `satisfying`; None if the formula is not boolean.
        values_or_none: `values`; None if the formula is not numeric.
        lines: the lines of print filters.
        runs: the computations of solvers.
        witness_or_none: `witness`; None if there is no such path.
        front_or_none: `front`; None if no Pareto front was asked for.
        objectives_or_none: `objectives`; None if no equilibrium was asked for.
        regions_or_none: `regions`; None of a model without parameters.
        strategies: with the option `strategy`, one that attains the value; of a Pareto query, one
            for each point of the value. Empty if there is none.
        no_strategy: why there is none, although one was asked for.
        warnings: one sentence each.
        notes: one sentence for what may surprise in the property or its value, and for each place
            where tools that round to doubles, such as PRISM, may read the model or the property
            differently.
        seconds: time of the check.
        engine: on which the property was checked.
        explain: finds a counterexample with at most so many paths.
        certify: finds a certificate.
    """

    value: Answer
    accuracy: Accuracy = field(default_factory=Exact)
    explanation: str = ""
    satisfying_or_none: States | None = field(default=None, repr=False)
    values_or_none: StateValues | None = field(default=None, repr=False)
    lines: tuple[Line, ...] = field(default=(), repr=False)
    runs: tuple[SolverRun, ...] = field(default=(), repr=False)
    witness_or_none: Sequence[Mapping[str, int | bool]] | None = field(default=None, repr=False)
    front_or_none: ParetoFront | None = field(default=None, repr=False)
    objectives_or_none: tuple[StateValues, ...] | None = field(default=None, repr=False)
    regions_or_none: Regions | None = field(default=None, repr=False)
    strategies: tuple[Strategy, ...] = field(default=(), repr=False)
    no_strategy: str | None = field(default=None, repr=False)
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    seconds: float = field(default=0.0, repr=False)
    engine: Engine | None = field(default=None, repr=False)
    explain: Callable[[int | None], Counterexample] | None = field(default=None, repr=False)
    certify: Callable[[], Certificate] | None = field(default=None, repr=False)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> object:
            """Only called for what does not exist. Raises AttributeError."""
            # The property has raised its error already, and Python has dropped it.
            if name == "strategy":
                raise self._no_strategy()
            if name in _PARTS:
                raise self._has_no(name)
            raise NotInResultError(f"a result has no attribute '{name}'", hint=_STORMPY.get(name))

    def counterexample(self, paths: int | None = None) -> Counterexample:
        """Likeliest paths, and few commands, that show why a bound is false, or true.

        See `symcheck.check.explanation.find.find_counterexample`.

        Args:
            paths: the most paths; None for 1000.

        Raises:
            UnsupportedError: the property is no bound on a probability or reward, or no set of
                paths shows its value.

        Examples:
            >>> import symcheck
            >>> die = symcheck.load("models/die/die.pm")
            >>> print(die.check("P<=0.13 [ F d=6 ]").counterexample().paths[0])
            (s=0, d=0) -> (s=2, d=0) -> (s=6, d=0) -> (s=7, d=6)
        """
        if paths is not None and paths < 0:
            raise UsageError(f"paths={paths}: expected a number of paths from 0")
        if self.explain is None:
            raise UnsupportedError("the result has no counterexample", hint=_WITHOUT_PROOF)
        return self.explain(paths)

    def certificate(self) -> Certificate:
        """What a third party needs to check the value without trusting symcheck.

        `symcheck.save_certificate` writes it with the model that it is about, for the command
        `symcheck-verify`.

        Raises:
            UnsupportedError: there are no certificates for such a property, or the model cannot be
                explored in rational arithmetic.
            NumericalError: no vectors were found that satisfy the inequalities.

        Examples:
            >>> import symcheck
            >>> from fractions import Fraction
            >>> die = symcheck.load("models/die/die.pm")
            >>> proof = die.check("P=? [ F d=6 ]").certificate()
            >>> low, high = proof.bounds[0]
            >>> low <= Fraction(1, 6) <= high
            True
        """
        if self.certify is None:
            raise UnsupportedError("the result has no certificate", hint=_WITHOUT_PROOF)
        return self.certify()

    @property
    def values(self) -> StateValues:
        """The value in each state. Raises NotInResultError unless the formula is numeric."""
        return self._part(self.values_or_none, "values")

    @property
    def satisfying(self) -> States:
        """The satisfying states. Raises NotInResultError unless the formula is boolean."""
        return self._part(self.satisfying_or_none, "satisfying")

    @property
    def witness(self) -> Sequence[Mapping[str, int | bool]]:
        """A path that shows why E holds, or why A does not. Raises NotInResultError without one."""
        return self._part(self.witness_or_none, "witness")

    @property
    def front(self) -> ParetoFront:
        """The Pareto front of a multi-objective query. Raises NotInResultError without one."""
        return self._part(self.front_or_none, "front")

    @property
    def objectives(self) -> tuple[StateValues, ...]:
        """The value of each objective of an equilibrium. Raises NotInResultError without one."""
        return self._part(self.objectives_or_none, "objectives")

    @property
    def regions(self) -> Regions:
        """The outcomes of a model with parameters, and where they hold. Raises NotInResultError."""
        return self._part(self.regions_or_none, "regions")

    @property
    def function(self) -> RationalFunction:
        """The value as a function of parameters. Raises NotInResultError if it is none."""
        value = self.value
        if self.regions_or_none is not None and isinstance(value, int | Fraction):
            if not isinstance(value, bool):  # that the graph decides
                value = FunctionField(tuple(self.regions.box)).constant(value)
        return self._part(value if isinstance(value, RationalFunction) else None, "function")

    def _part(self, part: T | None, name: str) -> T:
        if part is None:
            raise self._has_no(name)
        return part

    def _has_no(self, name: str) -> NotInResultError:
        noun, which = _PARTS[name]
        clocks = None if self.engine is None else self.engine.model.clocks
        if clocks is not None and not clocks.lists_states and name in ("values", "satisfying"):
            return NotInResultError(f"the result has no {noun} by zones", hint=BY_DIGITAL_CLOCKS)
        return NotInResultError(f"the result has no {noun}", hint=which)

    @property
    def strategy(self) -> Strategy:
        """The strategy that attains the value.

        Raises NoStrategyError, which is an AttributeError too, so that `hasattr` is False: none
        was asked for, there is none for this property, or a Pareto query has several.

        Examples:
            >>> import symcheck
            >>> game = symcheck.load("models/gambler/stakes.nm", strategy=True)
            >>> print(game.check("Pmax=? [ F money=8 ]").strategy.actions[3])
            stake1
        """
        if len(self.strategies) != 1:
            raise self._no_strategy()
        return self.strategies[0]

    def _no_strategy(self) -> NoStrategyError:
        """The error that says why there is no strategy."""
        if self.strategies:
            return NoStrategyError(
                "the result has a strategy for each point of a Pareto front",
                hint="result.strategies[0] is that of the first point",
            )
        if self.no_strategy is not None:
            return NoStrategyError(f"the result has no strategy: {self.no_strategy}")
        if self.engine is not None and not self.engine.model.type.has_choices:
            kind = self.engine.model.type.value.upper()
            return NoStrategyError(
                "the result has no strategy: strategies exist only for MDPs, "
                f"and this model is a {kind}"
            )
        return NoStrategyError(
            "the result has no strategy",
            hint="the option strategy=True computes one where a value is that of one strategy, such"
            " as Pmax=?, Rmin=? and Smax=? of an MDP: model.with_options(strategy=True).check(…)",
        )

    @property
    def bounds(self) -> tuple[Number, Number]:
        """Numbers between which the true value lies (with its confidence, if it is statistical).

        An exact value is both of them. Bounds of one that is exact up to rounding enclose what was
        rounded, of the numbers in the text too. Over several initial states they enclose all
        values. Raises TypeError if the value is no number or range, and UnsupportedError for an
        estimate, whose error is unknown.
        """
        match self.value:
            case bool() | None | list() | RationalFunction():
                raise self._wrong_type("a number")
            case tuple():
                low, high = self.value
                if not all(isinstance(end, Number) for end in self.value):
                    raise self._wrong_type("a number")
            case int() | float() | Fraction():
                low = high = self.value
            case _:
                assert_never(self.value)
        match self.accuracy:
            case Exact(True, float(lower), float(upper)):
                return lower, upper
            case Exact(True):
                low, high = float(low), float(high)
                return low - abs(low) * ROUNDING, high + abs(high) * ROUNDING
            case Exact():
                return low, high
            case Certified(lower, upper):
                if isinstance(self.value, tuple):
                    epsilon = self.accuracy.epsilon
                    return nextafter(low - epsilon, -inf), nextafter(high + epsilon, inf)
                return lower, upper
            case Statistical():
                return self.accuracy.lower, self.accuracy.upper
            case Estimate():
                raise UnsupportedError(
                    "an estimate has no bounds", hint="certify=True, the default, proves bounds"
                )
            case _:
                assert_never(self.accuracy)

    def _wrong_type(self, expected: str) -> TypeError:
        return TypeError(f"{expected} is expected, and the value of this result is {self}")

    def __bool__(self) -> bool:
        if isinstance(self.value, bool):
            return self.value
        raise self._wrong_type("true or false")

    def __eq__(self, other: object) -> bool:
        """Whether it is the same result. Comparing it with a number or bool raises TypeError.

        A number alone has no accuracy, so `result == 0.5` would mislead.
        """
        if not isinstance(other, Number | tuple):  # a bool is an int
            return NotImplemented
        hint = (
            f"result.value == {other}"
            if isinstance(other, bool)
            else f"result.value == {other}, or float(result) == pytest.approx({other})"
        )
        raise TypeError(f"a result has a value and an accuracy; compare its value: {hint}")

    __hash__ = object.__hash__

    def __float__(self) -> float:
        if isinstance(self.value, bool) or not isinstance(self.value, Number):
            raise self._wrong_type("a number")
        return to_float(self.value)

    def __format__(self, spec: str) -> str:
        return format(float(self), spec) if spec else str(self)

    def _repr_html_(self) -> str:
        rows = [
            ("value", show_value(self.value)),
            ("accuracy", self.accuracy),
            ("", self.explanation),
            ("method", self.method),
            *(("warning", w) for w in self.warnings),
            *(("note", n) for n in self.notes),
        ]
        return Table.of(("", ""), [r for r in rows if r[1]])._repr_html_()

    @property
    def iterations(self) -> int:
        """Iterations of all numerical computations together."""
        return sum(r.iterations for r in self.runs)

    @property
    def method(self) -> str:
        """The numerical methods that were used, in order; empty if graph analysis was enough."""
        return ", ".join(dict.fromkeys(r.method for r in self.runs))

    @property
    def by_steps(self) -> bool:
        """Whether the only computation was a product with the matrix per step of the property."""
        kinds = [r.kind for r in self.runs if r.kind != "graph"]
        return bool(kinds) and all(k == "steps" for k in kinds)

    def __repr__(self) -> str:
        """The fields; a fraction that is too long for Python's is the text of the value."""

        def shown(value: object) -> str:
            try:
                return repr(value)
            except ValueError:
                return show_value(self.value)

        parts = (f"{f.name}={shown(getattr(self, f.name))}" for f in fields(self) if f.repr)
        return f"Result({', '.join(parts)})"

    def __str__(self) -> str:
        if self.regions_or_none is not None and self.value is None:
            return "by regions"
        shown = show_value(self.value)
        return (
            shown
            if isinstance(self.value, bool) or self.value is None
            else f"{shown} ({self.accuracy})"
        )


def bounds_text(result: Result) -> str:
    """The bounds of a value as `[low, high]`; "" for a value without, or with two equal ones."""
    try:
        low, high = result.bounds
    except (TypeError, UnsupportedError):
        return ""
    return "" if low == high else f"[{format_value(low)}, {format_value(high)}]"


def show_value(value: Answer) -> str:
    """A result's value: a number, `true`, `[low,high]`, or a list of points."""
    match value:
        case None:
            return "none"
        case tuple():
            return f"[{format_value(value[0])},{format_value(value[1])}]"
        case list():
            return "[" + ", ".join(f"({','.join(map(format_value, p))})" for p in value) + "]"
        case bool() | int() | float() | Fraction():
            return format_value(value)
        case RationalFunction():
            return str(value)
        case _:
            assert_never(value)
