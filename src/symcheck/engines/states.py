"""States, sets of states and values of states, as users see them: by number and by name."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import field
from functools import cached_property
from sys import maxsize
from typing import TYPE_CHECKING, ClassVar, TypeVar, overload

import numpy as np
from numpy.typing import DTypeLike, NDArray

from symcheck.engines import tuning
from symcheck.engines.base import Engine, StateSet, Values
from symcheck.errors import UnsupportedError
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.numbers import Numbers, doubles, is_rational
from symcheck.matrices.rows import Bools, Int64s
from symcheck.semantics.diagnostics import suggest
from symcheck.semantics.expressions.literals import format_state, format_value
from symcheck.semantics.model import BoundModel
from symcheck.semantics.state_faults import describe_state
from symcheck.syntax.ast import Binary, Expression, Literal, Name, Type
from symcheck.syntax.operators import Operator
from symcheck.tables import SHOWN_ROWS, Columns, Table, Tabular, state_table

if TYPE_CHECKING:
    from fractions import Fraction

    from matplotlib.axes import Axes

__all__ = [
    "Named",
    "State",
    "StateKey",
    "StateValues",
    "StateVector",
    "States",
    "refuse_many",
    "variable_names",
]

T = TypeVar("T")
A = TypeVar("A", bound=NDArray[np.generic])


class Named(dict[str, T]):
    """Values by name, which suggests a name in place of an unknown one."""

    def __missing__(self, name: str) -> T:
        raise KeyError(_unknown(name, self))


def _unknown(name: str, names: Iterable[str]) -> str:
    near = suggest(str(name), names)
    return f"there is no {name!r}, " + (near or f"there are {', '.join(names) or 'none'}")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class State(Mapping[str, bool | int]):
    """A state: the values of the variables by name.

    Attributes:
        engine: the built model of the state.
        number: of the state among the reachable states, from 0.
        valuation: the values, in the order of the variables.
    """

    engine: Engine
    number: int
    valuation: tuple[bool | int, ...]

    def __getitem__(self, name: str) -> bool | int:
        names = variable_names(self.engine.model)
        if name in names:
            return self.valuation[names.index(name)]
        raise KeyError(_unknown(name, names))

    def __iter__(self) -> Iterator[str]:
        return iter(variable_names(self.engine.model))

    def __len__(self) -> int:
        return len(self.valuation)

    def __hash__(self) -> int:
        return hash(frozenset(self.items()))

    def __repr__(self) -> str:
        return f"({', '.join(f'{name}={format_value(value)}' for name, value in self.items())})"


StateKey = int | State | Mapping[str, bool | int] | tuple[bool | int, ...]
"""A state as an index: its number, or the values of all variables by name or in order."""


def variable_names(model: BoundModel) -> list[str]:
    """The names of the variables, in the order of the values of a state."""
    return [v.name for v in model.variables]


def refuse_many(count: int, noun: str = "states") -> None:
    """Raise UnsupportedError if there are too many to enumerate."""
    if count > tuning.LISTED_STATES:
        raise UnsupportedError(
            f"{count:,} {noun} are too many to list: at most {tuning.LISTED_STATES:,} are",
            hint="model.where(…) selects states, and `states[:10]` lists the first of them",
        )


def _one(engine: Engine, key: object) -> StateSet:
    """The set of the state with this valuation.

    Raises KeyError for one that is not reachable, TypeError for what is no valuation.
    """
    variables = engine.model.variables
    names = variable_names(engine.model)
    if isinstance(key, Mapping):
        if set(key) != set(names):
            raise KeyError(
                f"a state has values of {', '.join(names)}; given are those of {', '.join(key)}; "
                "model.where(…) selects states by a condition"
            )
        key = tuple(key[name] for name in names)
    if not isinstance(key, tuple) or len(key) != len(names):
        raise TypeError(
            f"a state is given by its number, or by the values of {', '.join(names)}, not {key!r}; "
            "model.where(…) selects states by a condition"
        )
    condition: Expression = Literal(True, Type.BOOL)
    for v, x in zip(variables, key, strict=True):
        if not isinstance(x, int | np.integer | np.bool):
            raise TypeError(f"{v.name}={x!r}: a variable has an integer or a truth value")
        value = Literal(bool(x) if v.type is Type.BOOL else int(x), v.type)
        condition = Binary(Operator.AND, condition, Binary(Operator.EQ, Name(v.name), value))
    if any(abs(int(x)) > maxsize for x in key) or not (states := engine.where(condition)):
        raise KeyError(f"the state {format_state(key)} of ({', '.join(names)}) is not reachable")
    return states


def _no_state(number: int, count: int) -> IndexError:
    """The error for an index that is neither from 0 nor a negative one, counted from the end."""
    return IndexError(f"state {number} of {count:,} states, which have the numbers from 0")


@dataclass(frozen=True, eq=False, repr=False)
class States(Tabular, Collection[State]):
    """A set of reachable states, in the order of their numbers.

    `|`, `&`, `-` and `~` are union, intersection, difference and complement; `<=` is inclusion. The
    states are listed only when they are asked for: `count` and set operations enumerate nothing.

    Examples:
        >>> import symcheck
        >>> model = symcheck.load("models/die/die.pm")
        >>> done = model.where("s=7")
        >>> len(done), done[0]["d"], done <= model.states
        (6, 1, True)
    """

    engine: Engine
    members: StateSet

    @property
    def count(self) -> int:
        """Number of states; `len` is limited to 2**63."""
        return self.members.count

    @property
    def initial(self) -> States:
        """The initial states among these."""
        return self._with(self.members & self.engine.initial)

    @property
    def numbers(self) -> Int64s:
        """The number of each state, int64[count], ascending."""
        refuse_many(self.count)
        return self.engine.numbers(self.members)

    @cached_property
    def mask(self) -> Bools:
        """Whether each reachable state of the model is in the set, bool[states], read-only."""
        refuse_many(self.engine.states)
        return _read_only(self.engine.to_bools(self.members))

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> Bools:
        return np.array(self.mask, dtype, copy=copy)

    def __len__(self) -> int:
        if self.count > maxsize:
            raise OverflowError(f"{self.count:,} states are too many for len; `count` has no limit")
        return self.count

    def __iter__(self) -> Iterator[State]:
        refuse_many(self.count)
        return self._listed(0, self.count)

    def _listed(self, start: int, stop: int) -> Iterator[State]:
        numbers = self.engine.numbers(self.members, stop - start, start).tolist()
        valuations = self.engine.valuations(self.members, stop - start, start)
        return (State(self.engine, n, v) for n, v in zip(numbers, valuations, strict=True))

    @overload
    def __getitem__(self, key: slice) -> list[State]: ...
    @overload
    def __getitem__(self, key: StateKey) -> State: ...
    def __getitem__(self, key: slice | StateKey) -> State | list[State]:
        if isinstance(key, slice):
            start, stop, step = key.indices(self.count)
            if step != 1:
                return list(self)[key]
            refuse_many(stop - start)
            return list(self._listed(start, max(start, stop)))
        if isinstance(key, int | np.integer) and not isinstance(key, bool):
            if not -self.count <= key < self.count:
                raise _no_state(key, self.count)
            index = int(key) % self.count
            return next(self._listed(index, index + 1))
        if isinstance(key, State) and key.engine is self.engine and key in self:
            return key
        result = self._with(self.members & _one(self.engine, key))
        if not result:
            raise KeyError(f"the state {key} is not in this set")
        return result[0]

    def __contains__(self, state: object) -> bool:
        if isinstance(state, State) and state.engine is self.engine and _few(self.engine):
            return bool(self.mask[state.number])
        try:
            return bool(self.members & _one(self.engine, state))
        except (KeyError, TypeError, ValueError):
            return False

    def __bool__(self) -> bool:
        return bool(self.members)

    def _with(self, members: StateSet) -> States:
        return States(self.engine, members)

    def members_of(self, other: object) -> StateSet:
        """The members of another set of the same model. Raises TypeError."""
        if not isinstance(other, States):
            raise TypeError(f"a set of states is expected, such as model.where(…), not {other!r}")
        if other.engine is not self.engine:
            raise TypeError("the sets are of different models: numbers of states differ")
        return other.members

    def __and__(self, other: States) -> States:
        return self._with(self.members & self.members_of(other))

    def __or__(self, other: States) -> States:
        return self._with(self.members | self.members_of(other))

    def __sub__(self, other: States) -> States:
        return self._with(self.members - self.members_of(other))

    def __invert__(self) -> States:
        return self._with(~self.members)

    def __le__(self, other: States) -> bool:
        return self.members <= self.members_of(other)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, States):
            return NotImplemented
        return other.engine is self.engine and other.members == self.members

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<States: {self.count:,} of {self.engine.states:,}>"

    def _table(self) -> Table:
        shown = self[: SHOWN_ROWS + 1] if self.engine.states <= maxsize else []
        rows = ((s.number, s.valuation) for s in shown)
        note = f"{self.count:,} of {self.engine.states:,} states"
        return state_table(variable_names(self.engine.model), rows, (), note)

    def columns(self) -> Columns:
        """The number of each state, and the values of each variable."""
        numbers, rows = self.numbers, list(self.engine.valuations(self.members))
        names = variable_names(self.engine.model)
        return {"state": numbers} | {n: [r[i] for r in rows] for i, n in enumerate(names)}


class StateVector(Tabular):
    """A number for each reachable state, known to lie between a lower and an upper bound.

    numpy takes it as an array: float64[states], or Fractions of rational arithmetic. It is indexed
    by the number of a state, by its valuation, by a slice, or by a set of states.
    """

    engine: Engine
    _noun: ClassVar[str] = "value"

    def at(self, states: StateSet) -> tuple[Numbers, Numbers]:
        """Lower and upper bounds over a set, in index order."""
        raise NotImplementedError

    def midpoints(self, states: StateSet) -> Numbers:
        """The number in each state of a set, in index order: the midpoint of its bounds."""
        low, high = self.at(states)
        if low is high:
            return low
        with np.errstate(invalid="ignore"):  # equal bounds may be infinite
            return np.where(low == high, low, low + (high - low) / 2)

    @cached_property
    def _bounds(self) -> tuple[Numbers, Numbers]:
        refuse_many(self.engine.states)
        return self.at(self.engine.all)

    @cached_property
    def array(self) -> Numbers:
        """The number in each state: the midpoint of its bounds; read-only."""
        refuse_many(self.engine.states)
        return _read_only(self.midpoints(self.engine.all))

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> Numbers:
        return np.array(self.array, dtype, copy=copy)

    def __len__(self) -> int:
        return self.engine.states

    @overload
    def __getitem__(self, key: slice | States) -> Numbers: ...
    @overload
    def __getitem__(self, key: StateKey) -> float | Fraction: ...
    def __getitem__(self, key: slice | States | StateKey) -> float | Fraction | Numbers:
        if isinstance(key, States):
            return self.midpoints(_all(self.engine).members_of(key))
        if isinstance(key, slice):
            return self.array[key]
        if isinstance(key, State) and key.engine is self.engine and _few(self.engine):
            key = key.number
        if isinstance(key, int | np.integer) and not isinstance(key, bool):
            if not -len(self) <= key < len(self):
                raise _no_state(key, len(self))
            index = int(key) % len(self)
            return _plain(self.array[index : index + 1])
        return _plain(self.midpoints(_one(self.engine, key)))

    def items(self) -> Iterator[tuple[State, float | Fraction]]:
        """Each state with its number."""
        return zip(_all(self.engine), self.array.tolist(), strict=True)

    def plot(self, axes: Axes | None = None, *, most: int = 30) -> Axes:
        """Plot the largest numbers as bars with their bounds, by matplotlib.

        Args:
            axes: where to draw; None: into new axes.
            most: the most bars. They stand in the order of the states.

        Raises:
            UnsupportedError: matplotlib is not installed.
        """
        from symcheck.charts import plot_bars

        values = doubles(self.array)
        chosen = np.sort(np.argsort(-values, kind="stable")[:most])
        states = _all(self.engine)
        names = [str(states[i])[1:-1] for i in chosen.tolist()]
        bounds = tuple(doubles(side)[chosen] for side in self._bounds)
        what = self._noun if len(names) == len(self) else f"{self._noun}: the {most} largest"
        return plot_bars(names, values[chosen], (bounds[0], bounds[1]), what, axes)

    def columns(self) -> Columns:
        """Number and variables of each state, its value, and bounds if they differ."""
        columns = {**_all(self.engine).columns(), self._noun: self.array}
        low, high = self._bounds
        if np.any(low != high):
            columns |= {"lower": low, "upper": high}
        return columns


def example(engine: Engine, states: StateSet) -> str:
    """The text of one of some states, for a message."""
    return describe_state(engine.model.variables, next(iter(engine.valuations(states, 1))))


def _few(engine: Engine) -> bool:
    """Whether an array with an entry per state may be made."""
    return engine.states <= tuning.LISTED_STATES


def _read_only(array: A) -> A:
    """The array, which may be a part of the engine, as one that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


def _all(engine: Engine) -> States:
    return States(engine, engine.all)


def _plain(values: Numbers) -> float | Fraction:
    """The only number of an array."""
    value: float | Fraction = values.tolist()[0]
    return value


@dataclass(frozen=True, eq=False, repr=False)
class StateValues(StateVector):
    """The values of a numeric property in all states.

    Bounds are proved, unless the result is an estimate. They are as close as `epsilon` asks for in
    the states that the result reads, and in all states with the option `everywhere`.

    Attributes:
        engine: of the states.
        of_engine: the values in the form of the engine.

    Examples:
        >>> import symcheck
        >>> values = symcheck.load("models/die/die.pm").check("P=? [ F d=6 ]").values
        >>> round(values[0], 6), values[{"s": 7, "d": 6}], max(values)
        (0.166667, 1.0, 1.0)
    """

    engine: Engine
    of_engine: Values = field(repr=False)

    def at(self, states: StateSet) -> tuple[Numbers, Numbers]:
        """Lower and upper bounds over a set of the engine, in index order."""
        low, high = self.of_engine.at(states)
        if self.engine.is_rational or not is_rational(low):
            return low, high
        low = doubles(low)  # values of an expression
        return low, low

    @property
    def lower(self) -> Numbers:
        """The lower bound in each state."""
        return self._bounds[0]

    @property
    def upper(self) -> Numbers:
        """The upper bound in each state."""
        return self._bounds[1]

    def __iter__(self) -> Iterator[float | Fraction]:
        return iter(self.array.tolist())

    def __repr__(self) -> str:
        return f"<StateValues: {self.engine.states:,} states>"

    def _table(self) -> Table:
        states = _all(self.engine)
        rows = ((s.number, s.valuation, self[s]) for s in states[: SHOWN_ROWS + 1])
        names = variable_names(self.engine.model)
        return state_table(names, rows, (self._noun,), f"{states.count:,} states")
