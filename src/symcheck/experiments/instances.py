"""Checking one instance of a model: its properties share what is built."""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from time import perf_counter

from symcheck.api.model import Model
from symcheck.check.property_instance import PropertyInstance
from symcheck.constant_values import GivenConstants
from symcheck.errors import Interrupted
from symcheck.experiments.rows import Row, answered, error_text, row_of

__all__ = ["Instance", "check_instance", "check_pickled"]


@dataclass(frozen=True, slots=True)
class Instance:
    """The task of a worker.

    Attributes:
        constants: one value for each constant of the model.
        properties: indices of those that are checked.
    """

    constants: GivenConstants
    properties: tuple[int, ...]


def check_pickled(work: bytes, instance: Instance) -> list[Row]:
    """`check_instance` for a pickled pair of model and properties, read once by each process."""
    return check_instance(*_unpickled(work), instance)


@lru_cache(maxsize=1)
def _unpickled(work: bytes) -> tuple[Model, Sequence[PropertyInstance]]:
    pair: tuple[Model, Sequence[PropertyInstance]] = pickle.loads(work)
    return pair


def check_instance(
    model: Model, properties: Sequence[PropertyInstance], instance: Instance
) -> list[Row]:
    """One row for each property of the instance. Faults become rows.

    Raises Interrupted, KeyboardInterrupt.
    """
    chosen = [properties[i] for i in instance.properties]
    empty = [row_of(p, instance.constants) for p in chosen]
    started = perf_counter()
    try:
        prepared = model.with_constants(instance.constants).prepared_for(chosen)
        engine = prepared.model.engine
        seconds = perf_counter() - started
        _ = prepared.shared
    except Interrupted:
        raise
    except Exception as error:  # one instance must not stop the others
        return [replace(row, error=error_text(error)) for row in empty]
    rows = []
    for property_instance, row in zip(chosen, empty, strict=True):
        row = replace(
            row, states=engine.states, transitions=engine.transitions, build_seconds=seconds
        )
        try:
            result = prepared.check(property_instance)
        except Interrupted:
            raise
        except Exception as error:  # one property must not stop the others
            rows.append(replace(row, error=error_text(error)))
        else:
            rows.append(answered(row, result))
    return rows
