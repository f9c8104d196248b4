"""Explorations and checks in processes of their own, so that typing never waits for them."""

from __future__ import annotations

import asyncio
import json
import sys
from contextlib import suppress
from dataclasses import asdict, dataclass
from typing import Any

from symcheck.errors import Diagnostic, InputError, ResourceError, SymcheckError

__all__ = ["Exploration", "Fault", "Verdict", "check", "explore"]

SECONDS = 5.0
"""The longest time of an exploration after a change."""

CHECK_SECONDS = 60.0
"""The longest time of a check that is asked for."""

SETTING = "symcheck.constants"
"""The setting of an editor that has the values of constants."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of a model in some state. It is a `Diagnostic` that can leave its process.

    Attributes:
        message, code, hint: as those of a diagnostic.
        start, end: offsets in the text.
        severity: 'error' or 'warning'.
    """

    message: str
    code: str
    hint: str | None
    start: int
    end: int
    severity: str = "error"


@dataclass(frozen=True, slots=True)
class Exploration:
    """What is known of a model after an exploration; `states` None: it did not end."""

    states: int | None
    faults: tuple[Fault, ...]


@dataclass(frozen=True, slots=True)
class Verdict:
    """The answer of a check, on one line, or why there is none."""

    text: str


async def explore(text: str) -> Exploration:
    """Explore a model in another process, which ends if this is cancelled."""
    found = await _answer({"model": text})
    if found is None:  # it was killed
        return Exploration(None, ())
    return Exploration(found["states"], tuple(Fault(**fault) for fault in found["faults"]))


async def check(model: str, properties: str, number: int, constants: str = "") -> Verdict:
    """Check property `number`, counted from 0, of those of a text that follow the grammar, in
    another process.

    constants: values such as "N=3,p=0.5" of constants that texts leave open; this property may need
        some of them.
    """
    found = await _answer(
        {"model": model, "properties": properties, "number": number, "constants": constants}
    )
    return Verdict("the check was stopped" if found is None else found["text"])


async def _answer(question: dict[str, Any]) -> dict[str, Any] | None:
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "symcheck.lsp.checks"),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
    )
    try:
        said, _ = await process.communicate(json.dumps(question).encode())
    except asyncio.CancelledError:
        with suppress(ProcessLookupError):
            process.kill()
        raise
    return json.loads(said) if process.returncode == 0 else None


def _explored(text: str) -> Exploration:
    import symcheck

    try:
        model = symcheck.loads(text, time_limit=SECONDS)
        states = model.engine.states
        return Exploration(states, tuple(map(_fault, model.state_warnings)))
    except InputError as error:
        return Exploration(None, tuple(map(_fault, error.diagnostics)))
    except SymcheckError:  # too large, or not supported: no fault of the text
        return Exploration(None, ())


def _fault(d: Diagnostic) -> Fault:
    return Fault(d.message, d.code, d.hint, d.span.start, d.span.end, d.severity)


def _checked(model: str, properties: str, number: int, constants: str) -> Verdict:
    import symcheck
    from symcheck.constant_values import constant_values
    from symcheck.semantics.binding.bind import needed_constants, split_constants
    from symcheck.syntax.properties_in_part import parse_properties_in_part

    try:
        given = constant_values(constants)
    except SymcheckError as error:
        return Verdict(f"{SETTING}: {error.message.removeprefix('constants: ')}")
    try:
        loaded = symcheck.loads(model, time_limit=CHECK_SECONDS)
        file = parse_properties_in_part(properties).parsed
        needed = needed_constants(loaded.program, file)[number]
        if missing := [name for name in needed if name not in given]:
            values = ",".join(f"{name}=…" for name in missing)
            return Verdict(f"{' and '.join(missing)} without a value: set {SETTING} to {values}")
        used = {name: given[name] for name in needed}
        split = split_constants(loaded.program, file, used)
        values_of_properties = {name: (value,) for name, value in split.of_properties.items()}
        loaded = loaded.with_constants(split.of_model)
        (instance,) = loaded.instances(file, values_of_properties, [number])
        told = f", {','.join(f'{name}={value}' for name, value in used.items())}" if used else ""
        return Verdict(f"{loaded.check_instance(instance)}{told}")
    except ResourceError:
        return Verdict(f"no answer within {CHECK_SECONDS:.0f} seconds")
    except InputError as error:
        return Verdict(error.diagnostics[0].message)
    except SymcheckError as error:
        return Verdict(error.message.splitlines()[0])


if __name__ == "__main__":
    asked = json.load(sys.stdin)
    answer = _checked(**asked) if "number" in asked else _explored(asked["model"])
    json.dump(asdict(answer), sys.stdout)
