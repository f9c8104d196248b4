"""A page of a model: text, state graph, simulator, diagrams, and a player for each stage."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, Unpack

from symcheck.check.context import Context
from symcheck.check.property_instance import PropertyInstance
from symcheck.check.result import Result, show_value
from symcheck.check.state_formulas import query_of
from symcheck.constant_values import GivenConstants, constant_values
from symcheck.direction import Direction
from symcheck.engines.base import Engine, StateSet
from symcheck.engines.states import States
from symcheck.errors import MemoryLimitError, SymcheckError, UnsupportedError, UsageError
from symcheck.options import MethodName, Options, OptionValues
from symcheck.page.document import JsonObject, JsonValue, document, fragment
from symcheck.semantics.features import Feature, require
from symcheck.semantics.path_formulas import UntilPath
from symcheck.semantics.query import PathProbability, ReachReward
from symcheck.semantics.rewards import Reward
from symcheck.semantics.timed.digital import require_states
from symcheck.semantics.timed.properties import has_states_of
from symcheck.symbolic.matrix.transitions import transitions
from symcheck.syntax.ast import ProbabilityOperator, RewardOperator
from symcheck.syntax.declarations import Program, PropertiesFile
from symcheck.syntax.parse import parse_properties, parse_properties_file
from symcheck.syntax.printer import pretty
from symcheck.teach.board import Board, Show
from symcheck.teach.construction import construction, construction_show
from symcheck.teach.fixpoints import fixpoint_show, prob0, prob1
from symcheck.teach.frontiers import frontiers, search_show
from symcheck.teach.source import diagrams_of
from symcheck.teach.vectors import (
    EquationsTrace,
    equations_show,
    plain,
    reward_trace,
    until_trace,
)
from symcheck.view.choice_graph import GivenModel
from symcheck.whole_file import write_whole

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, Mtbdd
    from symcheck.engines.symbolic.engine import SymbolicEngine
    from symcheck.symbolic.encoding.variables import Encoding

__all__ = ["Page", "PageModel", "model_page"]

_MOST_DIAGRAM_STATES = 5_000
"""States up to which a page has the stages on diagrams."""
_MOST_STEPS = 3000
"""Iterations of a method that are computed for a page."""


class PageModel(GivenModel, Protocol):
    """What a page needs of a model: `symcheck.Model`."""

    @property
    def program(self) -> Program:
        """The parsed text."""
        ...

    def with_options(self, **options: Unpack[OptionValues]) -> PageModel:
        """The model with other options."""
        ...

    def check_instance(self, instance: PropertyInstance) -> Result:
        """Check a property."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class Page:
    """A page to step through. It draws itself in a notebook.

    Attributes:
        data: its content (see `symcheck.page.document`).
    """

    data: Mapping[str, JsonValue] = field(repr=False)

    @property
    def html(self) -> str:
        """The page as one HTML file that needs no network."""
        return document(self.data)

    def save(self, path: str | Path) -> None:
        """Write the page. Raises UsageError or OutputError if it cannot be written."""
        text = self.html
        write_whole(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))

    def __repr__(self) -> str:
        return f"<Page: {self.data['title']}, {len(self.data['shows'])} pictures and players>"

    def _repr_html_(self) -> str:
        return fragment(self.data, height=760)


def model_page(
    model: PageModel,
    properties: str | Path | PropertiesFile | Sequence[str] = (),
    constants: GivenConstants | str | None = None,
    *,
    max_states: int | None = None,
    title: str = "",
) -> Page:
    """A page of a model and its properties.

    The model is explored state by state, and its properties are checked in all states.

    Args:
        model: the model.
        properties: a text or texts, a file (a Path), or a parsed file.
        constants: one value for each constant that the properties leave open.
        max_states: the most states that are drawn, those nearest to the initial states; None: all
            states up to 60, and of more as many as fit a window, up to 24. The simulator knows 500,
            or as many as are drawn.
        title: the heading; '' for the names of the modules.

    Raises:
        SymcheckError: the model cannot be built, or the properties cannot be read. A property that
            cannot be checked is on the page with its error.

    Examples:
        >>> model_page(model, "P=? [ F d=6 ]").save("die.html")  # doctest: +SKIP
    """
    bound = model.bound
    require_states(bound)
    require(bound, Feature.PAGES)
    explicit = model.with_options(
        engine="explicit",
        bisim=False,
        reduce=False,
        order=None,
        everywhere=True,
        strategy=bound.type.has_choices and not model.options.exact,
    )
    file = _properties(properties)
    given = constant_values(constants)
    instances = [PropertyInstance(file, i, given) for i in range(len(file.properties))]
    numbers = "0.000…0.000" if instances else ""
    writer = _Writer(explicit, Board(explicit.engine, max_states, numbers))
    return writer.page(instances, title or _title(model.program))


def _properties(properties: str | Path | PropertiesFile | Sequence[str]) -> PropertiesFile:
    match properties:
        case PropertiesFile():
            return properties
        case Path():
            return parse_properties_file(properties)
        case str():
            return parse_properties(properties)
        case Sequence() if all(isinstance(text, str) for text in properties):
            return parse_properties("\n".join(properties))
        case _:
            raise UsageError(f"properties are texts or a file, not {properties!r}")


@dataclass(frozen=True, eq=False)
class _Writer:
    """Collects what a page shows. `model` is explicit."""

    model: PageModel
    board: Board
    shows: list[Show] = field(default_factory=list)
    strategies: list[JsonObject] = field(default_factory=list)

    def page(self, instances: Sequence[PropertyInstance], title: str) -> Page:
        board, engine, bound = self.board, self.model.engine, self.model.bound
        drawn, listed, total = len(board.drawn), len(board.listed), engine.states
        left_out = (
            ""
            if drawn == total
            else f"Pictures show the {drawn} states of {total:,} that are nearest to the initial "
            f"states, and the simulator knows {listed:,}. Results are those of the whole model."
        )
        states = {"title": f"{drawn} states", "note": left_out}
        shows = self.shows
        shows.append(self._on_states("State graph", "", states))
        properties = [self._property(instance) for instance in instances]
        how = "Take a transition by its button, or let chance or a strategy choose (→, Space)."
        shows.insert(1, {**self._on_states("Simulator", how, {}), "play": "simulator"})
        shows[1]["keys"] = [
            ["now", "current state"],
            ["in", "visited"],
            ["taken", "last transition"],
        ]
        for entry in properties:
            entry["show"] = None if entry["show"] is None else entry["show"] + 1
        has_diagrams = total <= _MOST_DIAGRAM_STATES and (bound.events or self._is_sorted())
        symbolic = self._diagrams() if has_diagrams else None
        for instance, entry in zip(instances, properties, strict=True):
            if entry["value"] != "error":
                stages = self._stages(instance, symbolic)
                shows.extend({**show, "group": instance.title} for show in stages)
        choices = {} if not bound.type.has_choices else {"choices": f"{engine.choices:,}"}
        facts = {
            "type": bound.type.name,
            "states": f"{total:,}",
            **choices,
            "transitions": f"{engine.transitions:,}",
            "constants": ", ".join(f"{n}={v}" for n, v in bound.constants.items()),
            "left out": left_out,
        }
        data = board.data()
        data["model"]["strategies"] = self.strategies
        return Page(
            {
                "title": title,
                "facts": [[name, text] for name, text in facts.items() if text],
                "text": _text(self.model.program) if bound.events else "",
                "properties": properties,
                "shows": shows,
                **data,
            }
        )

    def _on_states(self, name: str, note: str, frame: Mapping[str, JsonValue]) -> Show:
        return {"name": name, "note": note, "panes": self.board.panes, "frames": [frame]}

    def _property(self, instance: PropertyInstance) -> JsonObject:
        """The line of a property; its values become a picture."""
        text, title = instance.full_title, instance.title
        try:
            result = self.model.check_instance(instance)
        except SymcheckError as error:
            return {"text": text, "value": "error", "detail": str(error), "show": None}
        detail = "; ".join(filter(None, (str(result.accuracy), result.explanation)))
        value = show_value(result.value)
        entry: JsonObject = {"text": text, "value": value, "detail": detail, "show": None}
        engine, frame = result.engine, None
        if engine is not None and not has_states_of(engine.model, self.model.bound):
            entry["detail"] = f"{detail}; checked on {engine.states} other states: no picture"
        else:
            frame = self._values(instance, result)
        if frame is not None:
            entry["show"] = len(self.shows)
            show = self._on_states("Values", "", {**frame, "title": str(result)})
            show["group"] = title
            keys = {
                "rows": ["chosen", "the strategy"],
                "marks": ["in", "the states where it holds"],
            }
            show["keys"] = [key for part, key in keys.items() if part in frame]
            self.shows.append(show)
        return entry

    def _values(self, instance: PropertyInstance, result: Result) -> JsonObject | None:
        """What a result says about the states."""
        listed = self.board.listed
        if result.satisfying_or_none is not None:
            return {"marks": self.board.marks("in", self.board.names(result.satisfying.mask))}
        if result.values_or_none is None:
            return None
        frame: JsonObject = {"low": [plain(v) for v in result.values.array[listed].tolist()]}
        if len(result.strategies) == 1 and result.strategy.memory is None:
            rows = result.strategy.rows[listed].tolist()
            matters = result.strategy.matters[listed].tolist()
            frame["rows"] = [row for row, needed in zip(rows, matters, strict=True) if needed]
            self.strategies.append({"name": instance.title, "rows": rows, "values": frame["low"]})
        return frame

    def _is_sorted(self) -> bool:
        """Whether a model without commands numbers its states as its diagrams do."""
        states = [tuple(state.values()) for state in States(self._explicit, self._explicit.all)]
        return all(before < after for before, after in pairwise(states))

    def _diagrams(self) -> SymbolicEngine | None:
        """Add search, construction, and the diagrams of states and matrix. Where there is no CUDD,
        the page has the sets and says what the rest needs.

        Returns:
            The engine of prob0 and prob1, or None if there is none.
        """
        symbolic = None
        title = "This model has no diagrams."
        try:
            space, symbolic = diagrams_of(self.model)
            encoding = space.symbolic.encoding
            search = list(frontiers(space.symbolic, frames=1000))
            self.shows.append(search_show(search, self.board))
            if self.model.bound.events:
                built = list(construction(space, self.model.options))
                self.shows.append(construction_show(built, self.board))
            self.shows.extend(self._pictures("Reachable states", space.states, encoding))
            title = "The matrix is not drawn."
            matrix = symbolic.diagrams if symbolic else transitions(space, self.model.options)
            roots = list(matrix.roots)
            for i, root in enumerate(roots):
                name = f"Matrix, choice class {i + 1}" if len(roots) > 1 else "Matrix"
                self.shows.extend(self._pictures(name, root, encoding))
        except (UnsupportedError, MemoryLimitError) as error:
            frame = {"title": title, "note": str(error)}
            self.shows.append(self._on_states("Diagrams", "", frame))
        return symbolic

    def _pictures(self, name: str, diagram: Bdd | Mtbdd, encoding: Encoding) -> Iterator[Show]:
        """A diagram with a node per variable, and with a node per bit."""
        for bits, how in ((False, "variables"), (True, "bits")):
            drawn = self.board.diagram([diagram], encoding, bits=bits, title=name)
            count = f"{diagram.node_count} nodes in memory"
            note = count if drawn.panes else f"{count}: too many to be drawn."
            frame = {"title": name, "note": note}
            yield {
                "name": f"{name} as a diagram ({how})",
                "panes": drawn.panes,
                "frames": [frame],
            }

    def _stages(
        self, instance: PropertyInstance, symbolic: SymbolicEngine | None
    ) -> Iterator[Show]:
        """The stages of a property `P [ left U right ]` or `R [ F target ]`."""
        if self.model.bound.clocks is not None:
            return  # a property of a timed automaton is no property of the states that are drawn
        bound, labels = instance.bind(self.model.bound)
        context = Context(self._explicit, self.model.options, labels)
        if not isinstance(bound.formula, ProbabilityOperator | RewardOperator):
            return  # other formulas have no stages to show
        try:
            query = query_of(context, bound.formula)
            match query.quantity:
                case PathProbability(UntilPath() as path) if path.window.is_unbounded:
                    yield from self._until(path, query.direction, symbolic)
                case ReachReward(reward, target):
                    yield from self._reward(reward, target, query.direction)
                case _:
                    pass
        except SymcheckError as error:
            frame = {"title": "This trace ended with an error.", "note": str(error)}
            yield self._on_states("Trace", "", frame)

    @property
    def _explicit(self) -> Engine:
        assert self.board.engine is not None
        return self.board.engine

    def _until(
        self,
        path: UntilPath[StateSet],
        direction: Direction | None,
        symbolic: SymbolicEngine | None,
    ) -> Iterator[Show]:
        """prob0, prob1, value and policy iteration."""
        explicit, of = self._explicit, ""
        if path.negative:
            direction = direction and direction.dual
            of = " of the complement"
        if symbolic is not None:
            # Both engines number the states lexicographically.
            left, right = (
                symbolic.from_bools(explicit.to_bools(s)) for s in (path.left, path.right)
            )
            for question, trace in (("prob0", prob0), ("prob1", prob1)):
                frames = list(trace(symbolic, left, right, direction))
                yield fixpoint_show(f"{question}{of}", frames, symbolic, self.board)
        yield from self._iterations(
            {"interval": f"Interval iteration{of}", "policy": f"Policy iteration{of}"},
            direction,
            lambda options: until_trace(
                explicit, path.left, path.right, options, direction, max_steps=_MOST_STEPS
            ),
        )

    def _reward(
        self, reward: Reward, target: StateSet, direction: Direction | None
    ) -> Iterator[Show]:
        """Value and policy iteration of the expected reward until a target."""
        yield from self._iterations(
            {"optimistic": "Optimistic value iteration", "policy": "Policy iteration"},
            direction,
            lambda options: reward_trace(
                self._explicit, target, reward, options, direction, max_steps=_MOST_STEPS
            ),
        )

    def _iterations(
        self,
        methods: Mapping[MethodName, str],
        direction: Direction | None,
        trace: Callable[[Options], EquationsTrace],
    ) -> Iterator[Show]:
        """The iterations of each method; policy iteration needs choices."""
        for method, title in methods.items():
            if method == "policy" and direction is None:
                continue
            seen = trace(Options(method=method, epsilon=1e-4))
            yield equations_show(title, seen, self.board)
            if not seen.unknown:
                break


def _title(program: Program) -> str:
    """The name of the file, or of the modules."""
    name = Path(program.span.source.name).name
    return " ".join(m.name for m in program.modules) if name.startswith("<") else name


def _text(program: Program) -> str:
    """The text of the model, as it was read if it is known."""
    return program.span.source.text or pretty(program)
