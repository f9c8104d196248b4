"""PRISM's combined explicit files (.pexp): the other explicit files one after the other.

Each part begins with a comment that names it; an empty line stands between two parts.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Generic, NoReturn, TypeVar

from symcheck.errors import Diagnostic, Source, Span, SyntaxFault, UnsupportedError
from symcheck.exchange.explicit_export import ExplicitExport
from symcheck.exchange.formats import prism_writer

__all__ = ["ModelParts", "combined_file", "parts_of"]

_HEADING = re.compile(
    r'^#\s*(Transitions|States|Labels|Observations?|Reward structure:?(?: "([^"\n]*)")?)'
    r"[^#\n]*\n(?:#\s*(State|Transition) rewards)?",
    re.MULTILINE,
)


T = TypeVar("T")


@dataclass(frozen=True)
class ModelParts(Generic[T]):
    """The parts of one model: files, or their texts.

    rewards: per reward structure, the part of state rewards and that of transition rewards (None
        where there is none).
    """

    transitions: T
    states: T | None = None
    labels: T | None = None
    rewards: tuple[tuple[T | None, T | None], ...] = ()


def parts_of(source: Source) -> ModelParts[Source]:
    """The parts of a combined file. Each keeps the numbers of its lines.

    Raises:
        SyntaxFault: there are no transitions, or text stands before the first part.
        UnsupportedError: the model is partially observable.
    """
    headings = list(_HEADING.finditer(source.text + "\n"))
    starts = [*(h.start() for h in headings), len(source.text)]
    before = re.search(r"^[^#\s].*", source.text[: starts[0]], re.MULTILINE)
    if before is not None:
        _fault(source, before.span(), "text before the first part of the model")
    texts: dict[str, Source] = {}
    rewards: list[tuple[str | None, Source | None, Source | None]] = []
    for heading, start, stop in zip(headings, starts, starts[1:], strict=False):
        text = "\n" * source.text.count("\n", 0, start) + source.text[start:stop]
        part = replace(source, text=text)
        match heading[1].partition(" ")[0].rstrip("s:"):
            case "Observation":
                raise UnsupportedError(f"{source.name}: partially observable models")
            case "Reward":
                _add_rewards(rewards, heading, part)
            case kind if kind in texts:
                _fault(source, heading.span(1), f"a second part '{heading[1]}'")
            case kind:
                texts[kind] = part
    if "Transition" not in texts:
        _fault(source, (0, 0), "there is no part '# Transitions'")
    return ModelParts(
        texts["Transition"],
        texts.get("State"),
        texts.get("Label"),
        tuple((of_states, of_transitions) for _, of_states, of_transitions in rewards),
    )


def _add_rewards(
    rewards: list[tuple[str | None, Source | None, Source | None]],
    heading: re.Match[str],
    part: Source,
) -> None:
    """Add state rewards as a new structure, and transition rewards to the structure before them."""
    name = heading[2]
    if heading[3] == "State":
        rewards.append((name, part, None))
    elif rewards and rewards[-1][0] == name and rewards[-1][2] is None:
        rewards[-1] = (name, rewards[-1][1], part)
    else:
        rewards.append((name, None, part))


def _fault(source: Source, span: tuple[int, int], message: str) -> NoReturn:
    raise SyntaxFault(Diagnostic(message, Span(source, *span), "section"))


def combined_file(
    model: ExplicitExport, labels: Sequence[str], *, precision: int, rewards: bool
) -> Iterator[str]:
    """The text of a combined file.

    Args:
        model: the exported model.
        labels: the names of the labels to write.
        precision: significant digits.
        rewards: write the reward structures.
    """
    parts: list[Iterable[str]] = [
        prism_writer.transitions_file(model, precision=precision, headers=True),
        chain(["# States\n"], prism_writer.states_file(model)),
        chain(["# Labels\n"], prism_writer.labels_file(model, labels)),
    ]
    for number, structure in enumerate(model.rewards if rewards else ()):
        parts += (
            prism_writer.state_rewards_file(model, structure, precision=precision),
            prism_writer.transition_rewards_file(model, number, precision=precision),
        )
    for index, part in enumerate(parts):
        yield from chain(["\n"] if index else [], part)
