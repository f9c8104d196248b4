"""The stages of a model: its text, bound to constants, and built, within the limits of options."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace
from functools import cached_property, wraps
from typing import TYPE_CHECKING, Concatenate, NamedTuple, ParamSpec, Self, TypeVar, Unpack

from symcheck.api.arguments import takes_options
from symcheck.constant_values import GivenConstants, constant_values
from symcheck.engines import registry
from symcheck.engines.base import Engine
from symcheck.errors import Diagnostic
from symcheck.lazy_dataclass import dataclass
from symcheck.options import Options, OptionValues, make_options
from symcheck.semantics.binding.bind import bind, check_constant_names, undefined_constants
from symcheck.semantics.expressions.literals import as_expression
from symcheck.semantics.features import Feature, offers
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import ModelType
from symcheck.syntax.declarations import Program
from symcheck.time_limit import seconds_left, within

if TYPE_CHECKING:
    from symcheck.explicit.unbounded import Growth
    from symcheck.semantics.binding.parameters import Ranges
    from symcheck.semantics.reduction.reset_dead_variables import Reduction

__all__ = ["Observer", "Smaller", "Stages", "limited"]

P = ParamSpec("P")
T = TypeVar("T")
S = TypeVar("S", bound="Stages")
Observer = Callable[[object], None]


def limited(
    method: Callable[Concatenate[S, P], T],
) -> Callable[Concatenate[S, P], T]:
    """A decorator: a call keeps to the options `time_limit` and `workdir`."""

    @wraps(method)
    def limited(self: S, /, *args: P.args, **kwargs: P.kwargs) -> T:
        return self.within_limits(lambda: method(self, *args, **kwargs))

    return limited


class Smaller(NamedTuple):
    """A bound model with fewer states, and the same values of some properties in initial states.

    Attributes:
        bound: the bound model. It may let a state represent those that symmetries make of it.
        reduction: how variables whose values are not read again are reset; None without `reduce`.
        partial: whether exploration stops where the properties are decided.
    """

    bound: BoundModel
    reduction: Reduction | None = None
    partial: bool = False


@dataclass(frozen=True, eq=False, repr=False)
class Stages:
    """A program with constants and options, and what is made of it, each when it is first used.

    The fields are those of `symcheck.api.model.Model`.
    """

    program: Program
    given_constants: GivenConstants
    options: Options
    given_type: ModelType | None = None
    observer: Observer | None = None
    smaller: Smaller | None = None
    parameters: Ranges = field(default_factory=dict)

    def __repr__(self) -> str:
        given = "".join(f", {n}={v}" for n, v in self.given_constants.items())
        modules = " ".join(m.name for m in self.program.modules)
        return f"<Model: {self.type.value}, modules {modules}{given}>"

    @property
    def type(self) -> ModelType:
        """The model type: the given one, or that of the text, in which no keyword means MDP."""
        return self.program.model_type(self.given_type)

    @property
    def is_timed(self) -> bool:
        """Whether clocks measure time: then each property is checked on a model made for it."""
        return self.type.has_clocks

    @cached_property
    def is_truncated(self) -> bool:
        """Whether properties are checked on a part of the states where they can be: because the
        option `truncate` says so, or because variables grow.
        """
        truncate = self.options.truncate
        return self.growth is not None if truncate is None else truncate

    @cached_property
    def growth(self) -> Growth | None:
        """Which variables without bounds still grow after very many states; None if none does, or
        if it does not matter, because the model has to be built as a whole.
        """
        options, bound = self.options, self.bound
        needs_all = options.exact or options.strategy or options.everywhere or options.bisim
        if needs_all or options.fairness or options.engine not in ("auto", "explicit"):
            return None
        if self.is_built or all(v.domain is not None for v in bound.variables):
            return None  # it has an end
        if not offers(bound, Feature.TRUNCATION) or bound.initial is not None or bound.builder:
            return None
        from symcheck.explicit.region import early_growth

        return self.within_limits(lambda: early_growth(bound, options))

    @cached_property
    def is_endless(self) -> bool:
        """Whether variables without bounds grow so long that a search for all states is given up
        where bounds on a part of them help.
        """
        from symcheck.explicit import tuning
        from symcheck.explicit.region import early_growth

        def grows() -> bool:
            return early_growth(self.bound, self.options, tuning.ENDLESS_ROUNDS) is not None

        return self.growth is not None and self.within_limits(grows)

    @property
    def builds_per_property(self) -> bool:
        """Whether there is no model that is built for all properties."""
        return self.is_timed or self.is_truncated

    @property
    def is_built(self) -> bool:
        """Whether the states are known already: `engine` was asked for."""
        return "engine" in vars(self)

    def _repr_html_(self) -> str:
        from symcheck.tables import Table

        facts = {
            "type": [self.type.value],
            "modules": [m.name for m in self.program.modules],
            "constants": [f"{n}={v}" for n, v in self.given_constants.items()],
            "labels": [x.name for x in self.program.labels],
            "states": [f"{self.engine.states:,}"] if self.is_built else [],
        }
        rows = [(name, ", ".join(texts)) for name, texts in facts.items() if texts]
        return Table.of(("", ""), rows)._repr_html_()

    @cached_property
    def bound(self) -> BoundModel:
        """Constants evaluated, names resolved, types checked. Raises InputError."""
        if self.smaller is not None:
            return self.smaller.bound
        bound = bind(
            self.program,
            self.given_constants,
            model_type=self.given_type,
            exact=self.options.exact,
            normalise=self.options.check_sums and not self.options.exact,
            parameters=self.parameters,
        )
        if not bound.type.has_clocks:
            return bound
        from symcheck.api.timed import displayed_model

        return displayed_model(bound)

    @cached_property
    def warnings(self) -> tuple[Diagnostic, ...]:
        """What was perhaps not meant: guards and labels that never hold, and actions that never
        happen. Raises InputError.
        """
        from symcheck.semantics.model_warnings import model_warnings

        return tuple(model_warnings(self.bound, self.options))

    @cached_property
    def overlaps(self) -> tuple[Diagnostic, ...]:
        """Commands of a DTMC that are enabled in the same state, each with an example.

        Raises ModelFault, UnsupportedError, ResourceError.
        """
        from symcheck.engines.overlapping_commands import overlapping_commands

        return tuple(overlapping_commands(self.engine)) if self.options.warn_overlaps else ()

    @cached_property
    def state_warnings(self) -> tuple[Diagnostic, ...]:
        """What was perhaps not meant, as far as only the states show it: `overlaps`, and deadlocks
        that were given self-loops.

        Raises ModelFault, UnsupportedError, ResourceError.
        """
        from symcheck.engines.states import example
        from symcheck.semantics.state_faults import deadlocks_mended

        deadlocks = self.engine.deadlocks
        if not deadlocks:
            return self.overlaps
        text = deadlocks_mended(deadlocks.count, example(self.engine, deadlocks))
        return (*self.overlaps, Diagnostic(text, code="deadlock", severity="warning"))

    def within_limits(self, compute: Callable[[], T]) -> T:
        """What a function returns within `time_limit`, with `threads`, and with its large arrays
        in `workdir`.

        Raises TimeLimitError, and UsageError if the folder cannot be used.
        """
        from symcheck.parallel.threads import use_threads

        folder, limit = self.options.workdir, self.options.time_limit
        compute = use_threads(self.options.threads)(compute)
        if folder is not None:
            from symcheck.explicit.file_arrays import arrays_in

            compute = arrays_in(folder)(compute)
        if limit is None:
            return compute()

        def timed() -> T:
            if self.is_built:  # diagrams of an earlier call have its limit
                from symcheck.engines.symbolic.diagrams import HasDiagrams

                if (symbolic := self.engine.capability(HasDiagrams)) is not None:
                    symbolic.diagrams.manager.limit_time(seconds_left())
            return compute()

        return within(limit, timed)

    @cached_property
    @limited
    def engine(self) -> Engine:
        """The built model: reachable states and matrix.

        Raises ModelFault, UnsupportedError, ResourceError.
        """
        return registry.build(self.bound, self.options, self.observer)

    @takes_options
    def with_options(self, **options: Unpack[OptionValues]) -> Self:
        """The same model with other options. Raises UsageError."""
        return replace(self, options=make_options(options, self.options))

    def with_constants(self, constants: GivenConstants | str) -> Self:
        """The same model with other values of its constants. Raises UsageError."""
        return replace(self, given_constants=constant_values(constants)).checked()

    def with_observer(self, observer: Observer | None) -> Self:
        """The same model, which tells the observer of the progress of building."""
        return replace(self, observer=observer)

    def checked(self) -> Self:
        """The model; a faulty text or constant is an error now, unless values are missing."""
        missing = {c.name for c in undefined_constants(self.program)}
        if missing <= self.given_constants.keys() | self.parameters:
            _ = self.bound
        else:
            check_constant_names(self.program, self.given_constants)
        return self

    def instantiated(self) -> Program:
        """The text of the model with the values of all constants. Raises InputError."""
        values = self.bound.constants
        constants = tuple(
            replace(c, value=as_expression(values[c.name], c.type, c.span))
            for c in self.program.constants
        )
        return replace(self.program, constants=constants)
