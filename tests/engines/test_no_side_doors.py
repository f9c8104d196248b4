"""Other packages use engines through their protocols, and ask for more with `engine.capability` only."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import symcheck
from symcheck.engines.capabilities import HasExploredModel, HasImportedStates, HasMatrix
from symcheck.engines.registry import build
from symcheck.engines.symbolic.diagrams import HasDiagrams
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind
from symcheck.syntax.parse import parse_model

SOURCE = Path(symcheck.__file__).parent
ENGINES = {"engines", "symbolic", "kernels", "dd"}
"""Packages that engines are made of."""
WORDS = ("engine", "matrix", "system", "graph")
"""What a name ends with that stands for an engine or a part of one (a graph of networkx is none)."""


def side_doors(text: str) -> Iterator[str]:
    """Calls of getattr, hasattr, isinstance, type and vars on an engine, its systems or matrices."""
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name) or not node.args:
            continue
        if node.func.id in ("getattr", "hasattr", "isinstance", "issubclass", "type", "vars"):
            subject = ast.unparse(node.args[0]).lower()
            if subject.endswith(WORDS) and not ast.unparse(node.args[-1]).startswith("networkx."):
                yield ast.unparse(node)


ROOMS = sorted(
    path.name
    for path in SOURCE.iterdir()
    if path.name not in ENGINES and (path.suffix == ".py" or any(path.glob("*.py")))
)


def test_rooms_are_found() -> None:
    assert {"api", "check", "cli", "distributed", "exchange", "experiments", "peers"} <= {*ROOMS}
    assert all((SOURCE / name).is_dir() for name in ENGINES)


@pytest.mark.parametrize("room", ROOMS)
def test_nobody_asks_what_an_engine_is(room: str) -> None:
    place = SOURCE / room
    files = [place] if place.suffix else sorted(place.rglob("*.py"))
    assert files
    found = {str(f): list(side_doors(f.read_text(encoding="utf-8"))) for f in files}
    assert not {file: calls for file, calls in found.items() if calls}


@pytest.mark.parametrize(
    "text",
    [
        "isinstance(context.engine, ExplicitEngine)",
        "getattr(engine, 'matrix', None)",
        "hasattr(self.system, 'x')",
        "type(sub_engine) is X",
    ],
)
def test_side_doors_are_found(text: str) -> None:
    assert list(side_doors(text))


@pytest.mark.parametrize(
    ("engine", "offers"),
    [
        ("explicit", {HasMatrix, HasExploredModel}),
        ("exact", {HasMatrix, HasExploredModel}),
        ("sparse", {HasDiagrams}),
        ("hybrid", {HasDiagrams}),
        ("mtbdd", {HasDiagrams}),
    ],
)
def test_an_engine_offers_what_its_class_declares(engine: str, offers: set[type]) -> None:
    exact = engine == "exact"
    program = parse_model("dtmc module m x : [0..1]; [] true -> (x'=1-x); endmodule")
    options = Options(exact=True) if exact else Options(engine=engine)
    built = build(bind(program, {}, exact=exact), options)
    every = (HasMatrix, HasExploredModel, HasDiagrams, HasImportedStates)
    assert {kind for kind in every if built.capability(kind) is not None} == offers
