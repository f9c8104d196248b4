"""Pictures of diagrams and state graphs, plots, and tables.

Pictures are laid out by Graphviz (extra `view`), plots are drawn by matplotlib (extra `plot`).

>>> symcheck.view.picture(space.states, space.symbolic.encoding)  # draws itself  # doctest: +SKIP
>>> symcheck.view.state_graph(model).save("die.svg")  # doctest: +SKIP
"""

from __future__ import annotations

from symcheck.view.diagrams import dot, picture
from symcheck.view.parameters import plot_function, plot_regions
from symcheck.view.picture import Edge, Node, Picture
from symcheck.view.plots import plot_blocks, plot_bounds, plot_orders, plot_search
from symcheck.view.states import state_graph
from symcheck.view.tables import Table, results

__all__ = [
    "Edge",
    "Node",
    "Picture",
    "Table",
    "dot",
    "picture",
    "plot_blocks",
    "plot_bounds",
    "plot_function",
    "plot_orders",
    "plot_regions",
    "plot_search",
    "results",
    "state_graph",
]
