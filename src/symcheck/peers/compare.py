"""`symcheck.compare`: the answers of a peer beside those of symcheck."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import Enum
from math import isfinite, isnan
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import overload

from symcheck.api.arguments import properties_file
from symcheck.api.loading import load
from symcheck.api.model import Model
from symcheck.check.property_instance import PropertyInstance
from symcheck.check.result import Answer, Estimate, Exact, Result, Statistical, show_value
from symcheck.constant_values import GivenValues, combinations, value_lists
from symcheck.errors import (
    Interrupted,
    MemoryLimitError,
    SymcheckError,
    TimeLimitError,
    UnsupportedError,
)
from symcheck.exchange.api_io import ImportedModel
from symcheck.matrices.rational_functions import RationalFunction
from symcheck.peers.programs import Answer as PeerAnswer
from symcheck.peers.programs import Peer, PeerError, Question, find_peer
from symcheck.semantics.binding.bind import split_constants
from symcheck.semantics.expressions.literals import to_float
from symcheck.semantics.features import Feature, require
from symcheck.syntax.ast import Expression, LabelReference
from symcheck.syntax.declarations import PropertiesFile
from symcheck.syntax.printer import pretty
from symcheck.syntax.traversal import Tree, nodes, transform
from symcheck.tables import Table, Tabular

__all__ = ["Agreement", "ComparedProperty", "Comparison", "compare", "compared"]

_ABSOLUTE = 1e-12

_WIDEST = 40
"""Characters of a cell in a line of the printed table; a longer cell takes several lines."""

_POINTS = 6
"""Points of a Pareto front in the printed table; its last words say how many there are more."""


class Agreement(Enum):
    """How two answers relate."""

    SAME = "same"
    DIFFERENT = "different"
    UNANSWERED = "unanswered"


@dataclass(frozen=True)
class ComparedProperty:
    """One property with two answers.

    Attributes:
        name: that of the property, or its text if it has none.
        constants: the given values of the constants, as texts.
        value: of symcheck, as in `Result`; None if there is none.
        bounds: between which the true value is proved to lie; None if nothing is proved, or the
            value is no number.
        peer_value: the answer of the peer; None if there is none.
        agreement: how they relate.
        explanation: which one is proved to be wrong, or why there is no answer.
    """

    name: str
    constants: Mapping[str, str]
    value: Answer
    bounds: tuple[float, float] | None
    peer_value: PeerAnswer | None
    agreement: Agreement
    explanation: str = ""

    @property
    def difference(self) -> float | None:
        """The value of the peer minus ours; of intervals, the larger one at the two ends."""
        ours = _ends(self.value)
        if ours is None or self.peer_value is None or isinstance(self.peer_value, bool):
            return None
        gaps = [b - a if b != a else 0.0 for a, b in zip(ours, self.peer_value, strict=True)]
        return max(gaps, key=abs)

    @property
    def title(self) -> str:
        """Name and constants."""
        given = ",".join(f"{n}={v}" for n, v in self.constants.items())
        return f"{self.name} ({given})" if given else self.name


@dataclass(frozen=True, repr=False)
class Comparison(Sequence[ComparedProperty], Tabular):
    """The properties of a model with the answers of symcheck and of a peer.

    `print` shows a table, `to_frame()` gives a data frame.
    """

    properties: tuple[ComparedProperty, ...]
    peer: str

    @overload
    def __getitem__(self, index: int) -> ComparedProperty: ...
    @overload
    def __getitem__(self, index: slice) -> Comparison: ...
    def __getitem__(self, index: int | slice) -> ComparedProperty | Comparison:
        if isinstance(index, slice):
            return replace(self, properties=self.properties[index])
        return self.properties[index]

    def __len__(self) -> int:
        return len(self.properties)

    def __repr__(self) -> str:
        return f"<Comparison with {self.peer}: {self.summary}>"

    @property
    def different(self) -> tuple[ComparedProperty, ...]:
        """The properties with different answers."""
        return tuple(p for p in self.properties if p.agreement is Agreement.DIFFERENT)

    @property
    def answered(self) -> bool:
        """Whether at least one property has two answers that can be compared."""
        return any(p.agreement is not Agreement.UNANSWERED for p in self.properties)

    @property
    def summary(self) -> str:
        """How many answers are the same, differ, or are missing, and who has not answered."""
        counts = [sum(p.agreement is a for p in self.properties) for a in Agreement]
        text = ", ".join(f"{n} {a.value}" for n, a in zip(counts, Agreement, strict=True))
        open_rows = [p for p in self.properties if p.agreement is Agreement.UNANSWERED]
        ours = sum(p.value is None for p in open_rows)
        theirs = len(open_rows) - ours
        who = [f"{n} by {x}" for n, x in ((ours, "symcheck"), (theirs, self.peer)) if n]
        return f"{text} ({', '.join(who)})" if who else text

    def _table(self) -> Table:
        rows = [
            (
                p.title,
                _shown(p.value),
                _shown_bounds(p.bounds),
                _shown(_plain(p.peer_value)),
                _shown_gap(p.difference),
                p.explanation or p.agreement.value,
            )
            for p in self.properties
        ]
        head = ("property", "symcheck", "bounds", self.peer, "difference", "")
        return replace(Table.of(head, rows, self.summary), widest=_WIDEST)

    def columns(self) -> dict[str, Sequence[object]]:
        """The fields of the properties by name; the first column numbers them from 1."""
        answers: dict[str, Sequence[object]] = {
            "lower": [p.bounds and p.bounds[0] for p in self],
            "upper": [p.bounds and p.bounds[1] for p in self],
            "peer": [_plain(p.peer_value) for p in self],
            "difference": [p.difference for p in self],
            "agreement": [p.agreement.value for p in self],
            "explanation": [p.explanation for p in self],
        }
        constants: dict[str, Sequence[object]] = {
            n if n not in answers else f"constant {n}": [p.constants.get(n) for p in self]
            for n in dict.fromkeys(n for p in self.properties for n in p.constants)
        }
        first: dict[str, Sequence[object]] = {
            "number": list(range(1, len(self) + 1)),
            "property": [p.name for p in self],
        }
        return {**first, **constants, "value": [p.value for p in self], **answers}


def compare(
    model: Model | str | Path,
    properties: str | Path | PropertiesFile,
    constants: GivenValues | None = None,
    *,
    peer: str = "storm",
    tolerance: float = 1e-6,
    time_limit: float = 300.0,
) -> Comparison:
    """Check properties with symcheck and with an installed peer, and compare the answers.

    Args:
        model: a file or a loaded model in the PRISM language.
        properties: a file, a text, or parsed properties.
        constants: values of the constants, as for `symcheck.experiment`.
        peer: "storm" (the package stormpy, or the program storm) or "prism" (the program prism),
            with its default settings; words after the name are switches of the program, as in
            "prism -explicit -epsilon 1e-9".
        tolerance: the largest difference, relative to the value, of answers that are the same.
        time_limit: seconds after which the peer is stopped, for each property.

    Raises:
        UsageError: the peer is not installed.
        SymcheckError: as for `symcheck.load`.

    Examples:
        >>> import symcheck
        >>> symcheck.compare("die.pm", "die.pctl", peer="storm")  # doctest: +SKIP
        <Comparison with Storm: 8 same, 0 different, 0 unanswered>
    """
    program = find_peer(peer)
    values = value_lists(constants)
    file = properties_file(properties)
    whole = model if isinstance(model, Model) else load(model)
    split = split_constants(whole.program, file, dict.fromkeys(values, ""))
    compared_properties = [
        row
        for choice in combinations({n: values[n] for n in split.of_model})
        for one in [whole.with_constants({**whole.given_constants, **choice})]
        for row in compared(
            one,
            one.instances(file, {n: values[n] for n in split.of_properties}),
            program,
            tolerance=tolerance,
            time_limit=time_limit,
        )
    ]
    return Comparison(tuple(compared_properties), program.name)


def compared(
    model: Model,
    instances: Sequence[PropertyInstance],
    peer: Peer,
    *,
    tolerance: float = 1e-6,
    time_limit: float = 300.0,
) -> Iterator[ComparedProperty]:
    """Check each property with symcheck and with a peer.

    A memory limit, of one or the other, leaves a property unanswered, and the next one is asked.

    Raises:
        UnsupportedError: the model has no commands.
        InputError: the model is faulty.
        ResourceError: the time limit was reached, or the user stopped the run.
    """
    if isinstance(model, ImportedModel):
        raise UnsupportedError("a peer reads the commands of a model, and this model has none")
    with suppress(MemoryLimitError):
        require(model.bound, Feature.COMPARISON)
        _ = model.engine  # a faulty model is an error of the run, and not of each property
    with TemporaryDirectory() as folder:
        for instance in instances:
            ours: Result | SymcheckError
            theirs: PeerAnswer | PeerError
            try:
                ours = model.check_instance(instance)
            except (TimeLimitError, Interrupted):
                raise
            except SymcheckError as error:
                ours = error
            try:
                theirs = peer.ask(_question(model, instance, Path(folder)), time_limit)
            except SymcheckError as error:  # or it has no such property, or that is faulty
                theirs = error if isinstance(error, PeerError) else PeerError(str(error))
            yield _compared(model, instance, ours, theirs, peer.name, tolerance)


def _question(model: Model, instance: PropertyInstance, folder: Path) -> Question:
    """The files and texts for a peer: the words of the user, as far as it can read them."""
    program, (formula, alone) = model.program, _standing_alone(model, instance)
    text = program.span.source.text
    if _is_foreign(text) or model.type is not program.type:
        text = pretty(replace(program, type=model.type))
    model_file, properties = folder / "model.prism", folder / "properties.props"
    model_file.write_text(text, encoding="utf-8")
    checked = instance.file.properties[instance.index]
    source = checked.span.source
    in_file = [p for p in instance.file.properties if p.span.source is source]
    number, words = in_file.index(checked) + 1, source.text
    if _is_foreign(words):
        number, words = 1, alone
    properties.write_text(words, encoding="utf-8")
    of_model = {n: str(v) for n, v in model.given_constants.items()}
    of_property = {n: str(v) for n, v in instance.relevant.items()}
    constants = {**of_model, **of_property}
    structures = [r.name for r in program.rewards]
    return Question(model_file, properties, number, formula, alone, structures, of_model, constants)


def _is_foreign(text: str) -> bool:
    """Whether a text is not in the PRISM language: JANI, or none at all."""
    return not text or text.lstrip().startswith("{")


def _standing_alone(model: Model, instance: PropertyInstance) -> tuple[Expression, str]:
    """A property and its text, without constants, labels and properties of its file."""
    file = instance.file
    parsed = file.properties[instance.index].formula
    named = {p.name for p in file.properties}
    refers = any(isinstance(n, LabelReference) and n.name in named for n in nodes(parsed))
    declares = file.constants or file.labels or file.formulas
    if not (declares or refers or _is_foreign(instance.text)):
        return parsed, instance.text
    bound, labels = instance.bind(model.with_options(exact=True).bound)
    definitions: dict[str, Expression] = {x.name: labels[x.name] for x in file.labels}

    def put(node: Tree) -> Tree:
        return definitions.get(node.name, node) if isinstance(node, LabelReference) else node

    formula: Expression = transform(bound.formula, put)
    return formula, pretty(formula)


def _compared(
    model: Model,
    instance: PropertyInstance,
    ours: Result | SymcheckError,
    theirs: PeerAnswer | PeerError,
    peer: str,
    tolerance: float,
) -> ComparedProperty:
    given = {**model.given_constants, **instance.relevant}
    value = ours.value if isinstance(ours, Result) else None
    bounds = _bounds(ours) if isinstance(ours, Result) else None
    answer = None if isinstance(theirs, PeerError) else theirs
    if isinstance(ours, SymcheckError):
        relation = Agreement.UNANSWERED, f"symcheck: {_first_line(ours)}"
    elif isinstance(theirs, PeerError):
        relation = Agreement.UNANSWERED, f"{peer}: {_first_line(theirs)}"
    else:
        relation = _relation(ours, bounds, theirs, peer, tolerance)
    constants = {n: str(v) for n, v in given.items()}
    return ComparedProperty(instance.title, constants, value, bounds, answer, *relation)


def _relation(
    ours: Result,
    bounds: tuple[float, float] | None,
    theirs: PeerAnswer,
    peer: str,
    tolerance: float,
) -> tuple[Agreement, str]:
    """How two answers relate, and which one is proved to be wrong."""
    if isinstance(ours.value, bool) and isinstance(theirs, bool):
        if ours.value is theirs:
            return Agreement.SAME, ""
        if isinstance(ours.accuracy, Estimate | Statistical):
            return Agreement.DIFFERENT, "undecided: the answer of symcheck is an estimate"
        return Agreement.DIFFERENT, f"{peer} is wrong: the answer of symcheck is proved"
    ends = _ends(ours.value)
    if ends is None or isinstance(theirs, bool):
        return Agreement.UNANSWERED, f"{peer} answers in another form"
    if all(_close(a, b, tolerance) for a, b in zip(ends, theirs, strict=True)):
        return Agreement.SAME, ""
    if bounds is None:
        return Agreement.DIFFERENT, "undecided: the value of symcheck is an estimate"
    proof = "proved up to rounding" if ours.accuracy == Exact(rounding=True) else "proved"
    if not theirs[0] >= bounds[0]:
        return Agreement.DIFFERENT, f"{peer} is too low: at least {bounds[0]:.10g} is {proof}"
    if not theirs[1] <= bounds[1]:
        return Agreement.DIFFERENT, f"{peer} is too high: at most {bounds[1]:.10g} is {proof}"
    if isinstance(ours.value, tuple):
        return Agreement.DIFFERENT, "undecided: the proved bounds enclose both intervals"
    return Agreement.SAME, f"{peer} is within the proved bounds"


def _close(ours: float, theirs: float, tolerance: float) -> bool:
    if ours == theirs or (isnan(ours) and isnan(theirs)):
        return True
    difference = abs(ours - theirs)
    return isfinite(difference) and difference <= tolerance * abs(ours) + _ABSOLUTE


def _ends(value: Answer) -> tuple[float, float] | None:
    """The lowest and highest value over the initial states; None for what is no number."""
    match value:
        case None | bool() | list() | RationalFunction():
            return None
        case tuple((low, high)):
            return to_float(low), to_float(high)
        case number:
            return to_float(number), to_float(number)


def _bounds(result: Result) -> tuple[float, float] | None:
    try:
        low, high = result.bounds
    except (TypeError, UnsupportedError):
        return None
    return to_float(low), to_float(high)


def _first_line(error: Exception) -> str:
    return str(error).partition("\n")[0]


def _plain(value: PeerAnswer | None) -> Answer:
    """A number instead of an interval of one."""
    if isinstance(value, tuple) and (value[0] == value[1] or any(map(isnan, value))):
        return value[0]
    return value


def _shown(value: Answer) -> str:
    """A value; of a front its first points, rounded, with spaces at which a line may end."""
    match value:
        case None:
            return ""
        case list() if value:
            shown = [f"({','.join(f'{to_float(x):.6g}' for x in p)})" for p in value[:_POINTS]]
            more = [f"… {len(value) - _POINTS} more"] * (len(value) > _POINTS)
            return f"[{', '.join([*shown, *more])}]"
        case _:
            return show_value(value)


def _shown_bounds(bounds: tuple[float, float] | None) -> str:
    if bounds is None:
        return ""
    digits = next((n for n in (6, 8, 10, 12, 14) if len({f"{b:.{n}g}" for b in bounds}) > 1), 17)
    return (
        "exact" if bounds[0] == bounds[1] else f"[{bounds[0]:.{digits}g}, {bounds[1]:.{digits}g}]"
    )


def _shown_gap(difference: float | None) -> str:
    return "" if difference is None else f"{difference:.2g}"
