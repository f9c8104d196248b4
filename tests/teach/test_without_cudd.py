"""Lessons about sets where there is no CUDD: the frames of a machine with CUDD, in pure Python."""

from __future__ import annotations

import pytest

import symcheck
from symcheck import teach, view
from symcheck.dd.python_manager import PythonManager
from symcheck.symbolic.model import StateSpace
from without_cudd import MODELS, run

GIVEN: dict[str, dict[str, object]] = {
    "die/die.pm": {},
    "dining/dining.nm": {},
    "polling/polling.sm": {},
    "kanban/kanban.sm": {"t": 2},
    "crowds/crowds.pm": {"TotalRuns": 2, "CrowdSize": 3},
}
CONSTRUCTION = "Construction of the matrix, guard by guard"
FIXPOINTS = {"prob0", "prob1"}
MODEL = pytest.mark.parametrize("path", GIVEN)


def model(path: str) -> symcheck.Model:
    return symcheck.load(MODELS / path, constants=GIVEN[path])


def printed(code: str, path: str) -> list[str]:
    """What the code prints without CUDD."""
    return run(f"model = symcheck.load({path!r}, constants={GIVEN[path]!r})\n{code}")


def spaces(path: str) -> tuple[StateSpace, StateSpace]:
    """The reachable states in CUDD, and in pure Python."""
    bound, options = model(path).bound, symcheck.Options()
    in_python = symcheck.build(bound, options, manager=PythonManager())  # type: ignore[arg-type]
    return symcheck.reach(symcheck.build(bound, options)), symcheck.reach(in_python)


@pytest.mark.parametrize("schedule", ["frontier", "chaining", "saturation"])
@MODEL
def test_the_search_finds_the_same_frontiers_in_as_many_nodes(path: str, schedule: str) -> None:
    code = f"""
for frame in teach.frontiers(model, {schedule!r}, limit=10**6):
    print(frame, frame.states.node_count, frame.frontier.node_count)
"""
    expected = [
        f"{frame} {frame.states.node_count} {frame.frontier.node_count}"
        for frame in teach.frontiers(model(path), schedule, limit=10**6)
    ]
    assert printed(code, path) == expected
    assert len(expected) > 1


@MODEL
def test_guards_and_relations_have_as_many_nodes(path: str) -> None:
    code = """
for frame in teach.construction(model):
    print(frame.stage, frame.nodes, frame.title)
"""
    lines = printed(code, path)
    kept = [line for line in lines if not line.startswith("relation")]
    frames = [f for f in teach.construction(model(path)) if f.stage in {"guard", "update"}]
    assert kept == [f"{f.stage} {f.nodes} {f.title}" for f in frames]
    relations = [int(line.split()[1]) for line in lines if line.startswith("relation")]
    space = spaces(path)[0]
    assert relations == [
        e.relation.node_count for e in space.symbolic.events if not e.guard.disjoint(space.states)
    ]
    assert relations


def test_orders_have_the_nodes_of_cudd_and_no_matrix() -> None:
    code = """
frames = list(teach.compare_orders(model))
for frame in frames:
    print(frame.order, frame.states, frame.states_nodes)
print({(f.matrix_nodes, f.peak_nodes) for f in frames})
axes = view.plot_orders(frames)
print([c.get_label() for c in axes.containers])
"""
    *lines, none, plotted = printed(code, "dining/dining.nm")
    frames = list(teach.compare_orders(model("dining/dining.nm")))
    assert lines == [f"{f.order} {f.states} {f.states_nodes}" for f in frames]
    assert (none, plotted) == ("{(None, None)}", "['states']")


@MODEL
def test_predecessors_deadlocks_and_valuations_are_the_same(path: str) -> None:
    seen = []
    for space in spaces(path):
        before = space.symbolic.predecessors(space.states) & space.states
        seen.append(
            (
                sorted(space.valuations(before)),
                sorted(space.valuations(space.deadlocks)),
                space.count,
                space.odd.count,
                [r.relation.node_count for r in space.symbolic.relations],
            )
        )
    assert seen[0] == seen[1]


@pytest.mark.parametrize("question", ["prob0", "prob1"])
@pytest.mark.parametrize(
    ("path", "left", "right"),
    [
        ("die/die.pm", "true", "d=6"),
        ("die/die.pm", "d!=1", "d>4"),
        ("gambler/gambler.pm", "true", "money=0"),
        ("queue/queue.sm", "n<5", "n=3"),
        ("polling/polling.sm", "!busy", "at=2"),
    ],
)
def test_prob0_and_prob1_of_chains_have_the_sets_of_cudd(
    path: str, left: str, right: str, question: str
) -> None:
    code = f"""
for frame in teach.{question}(symcheck.load({path!r}), {left!r}, {right!r}):
    print(frame, sorted(frame.states.odd.to_mask(frame.bdd).nonzero()[0].tolist()))
"""
    trace = getattr(teach, question)(symcheck.load(MODELS / path), left, right)
    expected = [f"{f} {sorted(f.states.odd.to_mask(f.bdd).nonzero()[0].tolist())}" for f in trace]
    assert run(code) == expected


@pytest.mark.parametrize("bits", [False, True])
@MODEL
def test_pictures_of_sets_are_the_same(path: str, bits: bool) -> None:
    drawn = []
    for space in spaces(path):
        encoding = space.symbolic.encoding
        sets = [space.states, *(e.relation for e in space.symbolic.events[:2])]
        pictures = [view.picture(s, encoding, bits=bits, max_nodes=2000) for s in sets]
        labels = [{n.name: (n.label, n.layer) for n in p.nodes} for p in pictures]
        drawn.append(
            [
                (
                    sorted(names.values()),
                    sorted((names[e.source], names[e.target], e.label) for e in p.edges),
                    p.legend,
                )
                for p, names in zip(pictures, labels, strict=True)
            ]
        )
    assert drawn[0] == drawn[1]


def test_a_trace_plays_and_a_model_draws_its_states() -> None:
    code = """
print(len(teach.frontiers(model)._repr_html_()) > 1000)
print(len(view.picture(model, part="states").nodes))
"""
    expected = len(view.picture(model("die/die.pm"), part="states").nodes)
    assert printed(code, "die/die.pm") == ["True", str(expected)]


@pytest.mark.parametrize(
    ("path", "text", "missing"),
    [
        ("die/die.pm", "P=? [ F d=6 ]", set()),
        ("dining/dining.nm", 'Pmin=? [ F "eating" ]', FIXPOINTS),
    ],
)
def test_a_page_has_the_sets_and_says_what_the_matrix_needs(
    path: str, text: str, missing: set[str]
) -> None:
    code = f"""
for show in model.page({text!r}).data["shows"]:
    print(show["name"], len(show["frames"]), show["frames"][0].get("title"))
"""
    shows = model(path).page(text).data["shows"]
    shown = {
        (s["name"], f"{s['name']} {len(s['frames'])} {s['frames'][0].get('title')}") for s in shows
    }
    lines = set(printed(code, path))
    assert "Diagrams 1 The matrix is not drawn." in lines
    others = {name for name, line in shown if line not in lines}
    assert others - missing == {CONSTRUCTION, *(n for n in others if n.startswith("Matrix"))}
    assert missing <= others
