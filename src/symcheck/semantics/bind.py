"""Binding: programs to models, and properties to a model."""

from __future__ import annotations

from symcheck.semantics.programs import bind, undefined_constants

__all__ = ["bind", "undefined_constants"]
