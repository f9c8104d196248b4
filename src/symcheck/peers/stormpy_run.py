"""Check one property with stormpy: a program of its own, because a fault of Storm ends its process.

python stormpy_run.py MODEL PROPERTY CONSTANTS [FILTER STATES]

It prints the line of the program `storm` with the result. The settings are those of that program.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Any

import stormpy

_FILTERS: dict[str, Callable[[list[float]], float | bool]] = {
    "min": min,
    "max": max,
    "sum": math.fsum,
    "avg": lambda values: math.fsum(values) / len(values),
    "count": sum,
    "forall": all,
    "exists": any,
}


def main(path: str, text: str, constants: str, operator: str = "", states: str = "") -> None:
    """Print the value in the initial state, or that of a filter over some states."""
    if text.startswith("multilex"):
        raise RuntimeError("stormpy has no call that answers multilex")
    program = stormpy.parse_prism_program(path, prism_compatibility=True)
    properties = [p for t in (text, states) if t for p in stormpy.parse_properties(t, program)]
    if constants:
        program, properties = stormpy.instantiate_constants(program, constants, properties)
    model = stormpy.build_model(program, properties)

    def checked(index: int) -> Any:
        # Reward bounds and conditional probabilities have values in the initial states alone.
        result = stormpy.model_checking(
            model,
            properties[index],
            only_initial_states=not operator,
            environment=stormpy.Environment(),
        )
        if result is None:
            raise RuntimeError("there is no result for a property of this kind")
        if not hasattr(result, "get_value") and not result.is_qualitative():
            kind = "no single number" if text.startswith("quantile") else "a front"
            raise RuntimeError(f"its answer is {kind}, which is not compared")
        return result

    def value(result: Any, state: int) -> float | bool:
        return bool(result[state]) if result.is_qualitative() else float(result.get_value(state))

    result = checked(0)
    if not operator:
        if len(model.initial_states) != 1:
            raise RuntimeError("the model has several initial states")
        _print(value(result, model.initial_states[0]))
        return
    chosen = checked(1)
    values = [value(result, s) for s in range(model.nr_states) if value(chosen, s)]
    if operator == "range":
        print(f"\nResult (for filter states): [{min(values)}, {max(values)}]")
    elif operator == "state":
        (one,) = values
        _print(one)
    else:
        _print(_FILTERS[operator](values))


def _print(value: float | bool) -> None:
    print(f"\nResult: {str(value).lower()}")


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except (AttributeError, TypeError):  # these are faults of the calls, and not words of Storm
        print("\nERROR: stormpy has no call that answers a property of this kind")
        sys.exit(1)
    except MemoryError:
        print("\nERROR: there is not enough memory")
        sys.exit(1)
    except Exception as error:  # of any kind: its text is the answer
        print(f"\nERROR: {error}")
        sys.exit(1)
