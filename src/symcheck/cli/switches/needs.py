"""What a switch needs to have an effect: declared with the switch, checked once for every run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from symcheck.errors import UsageError

__all__ = [
    "ALWAYS",
    "BATCH",
    "BUILT",
    "COMPARE",
    "MDP",
    "NEEDS_OF_OPTIONS",
    "PROPERTY",
    "VALUES",
    "Given",
    "Needs",
    "Unmet",
    "unmet_needs",
]

PROPERTY = "a property to check"
BUILT = "a model to build"
MDP = "an MDP"
VALUES = "several values of a constant of the model"
_FACTS = (PROPERTY, BUILT, MDP, VALUES)
"""What switches need that is no switch: a run knows it after it has read its input."""

COMPARE = "-with"
"""The switch that `symcheck compare` has."""

BATCH = "-batch"
"""The switch that runs the lines of a file; only what no line can have is an error beside it."""

_REASONS: Mapping[str, str] = {
    COMPARE: "compare prints a table of answers only",
    BATCH: "each line of -batch would write the same file",
    "-nobuild": "-nobuild builds no model",
    "-sim": "-sim builds no model",
    "-scheduler": "-scheduler builds the models on other machines",
    "-distributed": "-distributed iterates bounds on the workers",
    "-resume": "-resume keeps values only, and no models",
    "-exact": "-exact computes without rounding, in one thread, without diagrams",
    "-ex": "-ex computes without diagrams",
    "-jobs": "-jobs starts processes on this machine",
    "-testall": "-testall goes on after a failure",
}
"""Why other switches have no effect beside a switch."""

_BATCH_HINT = "write the switch into the lines, with a file for each"

_WITHOUT_MODEL = ("-nobuild", "-sim", "-scheduler", "-resume", COMPARE)


class Needs(NamedTuple):
    """What a run must have for a switch to have an effect.

    Attributes:
        all_of: switches and facts; of alternatives with `|` between them one is enough.
        not_with: switches beside which it has no effect.
        model: whether it needs the built model.
        note: a switch without effect is noted. Otherwise it is an error. Scripts give the same
            options of computing to all runs, and PRISM accepts them.
    """

    all_of: tuple[str, ...] = ()
    not_with: tuple[str, ...] = ()
    model: bool = False
    note: bool = False


ALWAYS = Needs()
"""A switch has an effect in every run."""


class Given(NamedTuple):
    """A switch of a command line: how it is written there, and what it needs."""

    written: str
    needs: Needs


class Unmet(NamedTuple):
    """A switch without effect, and why. hint: may be empty. note: it is no error.

    reason: the end of the sentence "… has no effect", with its space or colon.
    """

    switch: str
    reason: str
    hint: str
    note: bool

    @property
    def error(self) -> UsageError:
        """The error for it."""
        return UsageError(f"{self.switch} has no effect{self.reason}", hint=self.hint)


def unmet_needs(given: Mapping[str, Given], facts: Mapping[str, bool]) -> Iterator[Unmet]:
    """The switches of a run that have no effect.

    Args:
        given: the switches by their usual names, with a dash.
        facts: which of the facts hold; others are not known yet.
    """
    for switch in given.values():
        all_of, not_with, model, note = switch.needs
        for other in (*not_with, *(_WITHOUT_MODEL if model else ())):
            if other in given:
                reason = _REASONS.get(other, f"{given[other].written} is given")
                hint = _BATCH_HINT if other == BATCH else "leave out one of them"
                yield Unmet(switch.written, f": {reason}", hint, note)
        for item in () if BATCH in given else all_of:
            alternatives = item.split("|")
            if not any(x in given or facts.get(x, x in _FACTS) for x in alternatives):
                hint = ""
                if alternatives == [PROPERTY]:
                    hint = "name a file of properties, or -pf 'P=? [ F … ]'"
                yield Unmet(switch.written, f" without {_listed(alternatives)}", hint, note)


def _listed(alternatives: list[str]) -> str:
    *first, last = alternatives
    return f"{', '.join(first)} or {last}" if first else last


_NUMBERS = Needs(
    (f"{PROPERTY}|-transient|-steadystate",), not_with=("-sim", "-exact", "-nobuild"), note=True
)
_ENGINE = Needs((BUILT,), not_with=("-sim", "-nobuild"), note=True)
_PROPERTY = Needs((PROPERTY,), not_with=("-sim", "-nobuild"), note=True)

NEEDS_OF_OPTIONS: Mapping[str, Needs] = {
    **dict.fromkeys(("-m", "-h", "-s", "-ex"), _ENGINE),
    "-order": _ENGINE._replace(not_with=(*_ENGINE.not_with, "-exact", "-ex")),
    **dict.fromkeys(("-epsilon", "-absolute", "-maxiters", "-estimate"), _NUMBERS),
    "-method": _NUMBERS._replace(
        all_of=(f"{PROPERTY}|-steadystate",), not_with=(*_NUMBERS.not_with, "-distributed")
    ),
    "-fair": _PROPERTY._replace(all_of=(PROPERTY, MDP)),
    "-bisim": _PROPERTY,
    "-threads": Needs(not_with=("-sim", "-exact", "-nobuild", "-distributed"), note=True),
    "-nostates": _PROPERTY,
    "-truncate": _PROPERTY,
    "-ltl2datool": _PROPERTY,
    "-ltl2dasyntax": Needs(("-ltl2datool",), note=True),
}
"""The needs of the switches of the options table. Those of a default value need nothing."""
