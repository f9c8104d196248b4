"""Traces: the stages of symbolic model checking as frozen frames.

A trace observes the production code and yields what it computes; this package has no algorithm of
its own. `symcheck.view` draws the diagrams of the frames.
"""

from __future__ import annotations

from symcheck.teach.blocks import BlockStructure, Level, block_structure
from symcheck.teach.compare_orders import OrderFrame, compare_orders
from symcheck.teach.construction import BuildFrame, construction
from symcheck.teach.fixpoints import SetFrame, prob0, prob1
from symcheck.teach.frontiers import SearchFrame, frontiers
from symcheck.teach.vectors import RewardTrace, UntilTrace, reward_trace, until_trace

__all__ = [
    "BlockStructure",
    "BuildFrame",
    "Level",
    "OrderFrame",
    "RewardTrace",
    "SearchFrame",
    "SetFrame",
    "UntilTrace",
    "block_structure",
    "compare_orders",
    "construction",
    "frontiers",
    "prob0",
    "prob1",
    "reward_trace",
    "until_trace",
]
