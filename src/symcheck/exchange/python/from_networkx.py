"""Models from graphs of networkx."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from functools import partial
from keyword import iskeyword
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack

from symcheck.api.arguments import takes_options
from symcheck.api.model import Model
from symcheck.errors import UsageError
from symcheck.exchange.python.from_function import Weight, model_of_steps
from symcheck.exchange.python.from_matrix import named, plain_type
from symcheck.options import OptionValues, make_options
from symcheck.syntax.ast import ModelType
from symcheck.tables import optional_package

if TYPE_CHECKING:
    from networkx import DiGraph

__all__ = ["from_networkx"]


@takes_options
def from_networkx(
    graph: DiGraph,
    *,
    weight: str = "probability",
    labels: Mapping[str, Iterable[Hashable]] | None = None,
    rewards: Mapping[str, Mapping[Hashable, Weight]] | None = None,
    initial: Hashable | None = None,
    type: ModelType | str | None = None,
    **options: Unpack[OptionValues],
) -> Model:
    """A model of the nodes of a directed graph that can be reached from the initial one.

    Attributes that all nodes have, with integers or truth values, are the variables if they tell
    the nodes apart. Otherwise all of them are ignored, and the variable `s` is the number of the
    node in the graph.

    Args:
        graph: a `DiGraph`, or for an MDP a `MultiDiGraph`: the edges that leave a node and agree in
            `action` and `choice` (either may be missing) form one distribution. `choice` tells
            choices with the same action apart.
        weight: the attribute of the edges with their probability (rate of a CTMC).
        labels: name to the nodes that have the label.
        rewards: name to the rewards of nodes; others have 0.
        initial: the initial node; None: those in the list
            `graph.graph["initial"]`, or the first node.
        type: 'dtmc', 'ctmc' or 'mdp'; None: an MDP if the graph is a multigraph, else a DTMC.
        options: see `symcheck.Options`.

    Raises:
        ModelFault: the weights of a node do not sum to 1.
        UsageError: an edge has no weight, or a node is not in the graph.

    Examples:
        >>> import networkx, symcheck
        >>> graph = networkx.DiGraph()
        >>> graph.add_weighted_edges_from(
        ...     [("on", "off", 0.1), ("on", "on", 0.9), ("off", "off", 1)], weight="probability")
        >>> symcheck.from_networkx(graph, labels={"off": ["off"]}).check('T=? [ F "off" ]').value
        10.0
    """
    networkx = optional_package("networkx", "frames")
    if not isinstance(graph, networkx.Graph) or not graph.is_directed():
        raise UsageError(f"expected a directed graph of networkx, not {graph!r}")
    kind = plain_type(type) or ModelType.with_properties(has_choices=graph.is_multigraph())
    nodes = list(graph.nodes)
    if not nodes:
        raise UsageError("the graph has no nodes")
    states = _states(graph, nodes)
    node_of = {state: node for node, state in states.items()}

    def state(node: Hashable, what: str) -> Hashable:
        try:
            return states[node]
        except (KeyError, TypeError):  # TypeError: a list, say, which cannot be a node
            raise UsageError(f"{what}: the graph has no node {node!r}") from None

    def step(source: Hashable) -> Any:
        choices: dict[tuple[object, str | None], list[tuple[Weight, Hashable]]] = {}
        for _, target, given in graph.out_edges(node_of[source], data=True):
            name = f"the edge from {node_of[source]!r} to {target!r}"
            if weight not in given:
                known = ", ".join(map(str, given)) or "none"
                hint = f"weight= names the attribute; those of this edge: {known}"
                raise UsageError(f"{name} has no '{weight}'", hint=hint)
            if not isinstance(given[weight], Real):
                raise UsageError(f"{name} has {weight}={given[weight]!r}: expected a number")
            key = (given.get("choice"), given.get("action")) if kind.has_choices else (None, None)
            choices.setdefault(key, []).append((given[weight], states[target]))
        if kind.has_choices:
            return [(action, moves) for (_, action), moves in choices.items()]
        return next(iter(choices.values()), None)

    members, earned = {}, {}
    for name, of_label in named("labels", labels).items():
        what = f"labels[{name!r}]"
        if isinstance(of_label, str) or not isinstance(of_label, Iterable):
            raise UsageError(f"{what}: expected a list of nodes, not {of_label!r}")
        members[name] = {state(node, what) for node in of_label}
    for name, of_nodes in named("rewards", rewards).items():
        what = f"rewards[{name!r}]"
        if not isinstance(of_nodes, Mapping):
            raise UsageError(f"{what}: expected a mapping from nodes, not {of_nodes!r}")
        earned[name] = {state(node, what): x for node, x in of_nodes.items()}
    starts = graph.graph.get("initial", nodes[:1]) if initial is None else [initial]
    return model_of_steps(
        [state(node, "initial") for node in starts],
        step,
        {name: of.__contains__ for name, of in members.items()},
        {name: partial(_reward, of) for name, of in earned.items()},
        kind,
        len(nodes),
        make_options(options),
        node_of,
    )


def _reward(of: Mapping[Hashable, Weight], state: Hashable) -> Weight:
    return of.get(state, 0)


def _states(graph: Any, nodes: list[Hashable]) -> dict[Hashable, Hashable]:
    """The state of each node: the values of its variables, or its number."""
    attributes = [dict(graph.nodes[node]) for node in nodes]
    names = [
        name
        for name in attributes[0]
        if _is_field(name) and all(isinstance(given.get(name), Integral) for given in attributes)
    ]
    values = [tuple(given[name] for name in names) for given in attributes]
    if not names or len(set(values)) < len(values):
        return {node: number for number, node in enumerate(nodes)}
    kind: Any = NamedTuple("State", [(name, int) for name in names])  # type: ignore[misc]
    return {node: kind(*value) for node, value in zip(nodes, values, strict=True)}


def _is_field(name: object) -> bool:
    """Whether a name can be that of a field of a named tuple."""
    plain = isinstance(name, str) and name.isidentifier() and not iskeyword(name)
    return plain and not str(name).startswith("_")
