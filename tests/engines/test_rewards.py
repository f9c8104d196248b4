"""Every engine gives the rewards that count steps and time, as a reward structure would that is
written for it.
"""

from __future__ import annotations

import numpy as np
import pytest

import symcheck
from symcheck.semantics.rewards import Steps, Structure, Time

MODEL = """
{kind}
module m
  x : [0..3];
  [a] x<3 -> 2*{half}:(x'=x+1) + 2*{half}:(x'=0);
  [b] x=1 -> 1:(x'=3);
  [] x=3 -> 1:true;
endmodule
rewards "steps" [] true : 1; [a] true : 1; [b] true : 1; endrewards
rewards "time" true : 1; endrewards
"""


def rewards(engine, reward, *, exact: bool):
    states, rows = (engine if exact else engine.system(engine.all)).rewards(reward)
    return np.asarray(states, float), np.asarray(rows, float)


@pytest.mark.parametrize("kind", ["dtmc", "ctmc", "mdp"])
@pytest.mark.parametrize("engine", ["explicit", "mtbdd", "hybrid", "sparse", "exact"])
def test_steps_and_time_are_rewards(engine, kind, tmp_path):
    file = tmp_path / "counted.prism"
    file.write_text(MODEL.format(kind=kind, half="1.5" if kind == "ctmc" else "0.25"))
    exact = engine == "exact"
    built = symcheck.load(file, engine=engine).engine
    pairs = [(Steps(), Structure(0)), (Time(), Structure(1 if kind == "ctmc" else 0))]
    for reward, structure in pairs:
        for found, expected in zip(
            rewards(built, reward, exact=exact), rewards(built, structure, exact=exact), strict=True
        ):
            np.testing.assert_allclose(found, expected, rtol=1e-15)
