"""Thresholds and budgets of the engines, each with its reason. Figures: benchmarks/README.md, two-core Linux machine."""

from __future__ import annotations

__all__ = [
    "ELIMINATION_MEMORY_SHARE",
    "ELIMINATION_STATES",
    "FEW_TRANSITIONS",
    "PATIENCE",
    "PATIENCE_PER_STATE",
]

# ------------------------------------------------------------------------------------------ graph questions on diagrams

PATIENCE = 0.25
"""Seconds that a search on diagrams gets before it is done on rows, where these are few."""

FEW_TRANSITIONS = 10_000_000
"""Transitions up to which a graph question that diagrams are slow to answer is asked on the rows of all states (120 MB),
unless the engine has a lower limit for rows."""

PATIENCE_PER_STATE = 3e-8
"""Seconds more that diagrams get where the alternative is a reduced system: a third of what that takes."""

ELIMINATION_STATES = 5_000_000
"""States from which on deterministic states may be eliminated: below, the rows of all states are soon written."""

ELIMINATION_MEMORY_SHARE = 0.5
"""Share of the machine's memory that a reduced system may take."""
