"""Texts in, results out: the whole path, for tests of engines and of the checker."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from symcheck.check.checker import check
from symcheck.check.result import Result
from symcheck.check.testing.expected_results import Verdict, expected_value, judge
from symcheck.engines.base import Engine
from symcheck.engines.registry import build
from symcheck.errors import SymcheckError
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind, bind_properties, split_constants
from symcheck.syntax.ast import ModelType
from symcheck.syntax.declarations import PropertiesFile
from symcheck.syntax.parse import parse_model, parse_properties

__all__ = [
    "LOSSY",
    "RESULTS",
    "Checked",
    "check_text",
    "engine_of",
    "judge_file",
    "lines_without_run",
]

LOSSY = """mdp
module m
  s : [0..3];
  [go] s=0 -> 0.5:(s'=1) + 0.5:true;
  [risk] s=0 -> 0.9:(s'=2) + 0.1:(s'=3);
  [on] s=1 -> 0.3:(s'=2) + 0.4:(s'=0) + 0.3:(s'=3);
  [out] s=1 -> 0.5:(s'=2) + 0.5:(s'=3);
  [] s=2 -> true;
  [] s=3 -> true;
endmodule
rewards "cost" [go] true : 1; [risk] true : 3; [on] true : 2; [out] true : 5; endrewards
"""
"""A channel that loses messages: in two states, two choices trade time for loss."""

RESULTS = Path(__file__).parent / "results"


def options_for(engine: str, **settings: object) -> Options:
    """Options for an engine of the registry; 'exact' means rational arithmetic."""
    return (
        Options(exact=True, **settings) if engine == "exact" else Options(engine=engine, **settings)
    )


def engine_of(
    text: str,
    engine: str = "explicit",
    constants: Mapping[str, str] | None = None,
    **settings: object,
) -> Engine:
    """The model of a text, built."""
    options = options_for(engine, **settings)
    return build(bind(parse_model(text), constants or {}, exact=options.exact), options)


def check_text(
    engine: Engine, text: str, constants: Mapping[str, str] | None = None, **settings: object
) -> Result:
    """The result of one property."""
    return ask(
        engine, parse_properties(text), 0, constants or {}, options_for(engine.name, **settings)
    )


def ask(
    engine: Engine, file: PropertiesFile, index: int, constants: Mapping[str, str], options: Options
) -> Result:
    """The result of one property of a file."""
    bound = bind_properties(file, engine.model, constants)
    return check(engine, bound.properties[index].formula, options, labels=bound.labels)


@dataclass(frozen=True)
class Checked:
    """A property of a file with its outcome and the verdict of its RESULT lines."""

    text: str
    outcome: Result | SymcheckError
    verdict: Verdict


def judge_file(
    model: Path,
    properties: Path,
    constants: Mapping[str, str],
    engine: str,
    kind: ModelType | None = None,
) -> list[Checked]:
    """Check all properties of a file and compare them with their RESULT lines."""
    options = options_for(engine)
    program, file = (
        parse_model(model.read_text(), model.name),
        parse_properties(properties.read_text(), properties.name),
    )
    of_model = {c.name for c in program.constants}
    built = build(
        bind(
            program,
            {n: v for n, v in constants.items() if n in of_model},
            model_type=kind,
            exact=options.exact,
        ),
        options,
    )
    others = {n: v for n, v in constants.items() if n not in of_model}
    found = []
    for i, bound in enumerate(bind_properties(file, built.model, others).properties):
        outcome: Result | SymcheckError
        try:
            outcome = ask(built, file, i, others, options)
        except SymcheckError as error:
            outcome = error
        verdict = judge(bound.comments, outcome, bound.constants, exact=options.exact)
        found.append(Checked(bound.span.text, outcome, verdict))
    return found


def lines_without_run(properties: Path, runs: Iterable[tuple[Path, Mapping[str, str]]]) -> set[str]:
    """The RESULT lines of a file that no run (a model and constants) compares with a result."""
    lines = [line.strip() for line in properties.read_text().splitlines()]
    left = {i for i, line in enumerate(lines) if re.match(r"// *RESULT *[(:]", line)}
    file = parse_properties(properties.read_text(), properties.name)
    for model, constants in runs:
        program = parse_model(model.read_text(), model.name)
        split = split_constants(program, file, constants)
        bound = bind_properties(file, bind(program, split.of_model), split.of_properties)
        for one in bound.properties:
            line, _ = one.span.source.position(one.span.start)
            first = line - len(one.comments) - 1
            for i, comment in enumerate(one.comments):
                if expected_value([comment], one.constants) is not None:
                    left.discard(first + i)
                    break
    return {f"{properties.name}:{i + 1}: {lines[i]}" for i in left}
