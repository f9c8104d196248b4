"""Random models that can be built."""

from __future__ import annotations

import symcheck
from generate import random_model
from symcheck.errors import SymcheckError

__all__ = ["some_model"]


def some_model(rng, kind):
    """A random model that can be bound (some name an action that no command has)."""
    while True:
        generated = random_model(rng, kind)
        try:
            symcheck.loads(generated.text).engine  # noqa: B018
        except SymcheckError:
            continue
        return generated
