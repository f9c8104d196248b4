"""What arrays lack is told as an error of symcheck, with advice, by whatever a library calls."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import symcheck
from symcheck.errors import MemoryLimitError

DIE = Path(__file__).parents[2] / "models" / "die" / "die.pm"


def _bound() -> symcheck.BoundModel:
    return symcheck.bind(symcheck.parse_model_file(DIE))


@pytest.mark.parametrize(
    ("within", "call"),
    [
        ("symcheck.check.checker._boolean", lambda: symcheck.load(DIE).check("P>0 [ F d=6 ]")),
        ("symcheck.check.state_distributions._steps", lambda: symcheck.load(DIE).transient(2)),
        (
            "symcheck.check.state_distributions._prepared",
            lambda: symcheck.load(DIE).steady_state(),
        ),
        ("symcheck.explicit.build.initial_rows", lambda: symcheck.load(DIE).engine),
        (
            "symcheck.explicit.build.initial_rows",
            lambda: symcheck.explore(_bound(), symcheck.Options()),
        ),
        (
            "symcheck.symbolic.events.encode_events.encode",
            lambda: symcheck.build(_bound(), symcheck.Options()),
        ),
        (
            "symcheck.symbolic.reachability.search.search",
            lambda: symcheck.reach(symcheck.build(_bound(), symcheck.Options())),
        ),
        (
            "symcheck.exchange.api_io.explicit_export",
            lambda: symcheck.export(symcheck.load(DIE), "die.drn"),
        ),
        ("symcheck.exchange.api_io.read_files", lambda: symcheck.load_explicit("die.all")),
        (
            "symcheck.simulate.steps.CommandSuccessors.start",
            lambda: symcheck.load(DIE).simulate(3),
        ),
        ("symcheck.simulate.samples.Sampler", lambda: symcheck.load(DIE).estimate("P=? [ F d=6 ]")),
    ],
)
def test_memory_that_arrays_lack(
    within: str, call: Callable[[], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    def lacking(*_: Any, **__: Any) -> object:
        raise MemoryError

    monkeypatch.setattr(within, lacking)
    with pytest.raises(MemoryLimitError, match="not enough memory\n  hint: "):
        call()
