"""State graphs as pictures: layers by distance from the initial states."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import chain, pairwise
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from symcheck.check.counterexample import Counterexample
from symcheck.check.result import Result
from symcheck.engines.base import Engine, erased
from symcheck.errors import UnsupportedError, UsageError
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Bools, Int64s
from symcheck.view.choice_graph import (
    ChoiceGraph,
    Source,
    States,
    StatesOnPath,
    engine_of,
    number_text,
    refuse,
    strategy_of,
)
from symcheck.view.picture import WINDOW, Edge, Emphasis, Kind, Node, Picture, Room

if TYPE_CHECKING:
    from symcheck.engines.explicit.strategy import Strategy

__all__ = [
    "draw_states",
    "nearest_that_fit",
    "neighbourhood",
    "paths_graph",
    "state_graph",
    "strategy_graph",
]

_COLOURS = ("#fbe3a2", "#f6c6bd", "#c9e4c5", "#d9cdec", "#bfe3ea", "#e6d3b8")
_NAMED = 40
"""States up to which each is labelled with the names of its variables."""
_MOST_TRANSITIONS = 4000
"""Transitions that are drawn: Graphviz takes seconds for more, and lines cover each other."""
_MANY_VARIABLES = 6
"""With more variables than this, those with one value in all drawn states are in the legend."""
_NEAREST = 24
"""States near others that are drawn if they fit a window."""
_FEWEST = 6
"""States near others that are drawn even if they do not fit a window."""
_MOST_DRAWN_EDGES = 60
"""Edges of a picture that fits a window; more cover each other."""
_MOST_MARKED = 120
"""States around which others are drawn."""
_MOST_WHOLE = 60
"""States of a strategy that are all drawn; of more, as many as can be read."""
_MOST_LISTED = 200_000
"""States of a model of which a neighbourhood is drawn: their valuations are listed."""
PathTransition = tuple[int, int, str | None]
_WIDE = 9
"""Layers with more states than this are drawn as columns: labels are wider than high."""


def state_graph(
    model: Source,
    *,
    values: Result | Sequence[float] | Sequence[str] | NDArray[np.generic] | None = None,
    strategy: Strategy | Result | None = None,
    sets: Mapping[str, States] | None = None,
    path: StatesOnPath | Counterexample | None = None,
    around: States | None = None,
    radius: int = 2,
    marked: States | None = None,
    max_states: int = 200,
    names: bool | None = None,
    title: str = "states",
) -> Picture:
    """The state graph of a model: transitions carry probabilities (rates); choices are points.

    Args:
        model: a model, an explored model or an engine.
        values: what is written into the states: a result, or a number (float64[n]) or a text for
            each.
        strategy: a strategy, or a result that has one; its choices are bold. A strategy with memory
            is drawn on the product of the model with its memory.
        sets: sets of states by name, each in a colour of its own: formulas such as "d=6", sets of
            the engine, bool[n], or numbers of states.
        path: states whose transitions are red: a random path, a witness, states as tuples, or a
            counterexample, of which all paths are drawn.
        around: draw only states within `radius` steps, forward or backward, of these.
        radius: see `around`.
        marked: states that are drawn in green.
        max_states: the most states that are drawn.
        names: write the names of variables into the states. None: up to 40 states; the legend has
            the names otherwise.
        title: the caption.

    Raises:
        UnsupportedError: there would be more than `max_states` states, or 4 000 transitions.
        UsageError: values, strategy or path do not belong to the model.
        InputError: a formula is faulty.

    Examples:
        >>> die = symcheck.load("models/die/die.pm")  # doctest: +SKIP
        >>> view.state_graph(die, values=die.check("P=? [ F d=6 ]"), sets={"six": "d=6"})
        ... # doctest: +SKIP
    """
    engine = engine_of(model)
    chosen = None if strategy is None else strategy_of(strategy)
    if chosen is not None:
        engine = erased(chosen.engine)
        if chosen.memory is not None and values is not None:
            raise UsageError("values cannot be drawn on the product with the memory of a strategy")
    graph = ChoiceGraph(engine, chosen)
    drawn, distance = _part(graph, around, radius, max_states)
    leaving = int(graph.successor_counts[drawn].sum())
    if leaving > _MOST_TRANSITIONS:
        raise refuse(leaving, _MOST_TRANSITIONS, "transitions")
    if sets is not None and not isinstance(cast(object, sets), Mapping):
        raise UsageError('sets: expected a mapping from names, such as {"goal": "x=1"}')
    coloured = {} if sets is None else {name: graph.members(s) for name, s in sets.items()}
    return draw_states(
        graph,
        drawn,
        distance,
        numbers=None if values is None else [_value(v) for v in graph.numbers(values)],
        choices=None if chosen is None else _emphases(graph, chosen),
        weights=None if chosen is None else chosen.weights,
        sets=coloured,
        steps=() if path is None else _steps(graph, path),
        marked=None if marked is None else graph.members(marked),
        names=names,
        title=title,
    ).fitted()


def neighbourhood(
    model: Source,
    around: States,
    *,
    max_states: int = _NEAREST,
    radius: int = 3,
    room: Room = WINDOW,
) -> tuple[Picture, int]:
    """The states near some states, as many as can be read.

    Args:
        model: a model, an explored model or an engine.
        around: the states in the middle, which are drawn in green.
        max_states: the most states that are drawn.
        radius: the largest distance, in steps forward or backward.
        room: where the picture is shown.

    Returns:
        The picture, and the largest distance of a state that is drawn.

    Raises:
        UnsupportedError: the model has more than 200 000 states, those in the middle are too many,
            or pygraphviz is not installed.
    """
    engine = engine_of(model)
    if engine.states > _MOST_LISTED:
        raise UnsupportedError(
            f"{engine.states:,} states are too many for a picture of some of them"
        )
    graph = ChoiceGraph(engine)
    start = _members(graph, around)
    if int(start.sum()) > _MOST_MARKED:
        raise refuse(int(start.sum()), _MOST_MARKED)
    near = graph.distances(start, radius, 0, back=True)
    forward = graph.distances(start, radius, 0, back=False)
    order = np.lexsort((forward < 0, near))
    order = order[near[order] >= 0]
    least = max(_FEWEST, int(start.sum()))

    def draw(drawn: Int64s) -> Picture:
        return draw_states(graph, drawn, forward, marked=start)

    drawn, picture = nearest_that_fit(order, draw, max(max_states, least), least, room)
    return picture, int(near[drawn].max())


def paths_graph(
    model: Source,
    path: StatesOnPath | Counterexample,
    *,
    max_states: int = 120,
    room: Room = WINDOW,
) -> tuple[Picture, int]:
    """A path in red, or the likeliest paths of a counterexample, as many as can be read.

    Args:
        model: a model, an explored model or an engine.
        path: a random path, a witness, states as tuples, or a counterexample.
        max_states: the most states that are drawn. Others than those of the paths are not.
        room: where the picture is shown.

    Returns:
        The picture, and the number of paths in it.

    Raises:
        UnsupportedError: the first path has more states, or pygraphviz is not installed.
    """
    graph = ChoiceGraph(engine_of(model))
    path = path if isinstance(path, Counterexample) else list(path)
    given = path.paths if isinstance(path, Counterexample) else [path]
    steps = _steps(graph, path)
    paths = [dict.fromkeys(graph.number(state) for state in each) for each in given]
    if len(paths[0]) > max_states:
        raise refuse(len(paths[0]), max_states)
    order = np.array(list(dict.fromkeys(chain.from_iterable(paths))))
    start = graph.members([next(iter(each)) for each in paths])
    distance = graph.distances(start, None, 1 << 62, back=False)

    def draw(drawn: Int64s) -> Picture:
        return draw_states(graph, drawn, distance, steps=steps, alone=True)

    drawn, picture = nearest_that_fit(order, draw, max_states, len(paths[0]), room)
    whole = [each for each in paths if each.keys() <= set(drawn.tolist())]
    if len(whole) < len(paths):  # without states of paths that are not drawn
        picture = draw(np.array(sorted(set(chain.from_iterable(whole))))).sized(room)[0]
    return picture, len(whole)


def strategy_graph(strategy: Strategy, *, room: Room = WINDOW) -> tuple[Picture, int]:
    """The states with the choices of a strategy; of many, those nearest to the initial states.

    Returns:
        The picture, and the number of states in it.

    Raises:
        UnsupportedError: pygraphviz is not installed.
    """
    graph = ChoiceGraph(erased(strategy.engine), strategy)
    distance = graph.distances(graph.initial, None, 1 << 62, back=False)
    choices = _emphases(graph, strategy)

    def draw(drawn: Int64s) -> Picture:
        weights = strategy.weights
        return draw_states(graph, drawn, distance, choices=choices, weights=weights)

    states = np.arange(graph.engine.states)
    if len(states) <= _MOST_WHOLE:
        return draw(states).sized(room)[0], len(states)
    order = states[np.argsort(distance, kind="stable")]
    drawn, picture = nearest_that_fit(order[distance[order] >= 0], draw, _NEAREST, room=room)
    return picture, len(drawn)


def nearest_that_fit(
    order: Int64s,
    draw: Callable[[Int64s], Picture],
    most: int,
    fewest: int = _FEWEST,
    room: Room = WINDOW,
) -> tuple[Int64s, Picture]:
    """The first states of an order whose picture fits a window, as many as there can be.

    Args:
        order: the numbers of the states, the nearest ones first.
        draw: the picture of some states, ascending.
        most: the most states.
        fewest: so many are drawn even if they do not fit.
        room: where the picture is shown.

    Returns:
        The numbers of the states, ascending, and their picture.

    Raises:
        UnsupportedError: pygraphviz is not installed.
    """
    count = min(most, len(order))
    while True:
        drawn = np.sort(order[:count])
        last = count <= fewest
        picture = draw(drawn)
        if last or len(picture.edges) <= _MOST_DRAWN_EDGES:
            picture, share = picture.sized(room)
            if last or share >= 1:
                return drawn, picture
        count = max(fewest, count * 3 // 4)


def _part(
    graph: ChoiceGraph, around: States | None, radius: int, max_states: int
) -> tuple[Int64s, Int64s]:
    """The states to be drawn, and their distances. Raises UnsupportedError."""
    engine: Engine = graph.engine
    if around is None:
        if engine.states > max_states:
            raise refuse(engine.states, max_states)
        return np.arange(engine.states), graph.distances(graph.initial, None, 1 << 62, back=False)
    start = _members(graph, around)
    drawn = np.flatnonzero(graph.distances(start, radius, 0, back=True) >= 0)
    if len(drawn) > max_states:
        raise refuse(len(drawn), max_states)
    return drawn, graph.distances(start, radius, 0, back=False)


def _members(graph: ChoiceGraph, around: States) -> Bools:
    """The states around which others are drawn. Raises UsageError if there are none."""
    start = graph.members(around)
    if not start.any():
        raise UsageError(f"around={around!r}: no state is in this set, and nothing would be drawn")
    return start


def _emphases(graph: ChoiceGraph, strategy: Strategy) -> Sequence[Emphasis]:
    """Which rows a strategy takes; "" where its choice does not matter."""
    colours = np.where(strategy.matters[graph.matrix.state_of_row], "other", "").astype(object)
    taken = strategy.taken
    colours[taken[colours[taken] == "other"]] = "chosen"
    return cast(Sequence[Emphasis], colours)


def _steps(graph: ChoiceGraph, path: StatesOnPath | Counterexample) -> Sequence[PathTransition]:
    """The transitions of a path, or of all paths of a counterexample, with their actions."""
    if isinstance(path, Counterexample):
        found = {
            (graph.number(a), graph.number(b), action)
            for each in path.paths
            for (a, b), action in zip(pairwise(each), each.actions, strict=True)
        }
        return sorted(found)
    numbers = [graph.number(s) for s in path]
    return [(a, b, None) for a, b in pairwise(numbers)]


def _varying(states: Sequence[Sequence[bool | int]]) -> Sequence[int] | None:
    """The numbers of the variables that differ among states of many variables; None: all."""
    if len(states) < 2 or len(states[0]) <= _MANY_VARIABLES:
        return None
    columns = zip(*states, strict=True)
    return [i for i, column in enumerate(columns) if any(x != column[0] for x in column)]


def _value(value: object) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, bool | np.bool_):
        return str(bool(value)).lower()
    return number_text(value)  # type: ignore[arg-type]


def draw_states(
    graph: ChoiceGraph,
    drawn: Int64s,
    distance: Int64s,
    *,
    numbers: Sequence[str] | None = None,
    choices: Sequence[Emphasis] | None = None,
    weights: Numbers | None = None,
    sets: Mapping[str, Bools] | None = None,
    steps: Sequence[PathTransition] = (),
    marked: Bools | None = None,
    names: bool | None = None,
    alone: bool = False,
    title: str = "states",
) -> Picture:
    """The picture of some states of a graph.

    The node of state 3 is called s3; an edge of row 5 that leads to it has the classes r5 and t3.

    Args:
        graph: the states.
        drawn: the numbers of those that are drawn.
        distance: the layer of each state of the graph; -1: in no layer.
        numbers: a text for each state of the graph, below its label.
        choices: per row, whether a strategy takes it; "" where its choice does not matter.
        weights: per row, the probability with which a randomised strategy takes it.
        sets: states in a colour.
        steps: transitions of a path, with their actions; None for any action.
        marked: states in green.
        names: write the names of variables; None: up to 40 states.
        alone: nothing tells of the transitions that lead to states that are not drawn.
        title: the caption.
    """
    has_choices = graph.matrix.groups is not None
    named = len(drawn) <= _NAMED if names is None else names
    shown = _varying([graph.valuations[s] for s in drawn.tolist()]) if named else None
    spread = 2 if has_choices else 1
    layer = {s: spread * int(distance[s]) for s in drawn.tolist()}
    keys = _colours(sets or {})
    nodes, edges = [], []
    outside: list[int] = []
    taken: dict[tuple[int, int], set[str | None]] = {}
    for s, t, action_taken in steps:
        taken.setdefault((s, t), set()).add(action_taken)

    def on_path(s: int, t: int, action: str) -> bool:
        actions = taken.get((s, t), set())
        return bool(actions) and (not has_choices or None in actions or action in actions)

    for s in drawn.tolist():
        label = graph.text(graph.valuations[s], named=named, width=3 if named else 8, shown=shown)
        if numbers is not None:
            label += f"\n{numbers[s]}"
        fill = next((c for c, (_, members) in keys.items() if members[s]), "")
        nodes.append(Node(f"s{s}", label, layer[s], _kind(graph, s, marked), fill))
        of_chain = {} if has_choices else graph.actions_to(s)
        for number, choice in enumerate(graph.choices(s)):
            emphasis: Emphasis = "" if choices is None else choices[choice.row]
            source, row = f"s{s}", f"r{choice.row}"
            action = choice.action
            if weights is not None and emphasis and 0 < weights[choice.row] < 1:
                action = f"{action} ({number_text(weights[choice.row])})".strip()
            # A choice with one successor is an edge; one with several leads to a point.
            inside = any(t in layer for t, _ in choice.successors)
            if alone and not inside:
                continue
            if has_choices and inside and len(choice.successors) > 1:
                source = f"c{s}_{number}"
                nodes.append(Node(source, "", layer[s] + 1 if layer[s] >= 0 else -1, "choice"))
                leads = any(on_path(s, t, choice.action) for t, _ in choice.successors)
                lead: Emphasis = "path" if leads else emphasis
                edges.append(Edge(f"s{s}", source, action, False, lead, row))
            rest = 0.0
            for i, (t, p) in enumerate(choice.successors):
                if t not in layer:
                    rest += float(p)
                    continue
                text = action if has_choices and source == f"s{s}" else choice.text(i)
                text = f"{text} {of_chain[t]}" if of_chain.get(t) else text
                kind: Emphasis = "path" if on_path(s, t, choice.action) else emphasis
                edges.append(Edge(source, f"s{t}", text, False, kind, f"{row} t{t}"))
            if rest and not alone:
                if outside[-1:] != [s]:
                    outside.append(s)
                    nodes.append(Node(f"m{s}", "…", -1, "root"))
                text = "" if choice.lower else number_text(rest)  # sums of ends bound nothing
                text = action if has_choices and source == f"s{s}" else text
                edges.append(Edge(source, f"m{s}", text, True, emphasis, row))
    widest = max(np.unique([d for d in layer.values() if d >= 0], return_counts=True)[1], default=0)
    depth = max(layer.values(), default=0) + spread
    return Picture(
        title,
        tuple(nodes),
        tuple(edges),
        ("",) * depth,
        _legend(
            graph,
            drawn,
            named=named,
            outside=bool(outside),
            strategy=choices is not None,
            shown=shown,
            path=bool(steps),
        ),
        tuple((colour, name) for colour, (name, _) in keys.items()),
        sideways=int(widest) > _WIDE,
    )


def _colours(sets: Mapping[str, Bools]) -> dict[str, tuple[str, Bools]]:
    """A colour for each set. Raises UsageError if there are too many."""
    if len(sets) > len(_COLOURS):
        raise UsageError(f"at most {len(_COLOURS)} sets are drawn, not {len(sets)}")
    return dict(zip(_COLOURS, sets.items(), strict=False))


def _kind(graph: ChoiceGraph, state: int, marked: Bools | None) -> Kind:
    if marked is not None and marked[state]:
        return "marked"
    return "initial" if graph.initial[state] else "state"


def _legend(
    graph: ChoiceGraph,
    drawn: Int64s,
    *,
    named: bool,
    outside: bool,
    strategy: bool,
    shown: Sequence[int] | None,
    path: bool,
) -> str:
    """What the states and edges mean, as far as it is not obvious."""
    parts = []
    if not named:
        truths = (
            "; t: true, f: false"
            if any(v is True or v is False for v in graph.valuations[0])
            else ""
        )
        names = [", ".join(graph.names[i : i + 12]) for i in range(0, len(graph.names), 12)]
        parts.append("states are (" + ",\n".join(names) + f"){truths}")
    if shown is not None:
        first = graph.valuations[int(drawn[0])]
        same = [i for i in range(len(first)) if i not in set(shown)]
        text = graph.text(first, named=True, width=8, shown=same)
        parts += [f"in all states: {text}"] if same else []
    parts += ["bold: the choices of the strategy"] if strategy else []
    parts += ["red: on a path"] if path else []
    parts += ["dashed: to states that are not drawn"] if outside else []
    return "\n".join(parts)
