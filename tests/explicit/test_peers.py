"""Published numbers of states of the PRISM benchmark suite, up to about a million."""

from __future__ import annotations

import csv
import os

import pytest

from peers_folder import PEERS, or_skipped
from symcheck.explicit.build import explore
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind
from symcheck.syntax.parse import parse_model_file

SUITE = PEERS / "prism-benchmarks"
LIMIT = int(os.environ.get("SYMCHECK_PEERS_STATES", "30000"))


def _instances():
    for table in sorted(SUITE.glob("*/*/models.csv")):
        for row in csv.DictReader(table.read_text().splitlines()):
            path = table.parent / row["model_file"]
            if path.exists() and row["states"].isdigit() and int(row["states"]) <= LIMIT:
                yield pytest.param(
                    path,
                    row["model_consts"],
                    int(row["states"]),
                    id=f"{path.stem}-{row['model_consts']}",
                )


@pytest.mark.parametrize(("path", "constants", "states"), or_skipped(list(_instances()), 3))
def test_published_number_of_states(path, constants, states):
    given = dict(c.split("=") for c in constants.split(",") if c)
    assert len(explore(bind(parse_model_file(path), given), Options()).states) == states
