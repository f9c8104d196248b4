"""Decision diagrams as pictures.

By default the bits of a model variable are drawn as one node, with one edge per set of values that
leads to the same node: the picture is the multi-valued diagram that the binary diagram encodes.
With `bits=True`, the binary nodes are drawn. Edges to the leaf 0 are omitted. Blue nodes test the
value of a variable before a step, orange nodes the value after it (marked '), purple nodes both.
CUDD marks edges to a negated function as complement edges; pictures have none, so that a path shows
the value of a function: a negated part is drawn as nodes of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, cast, get_args

import numpy as np

from symcheck.engines.states import States
from symcheck.errors import UnsupportedError, UsageError
from symcheck.matrices.rows import Floats, Int32s, Int64s
from symcheck.options import Options
from symcheck.view.choice_graph import GivenModel
from symcheck.view.model_diagrams import matrices_of, space_of
from symcheck.view.picture import Edge, Kind, Node, Picture
from symcheck.view.values import moves_text, values_text

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, Mtbdd
    from symcheck.symbolic.encoding.variables import EncodedVariable, Encoding

__all__ = ["dot", "picture", "shared_picture"]

Part = Literal["states", "matrix"]
"""Which diagram of a model is drawn."""

_MOST_PAIRS = 2**20
"""A variable with more pairs (value, next value) than this is drawn bit by bit."""

_BITS = "solid edge: 1; dashed edge: 0; edges to the leaf 0 are omitted; no complement edges"
_VALUES = "edges are labelled with values; edges to the leaf 0 are omitted"
_KEYS: dict[Kind, tuple[str, str]] = {
    "row": ("#dce9f7", "value before a step"),
    "column": ("#fde3c8", "value after it"),
    "pair": ("#ece2f3", "both"),
}


def dot(
    diagram: Bdd | Mtbdd,
    encoding: Encoding,
    *,
    max_nodes: int = 200,
    bits: bool = False,
    title: str = "diagram",
) -> str:
    """The DOT text of `picture`."""
    return picture(diagram, encoding, max_nodes=max_nodes, bits=bits, title=title).dot


def picture(
    diagram: Bdd | Mtbdd | GivenModel | States,
    encoding: Encoding | None = None,
    *,
    part: Part = "matrix",
    max_nodes: int = 200,
    bits: bool = False,
    title: str = "diagram",
) -> Picture:
    """The picture of a decision diagram over the row and column bits of an encoding.

    Args:
        diagram: a set (BDD), a function (MTBDD), a model, or a set of states of a model.
        encoding: says which bits encode which variable; only for a set or function as a diagram.
        part: which diagram of a model is drawn: its reachable states, or its matrix. The matrices
            of the choice classes of an MDP share their nodes.
        max_nodes: the most nodes that are drawn.
        bits: draw one node per bit. Otherwise one node per variable is drawn, provided that the
            bits of each variable are adjacent in the variable order and that no variable has more
            than a thousand values.
        title: the caption.

    Raises:
        UnsupportedError: the picture has more than `max_nodes` nodes.
        UsageError: the encoding of a diagram is missing, a model has no such part, or the states
            are those of a reduced model.

    Examples:
        >>> view.picture(space.states, space.symbolic.encoding).save("states.svg")  # doctest: +SKIP
        >>> view.picture(symcheck.load("models/die/die.pm"), bits=True)  # doctest: +SKIP
        >>> view.picture(die.where("d=6"))  # doctest: +SKIP
    """
    diagrams: Sequence[Bdd | Mtbdd]
    if part not in get_args(Part):
        raise UsageError(f"part={part!r}: expected one of {', '.join(get_args(Part))}")
    if isinstance(diagram, States):
        diagrams, encoding = _set_of_states(diagram)
    elif isinstance(diagram, GivenModel):
        if part == "states":
            space = space_of(diagram)
            diagrams = [space.states]
        else:
            space, diagrams = matrices_of(diagram)
        encoding = space.symbolic.encoding
    elif encoding is None:
        raise UsageError("a diagram is drawn with its encoding: picture(diagram, encoding)")
    else:
        diagrams = [diagram]
    return shared_picture(diagrams, encoding, max_nodes=max_nodes, bits=bits, title=title)[0]


def _set_of_states(states: States) -> tuple[Sequence[Bdd], Encoding]:
    """A set of states as a diagram. Raises UsageError."""
    from symcheck.engines.symbolic.engine import SymbolicEngine
    from symcheck.symbolic.build import build
    from symcheck.symbolic.reachability.search import reach

    engine = states.engine
    if (symbolic := engine.capability(SymbolicEngine)) is not None:
        return [symbolic.from_bools(states.mask).bdd], symbolic.space.symbolic.encoding
    hint = "model.with_options(engine='mtbdd').where(…) has a diagram"
    if engine.model.builder is not None:
        raise UsageError("the states of a model without commands are no diagram", hint=hint)
    space = reach(build(engine.model, Options()))
    if space.count != engine.states:
        raise UsageError("the states of a reduced model are no diagram", hint=hint)
    # Both number the states lexicographically.
    return [space.odd.from_mask(states.mask)], space.symbolic.encoding


def shared_picture(
    diagrams: Sequence[Bdd | Mtbdd],
    encoding: Encoding,
    *,
    max_nodes: int = 200,
    bits: bool = False,
    title: str = "diagrams",
) -> tuple[Picture, tuple[str, ...]]:
    """One picture of several diagrams, all sets or all functions, which share their equal nodes.

    Args:
        diagrams: at least one.
        encoding: says which bits encode which variable.
        max_nodes: the most nodes that are drawn.
        bits: draw one node per bit (see `picture`).
        title: the caption.

    Returns:
        The picture, and the name of the root of each diagram.

    Raises:
        UnsupportedError: the picture has more than `max_nodes` nodes.
    """
    graph = _Graph.of(diagrams)
    if len(graph.level) > 64 * max_nodes:
        raise _too_many(len(graph.level), max_nodes)
    blocks = _blocks(graph, encoding)
    by_bit = bits or blocks is None
    nodes, edges, layers = (
        _binary(graph, encoding) if bits or blocks is None else _grouped(graph, blocks)
    )
    if len(nodes) > max_nodes:
        raise _too_many(len(nodes), max_nodes)
    legend = "" if not edges else _BITS if by_bit else _VALUES
    if legend and by_bit and len(diagrams) == 1:
        # A diagram in memory has the leaf 0; a set has complement edges, which save nodes.
        legend += f"\n{len(nodes)} nodes are drawn; {diagrams[0].node_count} are in memory"
    kinds = {n.kind for n in nodes}
    keys = tuple(key for kind, key in _KEYS.items() if kind in kinds) if len(kinds) > 2 else ()
    picture = Picture(title, tuple(nodes), tuple(edges), tuple(layers), legend, keys)
    return picture, tuple(f"n{root}" for root in graph.roots)


def _too_many(count: int, limit: int) -> UnsupportedError:
    return UnsupportedError(
        f"the diagram has {count:,} nodes, and at most {limit} are drawn",
        hint="draw a smaller diagram, or raise max_nodes",
    )


@dataclass(frozen=True, eq=False)
class _Graph:
    """A diagram as arrays (see `symcheck.dd.export.NodeTable`), and the bit at each level."""

    level: Int32s
    low: Int32s
    high: Int32s
    values: Floats
    roots: tuple[int, ...]
    names: tuple[str, ...]
    is_set: bool

    @staticmethod
    def of(diagrams: Sequence[Bdd | Mtbdd]) -> _Graph:
        from symcheck.dd.python_manager import PythonBdd

        if isinstance(diagrams[0], PythonBdd):
            manager = diagrams[0].manager
            table = manager.export_bdd(*cast("Sequence[PythonBdd]", diagrams))
            leaves, roots = np.array([0.0, 1.0]), tuple(table.roots.tolist())
            order = manager.order()
            return _Graph(table.level, table.low, table.high, leaves, roots, order, is_set=True)
        from symcheck.dd.cudd import extension

        core = diagrams[0].core
        by_index = core.names_by_index()
        names = tuple(by_index[core.index_at(level)] for level in range(core.size()))
        if is_set := not isinstance(diagrams[0], extension.Mtbdd):
            level, low, high, roots = extension.export_sets(core, diagrams)  # type: ignore[arg-type]
            values = np.array([0.0, 1.0])
        else:
            level, low, high, values, roots = extension.export_nodes(core, diagrams)  # type: ignore[arg-type]
        return _Graph(level, low, high, values, tuple(roots.tolist()), names, is_set)

    def is_leaf(self, node: int) -> bool:
        """Whether the node is a leaf."""
        return node < len(self.values)

    def is_zero(self, node: int) -> bool:
        """Whether the node is the leaf 0, which is not drawn."""
        return self.is_leaf(node) and self.values[node] == 0.0

    def leaf(self, node: int, layer: int) -> Node:
        """The node of the picture for a leaf of the diagram."""
        value = self.values[node]
        return Node(
            f"n{node}", str(bool(value)).lower() if self.is_set else f"{value:.6g}", layer, "leaf"
        )


@dataclass(frozen=True, eq=False)
class _Block:
    """The levels of a variable: the exponent of each bit, and whether it is a column bit."""

    variable: EncodedVariable
    levels: dict[int, tuple[int, bool]]
    rows: bool
    columns: bool

    @property
    def kind(self) -> Literal["pair", "column", "row"]:
        return "pair" if self.rows and self.columns else "column" if self.columns else "row"

    @property
    def label(self) -> str:
        name = self.variable.name
        return {"pair": f"{name} → {name}'", "column": f"{name}'", "row": name}[self.kind]


def _blocks(graph: _Graph, encoding: Encoding) -> list[_Block] | None:
    """The variables of the diagram from the top down; None if they must be drawn bit by bit."""
    at = {name: level for level, name in enumerate(graph.names)}
    used = set(graph.level[len(graph.values) :].tolist())
    blocks: list[_Block] = []
    covered: set[int] = set()
    for v in encoding.variables:
        positions = [
            (at[b], v.width - 1 - i, column)
            for column, part in ((False, v.rows), (True, v.columns))
            for i, b in enumerate(part)
        ]
        levels = {level: (exponent, column) for level, exponent, column in positions}
        if not used & set(levels):
            continue
        rows, columns = (
            any(level in used for level, _, c in positions if c is column)
            for column in (False, True)
        )
        size = v.high - v.low + 1
        if (
            max(levels) - min(levels) + 1 != len(levels)
            or (size**2 if rows and columns else size) > _MOST_PAIRS
        ):
            return None
        blocks.append(_Block(v, levels, rows, columns))
        covered |= set(levels)
    return sorted(blocks, key=lambda b: min(b.levels)) if used <= covered else None


def _grouped(graph: _Graph, blocks: list[_Block]) -> tuple[list[Node], list[Edge], list[str]]:
    """Draw one node per diagram node at which the bits of a variable begin."""
    layer_of = {level: number for number, block in enumerate(blocks) for level in block.levels}
    nodes: dict[int, Node] = {}
    edges: list[Edge] = []
    todo = list(graph.roots)
    while todo:
        number = todo.pop()
        if number in nodes:
            continue
        if graph.is_leaf(number):
            nodes[number] = graph.leaf(number, len(blocks))
            continue
        layer = layer_of[int(graph.level[number])]
        block = blocks[layer]
        now, after, targets = _walk(graph, block, number)
        nodes[number] = Node(
            f"n{number}", f"{block.label}\n{_all_values(block, now, after)}", layer, block.kind
        )
        for target in dict.fromkeys(targets.tolist()):
            here = targets == target
            edges.append(Edge(f"n{number}", f"n{target}", _text(block, now[here], after[here])))
            todo.append(target)
    return list(nodes.values()), edges, [*(b.label for b in blocks), "value"]


def _walk(graph: _Graph, block: _Block, number: int) -> tuple[Int64s, Int64s, Int64s]:
    """The pairs (value, next value) that do not lead to 0, as codes, and the node each leads to."""
    codes = np.arange(block.variable.high - block.variable.low + 1, dtype=np.int64)
    alone = np.zeros(1, dtype=np.int64)
    mesh = np.meshgrid(
        codes if block.rows else alone, codes if block.columns else alone, indexing="ij"
    )
    now, after = mesh[0].reshape(-1), mesh[1].reshape(-1)
    at = np.full(len(now), number, dtype=np.int64)
    for level in sorted(block.levels):
        exponent, column = block.levels[level]
        bit = (after if column else now) >> exponent & 1
        at = np.where(
            graph.level[at] == level, np.where(bit == 1, graph.high[at], graph.low[at]), at
        )
    leaves = np.append(graph.values, 1.0)
    keep = leaves[np.minimum(at, len(graph.values))] != 0.0
    return now[keep], after[keep], at[keep]


def _text(block: _Block, now: Int64s, after: Int64s) -> str:
    v = block.variable
    if block.kind == "pair":
        return moves_text(v, now, after)
    return values_text(v, now if block.rows else after)


def _all_values(block: _Block, now: Int64s, after: Int64s) -> str:
    """The values that do not lead to 0."""
    return values_text(block.variable, np.unique(now if block.rows else after), parts=4)


def _binary(graph: _Graph, encoding: Encoding) -> tuple[list[Node], list[Edge], list[str]]:
    """Draw one node per diagram node, labelled with the weight of its bit."""
    labels = {}
    for v in encoding.variables:
        for column, part in ((False, v.rows), (True, v.columns)):
            for i, bit in enumerate(part):
                weight = "" if v.is_bool else f"\n+{2 ** (v.width - 1 - i)}"
                labels[bit] = (v.name + "'" * column + weight, column)
    used = sorted(set(graph.level[len(graph.values) :].tolist()))
    layer = {level: number for number, level in enumerate(used)}
    nodes: list[Node] = []
    edges: list[Edge] = []
    for number in range(len(graph.level)):
        if graph.is_leaf(number):
            nodes.append(graph.leaf(number, len(used)))
            continue
        bit = graph.names[int(graph.level[number])]
        label, column = labels.get(bit, (bit, False))
        kind: Kind = "column" if column else "row"
        nodes.append(Node(f"n{number}", label, layer[int(graph.level[number])], kind))
        for child, dashed in ((int(graph.low[number]), True), (int(graph.high[number]), False)):
            if not graph.is_zero(child):
                edges.append(Edge(f"n{number}", f"n{child}", "", dashed))
    seen = {*(f"n{root}" for root in graph.roots), *(e.target for e in edges)}
    nodes = [n for n in nodes if n.name in seen]
    return nodes, edges, [*(graph.names[level] for level in used), "value"]
