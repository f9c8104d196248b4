"""The public functions of binding: programs to models, and properties to a model."""

from __future__ import annotations

from symcheck.semantics.binding.bind_model import (
    bind,
    check_constant_names,
    exactly_bound,
    undefined_constants,
)
from symcheck.semantics.binding.bind_properties import (
    BoundProperties,
    BoundProperty,
    SplitConstants,
    bind_expression,
    bind_properties,
    bind_property,
    needed_constants,
    split_constants,
    without_unused_faults,
)

__all__ = [
    "BoundProperties",
    "BoundProperty",
    "SplitConstants",
    "bind",
    "bind_expression",
    "bind_properties",
    "bind_property",
    "check_constant_names",
    "exactly_bound",
    "needed_constants",
    "split_constants",
    "undefined_constants",
    "without_unused_faults",
]
