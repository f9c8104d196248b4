"""Read and run the error cases in tests/errors/semantics.

A case is a text of sections: `=== model`, then any of `=== constants` (NAME=VALUE per line), `=== options` (words) and
`=== properties`, then `=== error` with exactly what the user sees. Options: exact, and step (follow the transitions of
the model until something is wrong). `python tests/semantics/cases.py` writes the errors anew, to be read before they are kept.
"""

from __future__ import annotations

import sys
from pathlib import Path

from symcheck.errors import InputError
from symcheck.semantics.binding.bind import BoundProperties, bind, bind_properties
from symcheck.semantics.diagnostics import DiagnosticCollector
from symcheck.semantics.interpreter import initial_states, state_rewards, transitions
from symcheck.semantics.model import BoundModel
from symcheck.syntax.parse import parse_model, parse_properties

FOLDER = Path(__file__).parents[1] / "errors" / "semantics"


def read(path: Path) -> dict[str, str]:
    """The sections of a case."""
    sections: dict[str, str] = {}
    for part in path.read_text().split("=== ")[1:]:
        name, _, text = part.partition("\n")
        sections[name] = text
    return sections


def raise_faults(properties: BoundProperties) -> None:
    """Raise all faults of all properties as one error, except missing constants."""
    report = DiagnosticCollector()
    for p in properties.properties:
        if p.fault is not None and not p.missing:
            report.absorb(p.fault)
    report.raise_all()


def outcome(sections: dict[str, str]) -> str:
    """What the user sees."""
    options = sections.get("options", "").split()
    given = dict(line.split("=", 1) for line in sections.get("constants", "").splitlines())
    try:
        program = parse_model(sections["model"], "model.pm")
        model = bind(program, given, exact="exact" in options)
        if "properties" in sections:
            bound = bind_properties(parse_properties(sections["properties"], "model.props"), model)
            raise_faults(bound)
            for p in bound.properties:
                assert p.formula is not None
        if "step" in options:
            explore(model)
    except InputError as error:
        return str(error) + "\n"
    return "no error\n"


def explore(model: BoundModel, limit: int = 10_000) -> int:
    """The number of reachable states, one at a time."""
    seen = set(initial_states(model))
    waiting = sorted(seen)
    while waiting and len(seen) < limit:
        state = waiting.pop()
        state_rewards(model, state)
        for row in transitions(model, state):
            for _, after in row.branches:
                if after not in seen:
                    seen.add(after)
                    waiting.append(after)
    return len(seen)


if __name__ == "__main__":
    for path in sorted(FOLDER.glob("*.case")):
        text = path.read_text().partition("=== error\n")[0]
        path.write_text(text + "=== error\n" + outcome(read(path)))
        sys.stdout.write(f"{'-' * 100}\n{path.name}\n{path.read_text()}")
