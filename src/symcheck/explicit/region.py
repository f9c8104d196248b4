"""A part of the states of a model, which grows where paths leave it."""

from __future__ import annotations

import math

import numpy as np

from symcheck.explicit import tuning
from symcheck.explicit.build import Exploration
from symcheck.explicit.faults import raise_model_fault
from symcheck.explicit.initial import initial_rows
from symcheck.explicit.model import ExplicitModel
from symcheck.explicit.states import Rows, StateLayout
from symcheck.explicit.tables import compile_model
from symcheck.explicit.unbounded import Growth, ReachedValues, growth
from symcheck.kernels.explore.breadth_first import Explorer, Outcome, StateSet
from symcheck.options import Options
from symcheck.semantics.model import BoundModel

__all__ = ["Region", "early_growth"]


def early_growth(model: BoundModel, options: Options, rounds: int = 1) -> Growth | None:
    """Which variables without bounds still take new values after very many states; None: none.

    Args:
        model: the model, with one initial state.
        options: checks of the model. A fault of the model ends the search.
        rounds: how many times as far as usual to search.
    """
    layout = StateLayout.of(model.variables)
    reached = ReachedValues(layout)
    explorer = Explorer(compile_model(model, layout, check_sums=options.check_sums))
    explorer.add(initial_rows(model, layout))
    earlier: dict[int, tuple[int, int]] = {}
    for share in (1 - tuning.GROWING_SHARE, 1.0):
        if explorer.run(int(share * rounds * tuning.GROWING_STATES), math.inf) != Outcome.BUDGET:
            return None
        earlier = dict(reached.values)
        reached.note(explorer.states.view_rows())
    return growth(model, {i: v for i, v in reached.values.items() if v != earlier[i]})


class Region:
    """The states that are expanded: at first, those near the initial ones.

    Args:
        model: a DTMC, CTMC or MDP; it may have infinitely many states.
        options: limits of memory, and checks.

    Examples:
        >>> import symcheck
        >>> walk = symcheck.loads("dtmc module m x : int init 0; [] true -> (x'=x+1); endmodule")
        >>> region = Region(walk.bound, symcheck.Options())
        >>> explored = region.explored()
        >>> explored.states.row(int(explored.boundary[0])) == (len(region),)
        True
    """

    def __init__(self, model: BoundModel, options: Options) -> None:
        self._model, self._options = model, options
        self._layout = StateLayout.of(model.variables)
        self._tables = compile_model(model, self._layout, check_sums=options.check_sums)
        self._states = StateSet(self._layout.words)
        self._expand(Explorer(self._tables), initial_rows(model, self._layout))

    def __len__(self) -> int:
        return len(self._states)

    def explored(self) -> ExplicitModel:
        """The states of the region and its boundary: the states that it leads to, with a loop each.

        Raises:
            ModelFault: the model breaks a rule in a state of the region.
            ResourceError: a limit is reached.
        """
        exploration = Exploration(self._model, self._options, region=self._states)
        exploration.run()
        return exploration.finish()

    def grow(self, states: Rows) -> None:
        """Expand some states of the boundary (uint64[n, words]), and states that follow them.

        Raises:
            ModelFault: the model breaks a rule in one of them.
        """
        self._expand(Explorer(self._tables, region=(self._states, False)), states)

    def _expand(self, explorer: Explorer, first: Rows) -> None:
        explorer.add(first)
        more = max(tuning.FIRST_REGION_STATES, int(tuning.REGION_GROWTH * len(self._states)))
        outcome = explorer.run(len(explorer.states) + more, math.inf)
        rows = explorer.states.view_rows()
        if outcome == Outcome.FAULT:
            state = self._layout.unpack(rows[explorer.fault_state])
            checks = self._options.check_sums
            raise_model_fault(self._model, state, explorer.fault_status, check_sums=checks)
        if outcome in (Outcome.NO_MEMORY, Outcome.TOO_MANY):
            raise MemoryError
        expanded = np.ascontiguousarray(rows[: explorer.explored])
        self._states.add(expanded, np.empty(len(expanded), np.int32))
