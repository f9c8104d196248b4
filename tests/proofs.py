"""Small models whose values are known, and certificates of them as the checker reads them.

Nothing here knows symcheck.
"""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

from symcheck_verify import check, read_model

__all__ = ["CHOICE", "CLOCK", "GAME", "certificate", "proved", "until", "vector", "written"]

# From 0, a step to 1 (won), 2 (lost) or 0 again; the reward of a step from 0 is 3.
GAME = {"tra": "3 5\n0 0 1/2\n0 1 1/3\n0 2 1/6\n1 1 1\n2 2 1\n", "srew": "3 1\n0 3\n"}
# From 0, choice 0 stays, choice 1 goes to 1 or 2 with 1/2; staying for ever never wins.
CHOICE = {"tra": "3 4 5\n0 0 0 1\n0 1 1 1/2\n0 1 2 1/2\n1 0 1 1\n2 0 2 1\n", "srew": "3 1\n0 1\n"}
# A fair change between 0 and 1, at rates 2 and 6.
CLOCK = {"tra": "2 2\n0 1 2\n1 0 6\n", "srew": "2 1\n0 8\n"}


def written(folder: Path, files: dict[str, str]) -> Path:
    labels = "".join(f'{i}="{name}" ' for i, name in enumerate(("init", "won")))
    (folder / "m.lab").write_text(f"{labels}\n0: 0\n1: 1\n")
    (folder / "m.tra").write_text(files["tra"])
    (folder / "m.srew").write_text('# Reward structure "r"\n# State rewards\n' + files["srew"])
    return folder / "m.tra"


def certificate(
    path: Path, kind: str, statement: dict[str, Any], evidence: dict[str, Any]
) -> dict[str, Any]:
    digests = read_model(path, kind, "rational").digests
    about = {"type": kind, "numbers": "rational", "sha256": digests}
    return {"model": about, "property": "", "statement": statement, "evidence": evidence}


def vector(*values: str | None) -> dict[str, Any]:
    numbers = [None if v is None else int(Fraction(v) * 60) for v in values]
    return {"denominator": "60", "numerators": numbers}


def proved(path: Path, kind: str, given: dict[str, Any]) -> list[str]:
    return check(read_model(path, kind, "rational"), json.loads(json.dumps(given)))


def until(optimum: str | None, low: str, high: str, **more: Any) -> dict[str, Any]:
    sets = {"left": "all", "right": {"label": "won"}}
    bounds = {"bounds": {"0": [low, high]}}
    return {"measure": "until", **sets, "optimum": optimum, "negated": False, **bounds, **more}
