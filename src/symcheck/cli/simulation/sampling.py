"""Simulation: -simpath writes a random path, -sim estimates properties from many."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from symcheck.api.model import Model
from symcheck.cli.output import Output
from symcheck.cli.output_paths import NO_CONSTANTS, ConstantTexts, instance_path, of_switch
from symcheck.cli.switches.arguments import Arguments
from symcheck.errors import NumericalError, SymcheckError, UsageError

if TYPE_CHECKING:  # the simulator is imported where it is used: most runs do without
    from symcheck.cli.simulation.path_options import PathOptions
    from symcheck.simulate.path import Path
    from symcheck.simulate.statistics import Plan

__all__ = ["in_switches", "sampling_plan", "with_switches", "write_path"]

_SWITCHES = {
    "samples": "-simsamples",
    "error": "-simconf",
    "width": "-simwidth",
    "most": "-simmaxrwd",
    "max_steps": "-simpathlen",
}
"""The switches of the parameters of the library."""

_WARNINGS = {
    "loop": "Deterministic loop detected after {n} steps "
    "(use the loopcheck=false option to extend the path).",
    "deadlock": "Deadlock state reached after {n} steps.",
    "length": "the path was stopped after {n} steps (-simpathlen allows more).",
}
"""Why a path ended before it had the length that was asked for."""


def in_switches(error: SymcheckError) -> SymcheckError:
    """An error of sampling with the names of switches for those of parameters."""
    if not isinstance(error, UsageError | NumericalError):
        return error
    return type(error)(with_switches(error.message), hint=error.hint)


def with_switches(message: str) -> str:
    """A message with the names of switches for those of parameters."""
    return re.sub(rf"'({'|'.join(_SWITCHES)})'", lambda name: _SWITCHES[name[1]], message)


def sampling_plan(a: Arguments) -> Plan:
    """How -sim samples, by the switches. Raises UsageError."""
    from symcheck.simulate.statistics import METHODS, Plan

    method = next((m for m in METHODS if m == a.simmethod.lower()), None)
    if method is None:
        raise UsageError(f"-simmethod: '{a.simmethod}' is none of {', '.join(METHODS)}")
    if a.simwidth is not None and a.simapprox is not None:
        raise UsageError("-simwidth and -simapprox both give the half width: one of them is enough")
    if a.options.exact:
        raise UsageError(
            "-sim estimates, and -exact asks for rational arithmetic: one of the two has to go"
        )
    return Plan(
        method=method,
        samples=a.simsamples,
        error=a.simconf,
        width=a.simapprox if a.simwidth is None else a.simwidth,
        pilot=a.simvar,
        most=a.simmaxrwd,
        max_steps=a.simpathlen,
        seed=a.seed,
    )


def write_path(
    a: Arguments, output: Output, model: Model, varying: ConstantTexts = NO_CONSTANTS
) -> None:
    """Generate the path that -simpath describes, and write it to its file or 'stdout'.

    Raises UsageError, ModelFault.
    """
    from symcheck.cli.simulation.path_options import parse_path_options
    from symcheck.simulate.path import table

    assert a.simpath is not None
    description, target = a.simpath
    with of_switch("-simpath"):
        request = parse_path_options(description)
    path = _path(a, model, request)
    output.line()
    wanted_deadlock = request.deadlock and path.end == "deadlock"
    if path.end in _WARNINGS and not wanted_deadlock:
        output.warn(_WARNINGS[path.end].format(n=len(path)))
    if request.deadlock and path.end != "deadlock":
        output.warn(
            f"no deadlock was met on {request.repeat} path{'s' if request.repeat > 1 else ''}: "
            "the last one is shown"
        )
    text = table(path, request.path_format)
    if target == "stdout":
        output.line(text.rstrip("\n"))
        return
    from symcheck.exchange.text import write_text

    target = instance_path(target, varying)
    write_text(target, [text], output.out)
    output.line(f"Path of {len(path)} steps (seed {path.seed}) written to {target}")


def _path(a: Arguments, model: Model, request: PathOptions) -> Path:
    """The path of a request: of several attempts the first that ends in a deadlock, or the last."""
    for attempt in range(request.repeat):
        path = model.simulate(
            request.steps,
            time=request.time,
            seed=None if a.seed is None else a.seed + attempt,
            loop_check=request.loop_check,
            max_steps=a.simpathlen,
        )
        if not request.deadlock or path.end == "deadlock":
            break
    return path
