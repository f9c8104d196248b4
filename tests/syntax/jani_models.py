"""Small JANI models, written as Python values."""

from __future__ import annotations

import json

__all__ = ["automaton", "binary", "edge", "filtered", "model", "text", "variable"]


def binary(op, left, right):
    return {"op": op, "left": left, "right": right}


def variable(name, low=None, high=None, initial=0, *, transient=False, kind="int"):
    base = (
        {"kind": "bounded", "base": "int", "lower-bound": low, "upper-bound": high}
        if high is not None
        else kind
    )
    found = {"name": name, "type": base}
    if initial is not None:
        found["initial-value"] = initial
    if transient:
        found["transient"] = True
    return found


def edge(location, *destinations, guard=None, action=None, rate=None):
    """A destination is (location, {variable: value} or a list of assignments[, probability])."""
    found = {"location": location, "destinations": []}
    for target, assignments, *probability in destinations:
        if isinstance(assignments, dict):
            assignments = [{"ref": n, "value": v} for n, v in assignments.items()]
        one = {"location": target, "assignments": assignments}
        if probability:
            one["probability"] = {"exp": probability[0]}
        found["destinations"].append(one)
    for key, value in (("guard", guard), ("rate", rate)):
        if value is not None:
            found[key] = {"exp": value}
    if action is not None:
        found["action"] = action
    return found


def automaton(name, locations, edges, variables=(), initial=None, **others):
    """Locations are names, or pairs of a name and the values of transient variables."""
    parts = []
    for location in locations:
        name_, values = (location, {}) if isinstance(location, str) else location
        parts.append(
            {"name": name_, "transient-values": [{"ref": n, "value": v} for n, v in values.items()]}
        )
    return {
        "name": name,
        "locations": parts,
        "initial-locations": initial or [parts[0]["name"]],
        "variables": list(variables),
        "edges": list(edges),
        **others,
    }


def filtered(values, fun="values"):
    return {"op": "filter", "fun": fun, "values": values, "states": {"op": "initial"}}


def model(kind, automata, *, variables=(), syncs=None, properties=None, elements=None, **others):
    system = {"elements": elements or [{"automaton": a["name"]} for a in automata]}
    if syncs is not None:
        system["syncs"] = [{"synchronise": s, "result": r} for s, r in syncs]
    actions = {e["action"] for a in automata for e in a["edges"] if "action" in e} | {
        r for _, r in syncs or () if r
    }
    return {
        "jani-version": 1,
        "name": "test",
        "type": kind,
        "features": ["derived-operators"],
        "actions": [{"name": a} for a in sorted(actions)],
        "variables": list(variables),
        "automata": list(automata),
        "system": system,
        "properties": [{"name": n, "expression": e} for n, e in (properties or {}).items()],
        **others,
    }


def text(found):
    return json.dumps(found, ensure_ascii=False, indent=1)


def _die():
    """Knuth and Yao's die: the locations are the nodes of its tree."""
    half = 0.5
    tree = {
        "s0": ("s1", "s2"),
        "s1": ("s3", "s4"),
        "s2": ("s5", "s6"),
        "s3": ("s1", 1),
        "s4": (2, 3),
        "s5": (4, 5),
        "s6": ("s2", 6),
    }
    edges = []
    for source, targets in tree.items():
        ends = [
            (t, {"tosses": 1}, half) if isinstance(t, str) else ("end", {"d": t, "tosses": 1}, half)
            for t in targets
        ]
        edges.append(edge(source, *ends))
    edges.append(edge("end", ("end", {})))
    places = [*tree, ("end", {"done": True})]
    return model(
        "dtmc",
        [automaton("die", places, edges)],
        variables=[
            variable("d", 0, 6),
            variable("tosses", kind="real", transient=True),
            variable("done", kind="bool", initial=False, transient=True),
        ],
        properties={
            "six": filtered({"op": "Pmax", "exp": {"op": "F", "exp": binary("=", "d", 6)}}),
            "length": filtered(
                {"op": "Emin", "exp": "tosses", "accumulate": ["steps"], "reach": "done"}
            ),
            "soon": filtered(
                binary(
                    "≥",
                    {"op": "Pmin", "exp": {"op": "F", "exp": "done", "step-bounds": {"upper": 3}}},
                    0.75,
                )
            ),
            "three": filtered(
                {"op": "Emax", "exp": "tosses", "accumulate": ["steps"], "step-instant": 4}
            ),
        },
    )


def _handshake():
    """Two automata: `put` synchronises, `get` is the result of two vectors, and rewards of edges differ."""
    producer = automaton(
        "producer",
        [("idle", {"waiting": 1}), "busy"],
        [
            edge(
                "idle",
                ("busy", {"n": binary("+", "n", 1)}, 0.25),
                ("idle", {}, 0.75),
                action="make",
                guard=binary("<", "n", 3),
            ),
            edge("busy", ("idle", {"cost": 2}), action="put"),
            edge("busy", ("busy", {"cost": 5}), guard=binary("=", "n", 1)),
        ],
        [variable("n", 0, 3)],
    )
    consumer = automaton(
        "consumer",
        ["empty", ("full", {"waiting": 4})],
        [
            edge("empty", ("full", {}), action="put"),
            edge("full", ("empty", {"cost": 1}), action="get"),
            edge("full", ("full", {"cost": 3}), action="look"),
        ],
    )
    return model(
        "mdp",
        [producer, consumer],
        variables=[
            variable("cost", kind="real", transient=True),
            variable("waiting", kind="real", transient=True),
        ],
        syncs=[
            (["make", None], "make"),
            (["put", "put"], "put"),
            ([None, "get"], "get"),
            ([None, "look"], "get"),
        ],
        properties={
            "most": filtered(
                {"op": "Emax", "exp": "cost", "accumulate": ["steps"], "step-instant": 6}
            ),
            "both": filtered(
                {
                    "op": "Emax",
                    "exp": binary("+", "cost", "waiting"),
                    "accumulate": ["steps", "exit"],
                    "step-instant": 6,
                }
            ),
            "now": filtered({"op": "Emax", "exp": "waiting", "step-instant": 5}),
        },
    )


def _value_passing():
    """A receiver reads, at index 1, what its sender assigns at index 0 of the same event."""
    sender = automaton(
        "sender",
        ["l"],
        [
            edge(
                "l",
                ("l", [{"ref": "message", "value": 1}], 0.5),
                ("l", [{"ref": "message", "value": 2}], 0.5),
                action="send",
            )
        ],
    )
    receiver = automaton(
        "receiver",
        ["wait", "have"],
        [
            edge(
                "wait",
                ("have", [{"ref": "got", "value": binary("+", "got", "message"), "index": 1}]),
                action="receive",
            ),
            edge("have", ("wait", {}), guard=binary("<", "got", 4)),
            edge("have", ("have", {}), guard=binary("≥", "got", 4)),
        ],
    )
    return model(
        "mdp",
        [sender, receiver],
        variables=[variable("message", 0, 2), variable("got", 0, 8)],
        syncs=[(["send", "receive"], "move")],
        properties={
            "four": filtered({"op": "Pmax", "exp": {"op": "F", "exp": binary("=", "got", 4)}})
        },
    )


def _queue():
    """A CTMC: a queue of three places whose server breaks down; the rate of an arrival is a constant."""
    server = automaton(
        "server",
        ["up", ("down", {"broken": True})],
        [
            edge(
                "up",
                ("up", {"n": binary("-", "n", 1), "served": 1}),
                guard=binary(">", "n", 0),
                rate=2,
                action="serve",
            ),
            edge("up", ("down", {}, 0.5), ("up", {}, 0.5), rate=0.5),
            edge("down", ("up", {}), rate=1),
        ],
    )
    source = automaton(
        "source",
        [("l", {"length": "n"})],
        [
            edge(
                "l",
                ("l", {"n": binary("+", "n", 1)}),
                guard=binary("<", "n", "size"),
                rate="lambda",
                action="arrive",
            )
        ],
    )
    return model(
        "ctmc",
        [server, source],
        constants=[
            {"name": "lambda", "type": "real", "value": 1.5},
            {"name": "size", "type": "int"},
        ],
        variables=[
            variable("n", 0, "size"),
            variable("served", kind="real", transient=True),
            variable("length", kind="real", transient=True),
            variable("broken", kind="bool", initial=False, transient=True),
        ],
        syncs=[(["serve", None], "serve"), ([None, "arrive"], "arrive")],
        properties={
            "full": filtered(
                {
                    "op": "Pmax",
                    "exp": {
                        "op": "U",
                        "left": {"op": "¬", "exp": "broken"},
                        "right": binary("=", "n", "size"),
                        "time-bounds": {"upper": 2},
                    },
                }
            ),
            "served": filtered(
                {"op": "Emax", "exp": "served", "accumulate": ["steps"], "time-instant": 3}
            ),
            "length": filtered({"op": "Emax", "exp": "length", "time-instant": 1.5}),
            "area": filtered(
                {"op": "Emax", "exp": "length", "accumulate": ["time"], "time-instant": 1.5}
            ),
            "average": filtered({"op": "Smax", "exp": "length", "accumulate": ["time"]}),
            "down": filtered({"op": "Smax", "exp": "broken"}),
        },
    )


MODELS = {
    "die": _die(),
    "handshake": _handshake(),
    "value_passing": _value_passing(),
    "queue": _queue(),
}
CONSTANTS = {"queue": {"size": 3}}
