"""Kernels know arrays only: their stubs, which import-linter does not read, look no further up."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

KERNELS = Path(__file__).parents[2] / "src" / "symcheck" / "kernels"


@pytest.mark.parametrize("stub", sorted(KERNELS.glob("*.pyi")), ids=lambda path: path.stem)
def test_stubs_import_from_kernels_only(stub: Path) -> None:
    found = [
        node.module or ""
        for node in ast.walk(ast.parse(stub.read_text()))
        if isinstance(node, ast.ImportFrom)
    ]
    assert [
        name
        for name in found
        if name.startswith("symcheck") and not name.startswith("symcheck.kernels.")
    ] == []
