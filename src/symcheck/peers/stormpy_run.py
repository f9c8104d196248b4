"""Check one property with stormpy: a program of its own, because a fault of Storm ends its process.

python stormpy_run.py MODEL PROPERTY CONSTANTS

It prints the line of the program `storm` with the result. The settings are those of that program.
"""

from __future__ import annotations

import sys

import stormpy


def main(path: str, text: str, constants: str) -> None:
    """Print the value in the initial state."""
    program = stormpy.parse_prism_program(path, prism_compatibility=True)
    properties = stormpy.parse_properties(text, program)
    if text.lstrip().startswith("filter"):
        raise RuntimeError("filters are not compared")
    if constants:
        program, properties = stormpy.instantiate_constants(program, constants, properties)
    model = stormpy.build_model(program, properties)
    if len(model.initial_states) != 1:
        raise RuntimeError("the model has several initial states")
    environment = stormpy.Environment()
    result = stormpy.model_checking(model, properties[0], environment=environment)
    if result is None:
        raise RuntimeError("there is no result for a property of this kind")
    state = model.initial_states[0]
    if not hasattr(result, "get_value") and not result.is_qualitative():
        raise RuntimeError("its result is not a number")
    value = bool(result[state]) if result.is_qualitative() else result.get_value(state)
    print(f"\nResult (for initial states): {str(value).lower()}")


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
