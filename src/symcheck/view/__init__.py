"""Looking at the values of the path: diagrams and state graphs as DOT and SVG, plots (extra `plot`), tables.

>>> symcheck.view.picture(space.states, space.symbolic.encoding)   # draws itself in Jupyter  # doctest: +SKIP
>>> print(symcheck.view.dot(space.states, space.symbolic.encoding))  # doctest: +SKIP
"""

from __future__ import annotations

from symcheck.view.diagrams import dot, picture
from symcheck.view.dot import graphviz
from symcheck.view.graph import Edge, Node
from symcheck.view.matplotlib_figures import draw
from symcheck.view.picture import Picture
from symcheck.view.plots import plot_blocks, plot_bounds, plot_orders, plot_search
from symcheck.view.states import state_graph
from symcheck.view.tables import Table, results

__all__ = [
    "Edge",
    "Node",
    "Picture",
    "Table",
    "dot",
    "draw",
    "graphviz",
    "picture",
    "plot_blocks",
    "plot_bounds",
    "plot_orders",
    "plot_search",
    "results",
    "state_graph",
]
