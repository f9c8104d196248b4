"""The options of a run, declared once.

Each field of `Options` states its type, default, accepted values, a sentence, and the switches of
the command line that set it. From this table come the switches, the keyword parameters of
`symcheck.load`, and the option page of the documentation.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, fields, replace
from fractions import Fraction
from typing import Literal, NamedTuple, TypedDict, TypeVar, cast, get_args

from symcheck.errors import UsageError
from symcheck.lazy_dataclass import dataclass
from symcheck.machine import read_bytes

__all__ = [
    "ENGINES",
    "METHODS",
    "OPTIONS",
    "EngineName",
    "MethodName",
    "Option",
    "OptionValues",
    "Options",
    "Switch",
    "make_options",
    "read_count",
    "read_fraction",
    "read_number",
    "read_options",
    "read_seconds",
]

T = TypeVar("T")

EngineName = Literal["auto", "explicit", "sparse", "hybrid", "mtbdd", "exact"]
MethodName = Literal[
    "auto",
    "topological",
    "policy",
    "interval",
    "optimistic",
    "power",
    "rational",
]
TimedMethodName = Literal["auto", "digital", "games", "backwards"]
AutomatonSyntax = Literal["lbt", "spin", "spot", "rabinizer"]
ENGINES: tuple[str, ...] = get_args(EngineName)
METHODS: tuple[str, ...] = get_args(MethodName)

_TIME_UNITS = {"": 1, "s": 1, "m": 60, "h": 3600, "d": 86400}


# ------------------------------------------------------------------------------ values


class ValueType(NamedTuple):
    """The values that an option accepts.

    expected: what a value has to be, for messages. accepts: whether a Python value is one.
    read: the value that a text of the command line denotes; raises ValueError with a message.
    names: all values, where these are names.
    """

    expected: str
    accepts: Callable[[object], bool]
    read: Callable[[str], object] = str
    metavar: str = ""
    names: tuple[str, ...] = ()


def read_number(text: str) -> float:
    """A number, such as 0.001, 1e-3 or 1/1000. Raises ValueError."""
    try:
        return float(Fraction(text) if "/" in text else text)
    except (ValueError, ZeroDivisionError, OverflowError):
        raise ValueError(f"'{text}' is not a number") from None


def read_count(text: str) -> int:
    """A whole number from 0, plain (10000) or in scientific notation (1e6). Raises ValueError."""
    value = read_number(text)
    if not 0 <= value < float("inf") or value != int(value):
        raise ValueError(f"'{text}' is not a whole number from 0")
    return int(text) if text.isdigit() else int(value)


def _at_least_one(value: int, message: str) -> int:
    if value == 0:
        raise ValueError(message)
    return value


def read_fraction(text: str) -> float:
    """A number between 0 and 1, both excluded. Raises ValueError."""
    value = read_number(text)
    if not 0 < value < 1:
        raise ValueError(f"'{text}' is not a number between 0 and 1")
    return value


def read_seconds(text: str) -> float:
    """Seconds from 90, 90s, 5m, 1h or 1d."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([smhd]?)", text.lower())
    if match is None:
        raise ValueError(f"'{text}' is not a time such as 90, 90s, 5m or 1h")
    seconds = float(match[1]) * _TIME_UNITS[match[2]]
    if seconds == 0:
        raise ValueError("no time at all is not enough; leave the switch out for no limit")
    return seconds


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_count(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _is_order(value: object) -> bool:
    return value is None or (
        isinstance(value, tuple) and bool(value) and all(isinstance(name, str) for name in value)
    )


def _choice(noun: str, names: tuple[str, ...], metavar: str = "NAME") -> ValueType:
    """One of some names."""
    listed = ", ".join(names)

    def read(text: str) -> str:
        if text in names:
            return text
        raise ValueError(f"there is no {noun} '{text}'; there are {listed}")

    return ValueType(f"one of {listed}", lambda value: value in names, read, metavar, names)


_FLAG = ValueType("True or False", lambda value: isinstance(value, bool))
_FLAG_OR_NONE = ValueType("True, False or None", lambda value: value in (None, True, False))
_TEXT = ValueType(
    "a text, or None", lambda value: value is None or isinstance(value, str), str, "PROGRAM"
)
_FOLDER = ValueType(
    "the name of a folder, or None",
    lambda value: value is None or isinstance(value, str),
    str,
    "DIR",
)
_FRACTION = ValueType(
    "a number between 0 and 1",
    lambda value: _is_number(value) and 0 < cast(float, value) < 1,
    read_fraction,
    "X",
)
_COUNT = ValueType("a whole number from 0", _is_count, read_count, "N")
_POSITIVE = ValueType(
    "a whole number from 1, or None",
    lambda value: value is None or (_is_count(value) and cast(int, value) > 0),
    lambda text: _at_least_one(read_count(text), "1 is the least number here"),
    "N",
)
_THREADS = _POSITIVE._replace(
    read=lambda text: _at_least_one(read_count(text), "there is at least one thread: this one")
)
_BYTES = ValueType(
    "a number of bytes, or None",
    lambda value: value is None or _is_count(value),
    read_bytes,
    "SIZE",
)
_SECONDS = ValueType(
    "a number of seconds above 0, or None",
    lambda value: value is None or (_is_number(value) and cast(float, value) > 0),
    read_seconds,
    "TIME",
)
_ORDER = ValueType(
    "a tuple of names of variables, ('force',), ('sift',), or None",
    _is_order,
    lambda text: tuple(text.split(",")) if text else None,
    "X,Y,…|force|sift",
)


# ------------------------------------------------------------------------------- table


class Switch(NamedTuple):
    """A switch of the command line that sets an option.

    names: with the usual one first, without dashes. help: one line of `symcheck --help`.
    value: what the option becomes; None if the value follows the switch.
    """

    names: tuple[str, ...]
    help: str
    value: object = None


class Option(NamedTuple):
    """One row of the table. type: its annotation. group: its part of `symcheck --help`."""

    name: str
    type: str
    default: object
    values: ValueType
    sentence: str
    group: str
    switches: tuple[Switch, ...]


def _switch(names: str, help: str, value: object = None) -> Switch:
    return Switch(tuple(names.split()), help, value)


def _option(default: T, values: ValueType, group: str, sentence: str, *switches: Switch) -> T:
    """The declaration of a field of `Options`."""
    metadata = {"values": values, "sentence": sentence, "group": group, "switches": switches}
    return field(default=default, metadata=metadata)


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """The options of a run. A value that an option does not accept is a UsageError."""

    engine: EngineName = _option(
        "auto",
        _choice("engine", ENGINES),
        "method",
        "How states, matrices and vectors are stored; 'auto' decides by the size of the model, "
        "and 'exact' is the same as `exact=True`.",
        _switch("m mtbdd", "mtbdd engine: diagrams for matrix and vectors", "mtbdd"),
        _switch(
            "h hybrid",
            "hybrid engine: diagrams for the matrix (as blocks), arrays for vectors",
            "hybrid",
        ),
        _switch("s sparse", "sparse engine: diagrams to build, then a sparse matrix", "sparse"),
        _switch("ex explicit", "explicit engine: no diagrams at all", "explicit"),
    )
    method: MethodName = _option(
        "auto",
        _choice("method", METHODS),
        "method",
        "Numerical method for linear equations; 'auto' decides by their structure.",
        _switch("method", "numerical method (default: chosen by structure)"),
    )
    exact: bool = _option(
        False,
        _FLAG,
        "method",
        "Compute with rational numbers throughout; decimals in the model are exact fractions.",
        _switch("exact", "rational arithmetic", True),
    )
    timed_method: TimedMethodName = _option(
        "auto",
        _choice("method", get_args(TimedMethodName)),
        "method",
        "How time in a timed automaton is treated: by digital clocks, or by zones ('backwards'), "
        "which also take strict constraints and compare clocks; 'auto' uses zones where digital "
        "clocks cannot be used. Stochastic games ('games') are not there: backwards is used.",
        _switch("ptamethod", "digital clocks or zones (default: zones where they are needed)"),
    )
    epsilon: float = _option(
        1e-6,
        _FRACTION,
        "method",
        "Width of the certified interval, relative to the value (absolute below 1e-300).",
        _switch("epsilon e", "width of the certified interval (default: 1e-6)"),
    )
    regions: float = _option(
        0.99,
        _FRACTION,
        "method",
        "Share of the volume of parameters that is to be decided.",
        _switch("regions", "share of the ranges of -param to be decided (default: 0.99)"),
    )
    lifting: bool = _option(
        False,
        _FLAG,
        "method",
        "Whether thresholds are decided over boxes of parameters by parameter lifting.",
        _switch("lifting", "decide regions of -param by lifting, not by functions", True),
    )
    relative: bool = _option(
        True,
        _FLAG,
        "method",
        "Whether `epsilon` is relative to the value; otherwise it is absolute.",
        _switch("relative rel", "epsilon is relative (default)", True),
        _switch("absolute abs", "epsilon is absolute", False),
    )
    max_iterations: int = _option(
        1_000_000,
        _COUNT,
        "method",
        "Largest number of iterations of one numerical solution.",
        _switch("maxiters", "largest number of iterations of one numerical solution"),
    )
    certify: bool = _option(
        True,
        _FLAG,
        "method",
        "Whether the error has to be proved; otherwise an iteration stops when values change by "
        "less than `epsilon`, and the result is an estimate.",
        _switch("estimate", "stop when values change little; faster, and certifies nothing", False),
    )
    fairness: bool = _option(
        False,
        _FLAG,
        "method",
        "Consider only fair strategies of an MDP: each choice that is offered infinitely often "
        "is taken infinitely often.",
        _switch("fair", "only fair strategies of an MDP", True),
        _switch("nofair", "all strategies (default)", False),
    )
    bisim: bool = _option(
        False,
        _FLAG,
        "method",
        "Check each property on the quotient by the coarsest strong bisimulation that preserves "
        "its labels and rewards.",
        _switch("bisim", "check on the quotient by strong bisimulation", True),
    )
    strategy: bool = _option(
        False,
        _FLAG,
        "method",
        "Compute a strategy of an MDP that attains the value: `Result.strategy` "
        "(implied by `-exportstrat`).",
    )
    everywhere: bool = _option(
        False,
        _FLAG,
        "method",
        "Reach the accuracy at every state, and not only at those that the result reads, the "
        "initial states or those of a filter (implied by `-exportvector`).",
    )
    grid_resolution: int | None = _option(
        None,
        _POSITIVE,
        "method",
        "Partially observed models: bounds use beliefs whose probabilities are multiples of one "
        "over this number. None: it grows until the bounds are close enough, or very many beliefs "
        "are explored.",
        _switch("gridresolution", "resolution of the grid of beliefs of a POMDP"),
    )
    beliefs: int | None = _option(
        None,
        _POSITIVE,
        "method",
        "Partially observed models: the most beliefs that are kept exactly. None: 32,000.",
        _switch("beliefs", "the most beliefs of a POMDP that are kept exactly"),
    )
    ltl2da: str | None = _option(
        None,
        _TEXT,
        "method",
        "External translator from LTL to automata, called with the names of a formula file and "
        "of a HOA file.",
        _switch(
            "ltl2datool", "external translator from LTL to automata: PROGRAM formula-file HOA-file"
        ),
    )
    ltl2da_syntax: AutomatonSyntax = _option(
        "lbt",
        _choice("syntax", get_args(AutomatonSyntax), "SYNTAX"),
        "method",
        "Syntax in which the external translator reads formulas.",
        _switch(
            "ltl2dasyntax",
            "syntax of formulas for it: lbt (default), spin, spot, rabinizer",
        ),
    )
    fix_deadlocks: bool = _option(
        True,
        _FLAG,
        "model",
        "Give each deadlock state a self-loop; otherwise a deadlock is an error.",
        _switch("fixdl", "give deadlocks a self-loop (default)", True),
        _switch("nofixdl", "a deadlock is an error", False),
    )
    check_sums: bool = _option(
        True,
        _FLAG,
        "model",
        "Whether probabilities have to sum to 1.",
        _switch("noprobchecks", "accept probabilities that do not sum to 1", False),
    )
    warn_unsatisfiable: bool = _option(
        True,
        _FLAG,
        "model",
        "Warn of guards, labels and conditions of properties that hold for no values of their "
        "variables.",
        _switch("nowarnunsatisfiable", "no warnings of conditions that never hold", False),
    )
    warn_blocked: bool = _option(
        True,
        _FLAG,
        "model",
        "Warn of actions on which modules never agree.",
        _switch("nowarnblocked", "no warnings of actions that never happen", False),
    )
    warn_renaming: bool = _option(
        True,
        _FLAG,
        "model",
        "Warn of copies of modules that rename misspelt names, or take two variables for one.",
        _switch("nowarnrenaming", "no warnings of doubtful renamings in copies of modules", False),
    )
    warn_overlaps: bool = _option(
        True,
        _FLAG,
        "model",
        "Warn of commands of a DTMC that are enabled in the same state.",
        _switch("nowarnoverlaps", "no warnings of commands of a DTMC that overlap", False),
    )
    reduce: bool = _option(
        False,
        _FLAG,
        "model",
        "Before the model is built, reset variables whose values are not read again: fewer "
        "states, the same answers.",
        _switch("reduce", "reset variables whose values are not read again: fewer states", True),
    )
    stop_at_targets: bool = _option(
        False,
        _FLAG,
        "model",
        "Explore no further than the properties need: not beyond targets of F and U, for example. "
        "The number of states is then that of a part of the model.",
        _switch("nostates", "explore the states that the properties need, not all of them", True),
    )
    symmetry: bool | None = _option(
        None,
        _FLAG_OR_NONE,
        "model",
        "Symmetry reduction: of states that differ by an exchange of equal modules, or by a "
        "rotation of a ring of them, only one is explored. It applies to explicit exploration (the "
        "engine explicit, or the default one from 50,000 states on) and to values at initial "
        "states: not to exports, strategies, counterexamples and lists of states, nor to "
        "properties that tell the modules apart. The default engine also leaves out variables on "
        "which the properties do not depend, if diagrams can count the states. None: on the "
        "command line where it applies, in Python nowhere.",
        _switch("symmetry", "explore one of the states that equal modules may exchange", True),
        _switch("nosymmetry", "explore every state", False),
    )
    truncate: bool | None = _option(
        None,
        _FLAG_OR_NONE,
        "model",
        "Whether probabilities and rewards with a bound on time or steps are computed on a part of "
        "the states, which grows until what leaves it is small enough: of models with very many "
        "states, or infinitely many. Without such a bound, the search ends at targets, or gives "
        "bounds on the value that may stay far apart. None: where a variable without bounds still "
        "grows after 250,000 states.",
        _switch("truncate", "explore the states that matter within the bounds on time", True),
        _switch("notruncate", "explore every state", False),
    )
    order: tuple[str, ...] | None = _option(
        None,
        _ORDER,
        "model",
        "Variables from the top of the diagrams down; the rest follows as declared. ('force',) "
        "and ('sift',) search for an order. The order also numbers the states.",
        _switch("order", "variables from the top of the diagrams down, or how to find an order"),
    )
    max_memory: int | None = _option(
        None,
        _BYTES,
        "model",
        "Largest memory of the diagrams or of an explicit search, in bytes.",
        _switch("cuddmaxmem", "largest memory of diagrams, or of an explicit search, such as 4g"),
    )
    workdir: str | None = _option(
        None,
        _FOLDER,
        "model",
        "Folder for files that hold large arrays, so that an explicit model may exceed the memory.",
        _switch("workdir", "keep large arrays in files in DIR: explicit models beyond the memory"),
    )
    threads: int | None = _option(
        None,
        _THREADS,
        "model",
        "Number of threads of one computation, which do not change its digits. None: as many as "
        "there are processors for this process, up to 4; one in a worker of an experiment and "
        "beside the main thread.",
        _switch("threads", "threads of one computation (default: one per processor, up to 4)"),
    )
    time_limit: float | None = _option(
        None,
        _SECONDS,
        "model",
        "Longest time of the run (in Python, of a call such as `check`), in seconds.",
        _switch("timeout", "longest time of the run, such as 90, 5m or 1h"),
    )

    def __post_init__(self) -> None:
        for option in OPTIONS:
            value = getattr(self, option.name)
            if not option.values.accepts(value):
                raise UsageError(_wrong_value(option, value))
        if self.engine == "exact":
            object.__setattr__(self, "exact", True)


class OptionValues(TypedDict, total=False):
    """The fields of `Options` as keyword parameters, for type checkers; a test compares them."""

    engine: EngineName
    method: MethodName
    timed_method: TimedMethodName
    exact: bool
    epsilon: float
    regions: float
    lifting: bool
    relative: bool
    max_iterations: int
    certify: bool
    fairness: bool
    bisim: bool
    strategy: bool
    everywhere: bool
    grid_resolution: int | None
    beliefs: int | None
    ltl2da: str | None
    ltl2da_syntax: AutomatonSyntax
    fix_deadlocks: bool
    check_sums: bool
    warn_unsatisfiable: bool
    warn_blocked: bool
    warn_renaming: bool
    warn_overlaps: bool
    reduce: bool
    stop_at_targets: bool
    symmetry: bool | None
    truncate: bool | None
    order: tuple[str, ...] | None
    max_memory: int | None
    workdir: str | None
    threads: int | None
    time_limit: float | None


OPTIONS: tuple[Option, ...] = tuple(
    Option(f.name, str(f.type), f.default, **f.metadata) for f in fields(Options)
)
Options.__doc__ = f"{Options.__doc__}\n\nArgs:\n" + "\n".join(
    f"    {o.name}: {o.sentence} Default: {o.default!r}." for o in OPTIONS
)
_DEFAULT = Options()


def make_options(values: Mapping[str, object], base: Options = _DEFAULT) -> Options:
    """`base` with other values; an engine also sets `exact`, unless that is given too.

    Raises:
        UsageError: an option is unknown, or a value is wrong.
    """
    known = [option.name for option in OPTIONS]
    for name in values:
        if name not in known:
            raise UsageError(
                f"there is no option '{name}'{_suggestion(name, known)}",
                hint=f"the options are {', '.join(known)}",
            )
    if "engine" in values and "exact" not in values:
        values = {**values, "exact": values["engine"] == "exact"}
    return replace(base, **cast("OptionValues", values))


def read_options(texts: Mapping[str, str]) -> dict[str, object]:
    """The values of options that are given as texts, such as {"epsilon": "1e-9"}.

    Raises:
        UsageError: an option is unknown, or a text is no value of it.
    """
    known = {option.name: option for option in OPTIONS}
    result: dict[str, object] = {}
    for name, text in texts.items():
        option = known.get(name)
        if option is None:
            make_options({name: text})  # raises the error
            continue
        truths = {"true": True, "false": False}
        try:
            is_truth = text.lower() in truths and option.values in (_FLAG, _FLAG_OR_NONE)
            result[name] = truths[text.lower()] if is_truth else option.values.read(text)
        except ValueError as error:
            raise UsageError(f"{name}: {error}") from None
    return result


def _wrong_value(option: Option, value: object) -> str:
    near = _suggestion(value, ENGINES + METHODS) if isinstance(value, str) else ""
    return f"{option.name}={value!r}: expected {option.values.expected}{near}"


def _suggestion(name: str, known: Sequence[str]) -> str:
    from difflib import get_close_matches

    near = get_close_matches(name, known, 1, 0.7)
    return f" (did you mean '{near[0]}'?)" if near else ""
