"""How much memory there is: the machine's, or a container's share of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from symcheck.machine import memory


@pytest.mark.parametrize(
    ("text", "bounded"),
    [("1000000\n", True), ("max\n", False), ("", False), (f"{2**63 - 4096}\n", False)],
)
def test_a_limit_counts_where_it_is_one(text: str, bounded: bool, tmp_path: Path) -> None:
    limit = tmp_path / "limit"
    limit.write_text(text)
    machine = memory([])
    assert machine > 1_000_000
    assert memory([str(tmp_path / "missing"), str(limit)]) == (1_000_000 if bounded else machine)
