"""UMB files, read back by the package that defines them."""

from __future__ import annotations

from random import Random

import numpy as np
import pytest

import symcheck
from exchange.models import some_model
from symcheck.exchange.snapshot import snapshot

umbi = pytest.importorskip("umbi")


@pytest.mark.parametrize("kind", ["dtmc", "ctmc", "mdp"])
def test_the_model_is_in_the_file(kind, tmp_path):
    model = symcheck.loads(some_model(Random(4), kind).text)
    symcheck.export(model, str(tmp_path / "m.umb"))
    assert [p.name for p in tmp_path.iterdir()] == ["m.umb"]
    import umbi.ats
    import umbi.umb

    read = umbi.ats.read(tmp_path / "m.umb")
    # The reader above keeps one annotation of each category only (umbi 0.2.5).
    raw = umbi.umb.read(tmp_path / "m.umb")
    shot = snapshot(model.engine, ["a", "b"], lambda n: model.engine.where(model.bound.labels[n]))
    assert read.num_states == shot.n
    assert read.num_choices == shot.matrix.rows
    assert read.initial_states == np.flatnonzero(shot.labels["init"]).tolist()
    branches = [(b.target, float(b.prob)) for c in read.choices for b in c.branches]
    values = shot.values / shot.row_sums[shot.row_of_entry] if kind == "ctmc" else shot.values
    assert [t for t, _ in branches] == shot.matrix.indices.tolist()
    assert [p for _, p in branches] == pytest.approx(values.tolist())
    if kind == "ctmc":
        assert [float(r) for r in read.state_to_exit_rate] == pytest.approx(shot.row_sums.tolist())
    assert {n: v["states"] for n, v in raw.annotations["aps"].items()} == {n: m.tolist() for n, m in shot.labels.items() if n != "init"}
    assert raw.annotations["rewards"]["r"]["states"] == shot.rewards[0].states.tolist()
    assert raw.annotations["rewards"]["r"]["choices"] == pytest.approx(shot.transition_rewards(shot.rewards[0]).tolist())
    names = [v.name for v in shot.variables]
    assert raw.valuations["states"] == [dict(zip(names, row, strict=True)) for row in np.array(shot.columns).T.tolist()]
