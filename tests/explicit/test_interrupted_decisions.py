"""Ctrl-C and limits of time end a search also while a condition is decided in exact arithmetic."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import symcheck
from checking import engine_of
from symcheck.errors import Interrupted, MemoryLimitError, TimeLimitError
from symcheck.explicit import decider
from symcheck.explicit.compile import compile_expression
from symcheck.explicit.states import StateLayout
from symcheck.explicit.successors import SuccessorGenerator
from symcheck.syntax.parse import parse_expression

TEXT = """dtmc
module m
  x : [0..9] init 0;
  [] x<9 & x*0.1+0.2!=0.3 -> (x'=x+1);
  [] x*0.1+0.2=0.3 | x=9 -> (x'=min(x+1,9));
endmodule
"""
CONDITION = "x*0.1+0.2=0.3"


@pytest.fixture(params=[KeyboardInterrupt, TimeLimitError, MemoryError])
def stop(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> type[BaseException]:
    """What ends a decision."""
    error: type[BaseException] = request.param

    def interrupted(*_: object) -> object:
        raise error

    monkeypatch.setattr(decider, "evaluate", interrupted)
    return error


def _search() -> object:
    return engine_of(TEXT, "explicit")


def _values() -> object:
    model = symcheck.loads(TEXT).bound
    layout = StateLayout.of(model.variables)
    rows = layout.pack([[0, 1, 1, 1, 2]])
    return compile_expression(parse_expression(CONDITION), model).run_packed(layout, rows)


def _successors() -> object:
    model = symcheck.loads(TEXT).bound
    layout = StateLayout.of(model.variables)
    return SuccessorGenerator(model, layout, None).choices(layout.pack([[0, 1, 1, 1, 2]]))


@pytest.mark.parametrize("compute", [_search, _values, _successors])
def test_it_ends_with_what_stopped_it(
    compute: Callable[[], object], stop: type[BaseException]
) -> None:
    with pytest.raises((stop, Interrupted, MemoryLimitError)):
        compute()
