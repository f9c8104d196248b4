"""The switches of simulation: -simpath writes a random path, -sim estimates properties from many."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from symcheck.check.result import Result
from symcheck.cli.exports import MODEL_EXPORTS
from symcheck.cli.output_paths import NOTHING, Values, own_file
from symcheck.cli.report import Report
from symcheck.errors import UsageError
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import Expression

if TYPE_CHECKING:  # the simulator is imported where it is used: most runs do without
    from symcheck.simulate.path import Path
    from symcheck.simulate.path_options import Request
    from symcheck.simulate.statistics import Plan

__all__ = ["Simulation", "plan_of", "simulation", "write_path"]

_OF_BUILT_MODELS = (*MODEL_EXPORTS, "exportstrat", "exportvector", "exportprismconst")
_ENDS = {
    "loop": "Deterministic loop detected after {n} steps (use the loopcheck=false option to extend the path).",
    "deadlock": "Deadlock state reached after {n} steps.",
    "length": "the path was stopped after {n} steps (-simpathlen allows more).",
}


def plan_of(arguments: argparse.Namespace) -> Plan:
    """How to sample, by the switches. Raises UsageError."""
    from symcheck.simulate.statistics import METHODS, Plan

    method = arguments.simmethod.lower()
    if method not in METHODS:
        raise UsageError(f"-simmethod: '{arguments.simmethod}' is none of {', '.join(METHODS)}")
    if arguments.simwidth is not None and arguments.simapprox is not None:
        raise UsageError(
            "-simwidth and -simapprox give the same thing, the half width: one of them is enough"
        )
    return Plan(
        method=method,
        samples=arguments.simsamples,
        error=arguments.simconf,
        width=arguments.simapprox if arguments.simwidth is None else arguments.simwidth,
        pilot=arguments.simvar,
        most=arguments.simmaxrwd,
        max_steps=arguments.simpathlen,
        seed=arguments.seed,
    )


def write_path(
    arguments: argparse.Namespace, report: Report, model: BoundModel, varying: Values = NOTHING
) -> None:
    """Make the path that -simpath describes, and write it to the file (or 'stdout'). Raises UsageError, ModelFault."""
    from symcheck.simulate.path import table
    from symcheck.simulate.path_options import parse_request

    text, where = arguments.simpath
    request = parse_request(text)
    path = _path(arguments, model, request)
    report.line()
    if path.end in _ENDS and (
        path.end == "length" or not request.deadlock or path.end != "deadlock"
    ):
        report.warn(_ENDS[path.end].format(n=len(path)))
    if request.deadlock and path.end != "deadlock":
        report.warn(
            f"no deadlock was met on {request.repeat} path{'s' if request.repeat > 1 else ''}: the last one is shown"
        )
    shown = table(path, request.layout)
    if where == "stdout":
        report.line(shown.rstrip("\n"))
        return
    from symcheck.exchange.text import write_text

    where = own_file(where, varying)
    write_text(where, [shown], report.out)
    report.line(f"Path of {len(path)} steps (seed {path.seed}) written to {where}")


def _path(arguments: argparse.Namespace, model: BoundModel, request: Request) -> Path:
    from symcheck.simulate.walk import simulate

    for attempt in range(request.repeat):
        path = simulate(
            model,
            request.steps,
            time=request.time,
            seed=None if arguments.seed is None else arguments.seed + attempt,
            loop_check=request.loop_check,
            max_steps=arguments.simpathlen,
            check_sums=arguments.check_sums,
        )
        if not request.deadlock or path.end == "deadlock":
            break
    return path


@dataclass(frozen=True)
class Simulation:
    """Takes the place of a built model where properties are estimated."""

    model: BoundModel
    plan: Plan
    fix_deadlocks: bool

    def check(self, formula: Expression, labels: Mapping[str, Expression]) -> Result:
        """Estimate a property. Raises SymcheckError."""
        from symcheck.simulate.check import check_by_sampling

        return check_by_sampling(
            self.model, formula, self.plan, labels=labels, fix_deadlocks=self.fix_deadlocks
        )


def simulation(
    arguments: argparse.Namespace, report: Report, model: BoundModel, varying: Values = NOTHING
) -> Simulation | None:
    """Carry out -simpath, and give what -sim estimates properties by (None: they are checked numerically)."""
    if not (arguments.sim or arguments.simpath):
        return None
    if not model.modules:
        raise UsageError(
            "-sim and -simpath follow the commands of a model in the PRISM language; an imported matrix has none"
        )
    if arguments.simpath:
        write_path(arguments, report, model, varying)
    if not arguments.sim:
        return None
    plan = plan_of(arguments)
    if arguments.exact:
        raise UsageError(
            "-sim estimates, and -exact asks for rational arithmetic: one of the two has to go"
        )
    for name in _OF_BUILT_MODELS:
        if getattr(arguments, name) not in (None, False, []):
            raise UsageError(
                f"-{name} needs the whole model, which -sim does not build: run it without -sim"
            )
    return Simulation(model, plan, arguments.fix_deadlocks)
