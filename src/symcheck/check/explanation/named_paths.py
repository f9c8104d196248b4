"""Paths with the valuations of their states and the actions of their steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise

import numpy as np

from symcheck.check.counterexample import LikelyPath
from symcheck.check.explanation.path_search import PathSearch
from symcheck.engines.base import erased
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.states import State
from symcheck.matrices.rows import SparseMatrix
from symcheck.numerics.likeliest_paths import FoundPath
from symcheck.semantics.interpreter import choices

__all__ = ["named_paths"]


def named_paths(search: PathSearch, paths: Sequence[FoundPath]) -> tuple[LikelyPath, ...]:
    """The paths with the valuations of their states and the actions of their steps."""
    engine, strategy = search.engine, search.rows
    of_model = [
        path.states if search.origin is None else tuple(search.origin[list(path.states)].tolist())
        for path in paths
    ]
    numbers = sorted({s for path in of_model for s in path})
    members = ArraySet.of(engine.states, np.array(numbers, np.int64))
    states = {
        n: State(erased(engine), n, values)
        for n, values in zip(numbers, engine.valuations(members), strict=True)
    }
    actions = _Actions(engine, states)
    return tuple(
        LikelyPath(
            tuple(states[s] for s in of_path),
            tuple(
                actions.of(row if strategy is None else int(strategy[s]), a, b)
                for row, s, (a, b) in zip(
                    path.rows, path.states[:-1], pairwise(of_path), strict=True
                )
            ),
            path.probability,
            None if search.reward is None else search.reward(path),
            tuple(
                _step(search.problem.matrix, row, target)
                for row, target in zip(path.rows, path.states[1:], strict=True)
            ),
        )
        for path, of_path in zip(paths, of_model, strict=True)
    )


def _step(matrix: SparseMatrix, row: int, target: int) -> float | Fraction:
    """The probability with which a row leads to a state."""
    part = slice(int(matrix.indptr[row]), int(matrix.indptr[row + 1]))
    place = int(np.flatnonzero(matrix.indices[part] == target)[0])
    found: float | Fraction = matrix.data[part].tolist()[place]
    return found


@dataclass(frozen=True)
class _Actions:
    """The actions of transitions; those of a chain are found by the interpreter."""

    engine: ExplicitEngine
    states: Mapping[int, State]
    known: dict[tuple[int, int], str] = field(default_factory=dict)

    def of(self, row: int, source: int, target: int) -> str:
        """The action of a row, or those of a transition of a chain."""
        model = self.engine.model
        if model.type.has_choices or model.builder is not None:
            action = int(self.engine.explored.choice_actions[row])
            return model.actions[action] if action >= 0 else ""
        if (source, target) not in self.known:
            valuation = self.states[target].valuation
            enabled = choices(model, self.states[source].valuation, check_sums=False)
            names = [c.action or "" for c in enabled if any(s == valuation for _, s in c.branches)]
            self.known[source, target] = ",".join(dict.fromkeys(filter(None, names)))
        return self.known[source, target]
