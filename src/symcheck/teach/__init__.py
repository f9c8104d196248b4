"""Films: the stages of symbolic model checking as frozen frames.

No algorithm of its own: each film walks through the production code's functions, generators and observers, and yields what
they make. `symcheck.view` draws the diagrams of the frames.
"""

from __future__ import annotations

from symcheck.teach.blocks import Anatomy, Level, anatomy
from symcheck.teach.compare_orders import OrderFrame, order_lab
from symcheck.teach.construction import BuildFrame, construction
from symcheck.teach.fixpoints import SetFrame, prob0, prob1
from symcheck.teach.frontiers import SearchFrame, frontiers
from symcheck.teach.vectors import Vectors, vectors

__all__ = [
    "Anatomy",
    "BuildFrame",
    "Level",
    "OrderFrame",
    "SearchFrame",
    "SetFrame",
    "Vectors",
    "anatomy",
    "construction",
    "frontiers",
    "order_lab",
    "prob0",
    "prob1",
    "vectors",
]
