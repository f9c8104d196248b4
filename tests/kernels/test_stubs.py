"""The stubs that the build writes: they name what is compiled, and import from kernels only."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]
WRITTEN = ROOT / "build" / "stubs"
STUBS = [
    WRITTEN / path.relative_to(ROOT / "src").with_suffix(".pyi")
    for path in sorted((ROOT / "src" / "symcheck" / "kernels").rglob("*.pyx"))
]


def _module(stub: Path) -> ModuleType:
    return import_module(".".join(stub.relative_to(WRITTEN).with_suffix("").parts))


def _functions(body: list[ast.stmt], owner: object) -> Iterator[tuple[ast.FunctionDef, object]]:
    """The functions of a stub that have a signature at run time, with their owners."""
    for node in body:
        if isinstance(node, ast.ClassDef):
            yield from _functions(node.body, getattr(owner, node.name))
        elif (
            isinstance(node, ast.FunctionDef)
            and not node.decorator_list
            and not node.name.startswith("__")
        ):
            yield node, owner


@pytest.mark.parametrize("stub", STUBS, ids=lambda path: path.stem)
def test_stubs_import_from_kernels_only(stub: Path) -> None:
    """import-linter does not read stubs, so their imports are checked here."""
    imported = [
        node.module or ""
        for node in ast.walk(ast.parse(stub.read_text()))
        if isinstance(node, ast.ImportFrom)
    ]
    assert [
        name
        for name in imported
        if name.startswith("symcheck") and not name.startswith("symcheck.kernels.")
    ] == []


@pytest.mark.parametrize("stub", STUBS, ids=lambda path: path.stem)
def test_stubs_have_the_parameters_of_the_compiled_functions(stub: Path) -> None:
    for node, owner in _functions(ast.parse(stub.read_text()).body, _module(stub)):
        compiled = inspect.signature(getattr(owner, node.name))
        assert [a.arg for a in node.args.args] == list(compiled.parameters), node.name


@pytest.mark.parametrize("stub", STUBS, ids=lambda path: path.stem)
def test_every_public_function_has_a_stub_and_a_docstring(stub: Path) -> None:
    tree, module = ast.parse(stub.read_text()), _module(stub)
    named = {n.name for n in tree.body if isinstance(n, ast.FunctionDef | ast.ClassDef)}
    public = {
        name
        for name, value in vars(module).items()
        if not name.startswith("_") and getattr(value, "__module__", "") == module.__name__
    }
    assert set(getattr(module, "__all__", public)) <= named
    for node, owner in _functions(tree.body, module):
        assert getattr(owner, node.name).__doc__, node.name
