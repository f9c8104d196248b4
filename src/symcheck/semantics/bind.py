"""Binding: programs to models, and properties to a model."""

from __future__ import annotations

from symcheck.semantics.programs import bind, undefined_constants
from symcheck.semantics.properties import (
    BoundProperties,
    BoundProperty,
    SplitConstants,
    bind_expression,
    bind_properties,
    needed_constants,
    reward_index,
    split_constants,
)

__all__ = [
    "BoundProperties",
    "BoundProperty",
    "SplitConstants",
    "bind",
    "bind_expression",
    "bind_properties",
    "needed_constants",
    "reward_index",
    "split_constants",
    "undefined_constants",
]
