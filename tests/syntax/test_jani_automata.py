"""Markov automata, arrays and selections in the JANI format."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import symcheck
from symcheck.errors import InputError, SymcheckError


def text(**changes: Any) -> str:
    """A queue of jobs, whose types are selected, in an array of CAPACITY cells."""
    cell = {"kind": "array", "base": {"kind": "bounded", "base": "int", "lower-bound": 0,
                                      "upper-bound": 3}}  # fmt: skip
    queue = {"op": "ac", "length": "CAPACITY", "var": "i", "exp": 0}
    selected = {
        "op": "nondet",
        "var": "j",
        "exp": {
            "op": "∧",
            "left": {"op": "≤", "left": 1, "right": "j"},
            "right": {"op": "≤", "left": "j", "right": "TYPES"},
        },
    }
    edges = [
        {
            "location": "waiting",
            "rate": {"exp": 2},
            "guard": {"exp": {"op": "<", "left": "n", "right": "CAPACITY"}},
            "destinations": [{"location": "arrived"}],
        },
        {
            "location": "arrived",
            "destinations": [
                {
                    "location": "waiting",
                    "assignments": [
                        {"ref": {"op": "aa", "exp": "q", "index": "n"}, "value": selected},
                        {"ref": "n", "value": {"op": "+", "left": "n", "right": 1}},
                    ],
                }
            ],
        },
    ]
    bounded = {"kind": "bounded", "base": "int", "lower-bound": 0, "upper-bound": "CAPACITY"}
    model = {
        "jani-version": 1,
        "name": "queue",
        "type": "ma",
        "features": ["derived-operators", "arrays", "nondet-selection"],
        "constants": [{"name": "CAPACITY", "type": "int"}, {"name": "TYPES", "type": "int"}],
        "variables": [
            {"name": "n", "type": bounded, "initial-value": 0},
            {"name": "q", "type": cell, "initial-value": queue},
        ],
        "automata": [
            {
                "name": "queue",
                "locations": [{"name": "waiting"}, {"name": "arrived"}],
                "initial-locations": ["waiting"],
                "edges": edges,
            }
        ],
        "system": {"elements": [{"automaton": "queue"}]},
    }
    return json.dumps(model | changes)


def loaded(tmp_path: Path, constants: str, **changes: Any) -> symcheck.Model:
    """The model with values of its constants."""
    path = tmp_path / "queue.jani"
    path.write_text(text(**changes), encoding="utf-8")
    return symcheck.load(path, constants)


@pytest.mark.parametrize("types", [1, 2, 3])
def test_cells_and_selections_give_all_contents_of_a_queue(tmp_path: Path, types: int):
    model = loaded(tmp_path, f"CAPACITY=3,TYPES={types}")
    # Waiting: all words of 0 to 3 jobs; a job that has arrived: those of 0 to 2.
    words = [types**n for n in range(4)]
    assert model.states.count == sum(words) + sum(words[:3])
    assert model.check("Tmin=? [ F n=3 ]").value == 1.5
    assert model.check("Pmax=? [ F q_0=TYPES & q_2=1 ]").value == 1.0


def test_more_cells_than_there_are_is_an_error(tmp_path: Path):
    with pytest.raises(InputError, match="q_up_to_16 has no values"):
        loaded(tmp_path, "CAPACITY=17,TYPES=2").bound  # noqa: B018


def test_edges_with_rates_do_not_synchronise(tmp_path: Path):
    part = {
        "locations": [{"name": "l"}],
        "initial-locations": ["l"],
        "edges": [
            {
                "location": "l",
                "action": "go",
                "rate": {"exp": 1},
                "destinations": [{"location": "l"}],
            }
        ],
    }
    changes = {
        "actions": [{"name": "go"}],
        "automata": [{"name": n, **part} for n in ("a", "b")],
        "system": {
            "elements": [{"automaton": "a"}, {"automaton": "b"}],
            "syncs": [{"synchronise": ["go", "go"], "result": "go"}],
        },
    }
    with pytest.raises(SymcheckError, match="edges with a rate cannot synchronise"):
        loaded(tmp_path, "CAPACITY=1,TYPES=1", **changes).bound  # noqa: B018
