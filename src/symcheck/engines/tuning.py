"""Thresholds and budgets of the engines, each with its reason. Figures: benchmarks/README.md, two-core Linux machine."""

from __future__ import annotations

__all__ = [
    "ELIMINATION_MEMORY_SHARE",
    "ELIMINATION_STATES",
    "FEW_TRANSITIONS",
    "GRAPH_LOOKUPS",
    "GRAPH_LOOKUPS_PER_STATE",
]

# ------------------------------------------------------------------------------------------ graph questions on diagrams

GRAPH_LOOKUPS = 500_000
"""Look-ups in CUDD's cache (a quarter of a second) that a graph question may take on diagrams before it is asked on rows,
where these are few: writing up to 10 million transitions takes about as long."""

FEW_TRANSITIONS = 10_000_000
"""Transitions up to which a graph question that diagrams are slow to answer is asked on the rows of all states (120 MB),
unless the engine has a lower limit for rows."""

GRAPH_LOOKUPS_PER_STATE = 0.06
"""Look-ups more per state where the alternative is a reduced system: a third of the work that takes."""

ELIMINATION_STATES = 5_000_000
"""States from which on deterministic states may be eliminated: below, the rows of all states are soon written."""

ELIMINATION_MEMORY_SHARE = 0.5
"""Share of the machine's memory that a reduced system may take."""
