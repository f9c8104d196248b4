"""Numbers of states that are published with the PRISM benchmark suite (skipped where the suite is
missing).
"""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from peers_folder import PEERS, needs_peers
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind
from symcheck.symbolic.build import construct
from symcheck.syntax.parse import parse_model_file

SUITE = PEERS / "prism-benchmarks"

INSTANCES = [
    ("dtmcs/crowds/crowds.pm", "TotalRuns=5,CrowdSize=20"),
    ("dtmcs/egl/egl.pm", "N=20,L=8"),
    ("dtmcs/bluetooth/bluetooth.pm", "mrec=1"),
    ("dtmcs/herman/herman15.pm", ""),
    ("dtmcs/leader_sync/leader_sync5_4.pm", ""),
    ("dtmcs/nand/nand.pm", "N=60,K=2"),
    ("ctmcs/kanban/kanban.sm", "t=7"),
    ("ctmcs/fms/fms.sm", "n=8"),
    ("ctmcs/cluster/cluster.sm", "N=512"),
    ("ctmcs/tandem/tandem.sm", "c=255"),
    ("ctmcs/polling/poll20.sm", ""),
    ("mdps/wlan/wlan6.nm", "COL=0"),
    ("mdps/csma/csma3_2.nm", ""),
    ("mdps/consensus/coin4.nm", "K=4"),
]


@needs_peers
@pytest.mark.parametrize(("path", "constants"), INSTANCES)
def test_published_numbers_of_states(path, constants):
    with (SUITE / path).parent.joinpath("models.csv").open() as file:
        rows = [
            r
            for r in csv.DictReader(file)
            if r["model_file"] == Path(path).name and r["model_consts"] == constants
        ]
    given = dict(c.split("=") for c in constants.split(",")) if constants else {}
    made = construct(bind(parse_model_file(SUITE / path), given), Options(time_limit=60))
    assert made.space.count == int(rows[0]["states"])
    assert made.space.symbolic.manager.shared_size(made.roots) < 1_000_000
