"""The step simulator: -step shows a state and its choices, and reads which one is taken."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from symcheck.api.model import Model
from symcheck.cli.output import Output
from symcheck.cli.switches.arguments import Arguments
from symcheck.errors import InputError, UsageError

if TYPE_CHECKING:
    from symcheck.simulate.stepper import Simulator

__all__ = ["step_through"]

_KEYS = (
    "Enter: random step, N or [action]: choice, N.M: successor, r N: N random steps,\n"
    "b: back, s: restart, p: path, q: quit"
)


def step_through(a: Arguments, output: Output, model: Model) -> None:
    """Step through a model, as lines of the standard input say, until `q` or the end of input.

    Raises ModelFault: the initial state is faulty.
    """
    simulator = model.simulator(a.seed)
    output.line()
    output.line(f"Step simulator, seed {simulator.seed}\n{_KEYS}")
    output.line(f"\n{simulator}")
    while (line := _read(output)) not in (None, "q"):
        try:
            output.line(_answer(simulator, line or ""))
        except (InputError, UsageError) as error:
            output.line(str(error))


def _read(output: Output) -> str | None:
    """The next line; None at the end of the input."""
    print("> ", end="", file=output.out, flush=True)  # input() would print it to standard error
    try:
        line = input().strip()
    except EOFError:
        output.line()
        return None
    if not sys.stdin.isatty():
        output.line(line)  # as a terminal shows it
    return line


def _answer(simulator: Simulator, line: str) -> str:
    """Carry out a line, and give the text that follows. Raises UsageError, ModelFault."""
    choice, dot, branch = line.partition(".")
    match line.split():
        case []:
            simulator.step()
        case ["b"]:
            simulator.back()
        case ["s"]:
            simulator.restart()
        case ["p"]:
            return str(simulator.path)
        case ["r", count] if count.isdecimal():
            simulator.run(int(count))
        case [_] if choice.isdecimal() and (branch.isdecimal() or not dot):
            simulator.step(int(choice), int(branch) if dot else None)
        case [word] if word.startswith("[") and word.endswith("]"):
            simulator.step(word[1:-1])
        case _:
            raise UsageError(f"'{line}' is no step\n{_KEYS}")
    return str(simulator)
