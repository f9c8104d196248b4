"""Linear time on Markov chains without automata: temporal operators taken away one by one, splitting the states.

Source: Courcoubetis & Yannakakis, 'The complexity of probabilistic verification', J. ACM 42 (1995), section 3.
"""

from __future__ import annotations

import numpy as np


class Chain:
    """A Markov chain whose states are split as to whether formulas hold. `first`: distribution of the initial state."""

    def __init__(self, matrix, first, atoms):
        self.matrix, self.first, self.truths = (
            np.asarray(matrix, float),
            np.asarray(first, float),
            list(map(np.array, atoms)),
        )

    def probability(self, tree) -> float:
        number = self._truth(tree)  # changes all the rest
        return float(self.first @ self.truths[number])

    def _truth(self, tree) -> int:
        """Which of `truths` says where the formula holds; makes it."""
        match tree:
            case ("p", i):
                return i
            case ("!", t):
                i = self._truth(t)
                return self._add(~self.truths[i])
            case ("&" | "|" as operator, t, u):
                i, j = self._truth(t), self._truth(u)
                a, b = self.truths[i], self.truths[j]
                return self._add(a & b if operator == "&" else a | b)
            case ("X", t):
                return self._next(self._truth(t))
            case ("F", t):
                return self._truth(("U", ("|", t, ("!", t)), t))
            case ("G", t):
                return self._truth(("!", ("F", ("!", t))))
            case ("R", t, u):
                return self._truth(("!", ("U", ("!", t), ("!", u))))
            case ("W", t, u):
                return self._truth(("|", ("U", t, u), ("G", t)))
            case ("U", t, u):
                i, j = self._truth(t), self._truth(u)
                return self._until(self.truths[i], self.truths[j])
        raise AssertionError(tree)

    def _add(self, truth) -> int:
        self.truths.append(truth)
        return len(self.truths) - 1

    def _next(self, i: int) -> int:
        target = self.truths[i]
        q = self.matrix @ target
        return self._split(q, np.where(target, self.matrix, 0), np.where(target, 0, self.matrix))

    def _until(self, left, right) -> int:
        edges = self.matrix > 0
        reach = right.copy()
        for _ in range(len(reach)):
            reach |= left & (edges @ reach)
        lost = ~reach
        for _ in range(len(reach)):
            lost |= left & ~right & (edges @ lost)
        q = np.where(lost, 0.0, 1.0)
        maybe = np.flatnonzero(lost & reach)
        inner = self.matrix[np.ix_(maybe, maybe)]
        q[maybe] = np.linalg.solve(np.eye(len(maybe)) - inner, self.matrix[maybe] @ ~lost)
        # Where it holds (or not) already now, what comes after is free; else it must (or must not) hold afterwards.
        decided = right | ~left
        yes = self.matrix * np.where(decided[:, None], 1.0, q[None, :])
        no = self.matrix * np.where(decided[:, None], 1.0, 1 - q[None, :])
        return self._split(q, yes, no, after=(decided, decided), weights=q)

    def _split(self, q, yes, no, after=None, weights=None) -> int:
        """Each state s as (s, holds) and (s, does not); yes, no: edges from them, where q of the next state is counted
        (`weights`) or not."""
        n = len(q)
        matrix = np.zeros((2 * n, 2 * n))
        with np.errstate(divide="ignore", invalid="ignore"):
            for k, rows in enumerate((yes, no)):
                rows = rows / rows.sum(axis=1, keepdims=True)
                if weights is None:
                    blocks = rows * q, rows * (1 - q)
                else:
                    decided = after[k][:, None]
                    blocks = (
                        np.where(decided, rows * q, rows if k == 0 else 0.0),
                        np.where(decided, rows * (1 - q), 0.0 if k == 0 else rows),
                    )
                matrix[k * n : (k + 1) * n, :n], matrix[k * n : (k + 1) * n, n:] = blocks
        first = np.concatenate((self.first * q, self.first * (1 - q)))
        alive = np.concatenate((q > 0, q < 1))
        self.matrix, self.first = matrix[np.ix_(alive, alive)], first[alive]
        self.truths = [np.concatenate((t, t))[alive] for t in self.truths]
        return self._add(np.concatenate((np.ones(n, bool), np.zeros(n, bool)))[alive])


def spelled(tree, *, plain: bool = False) -> str:
    """A tree as a path formula over the labels "a", "b", …; `plain` does without R and W."""
    match tree:
        case ("p", i):
            return f'"{"abc"[i]}"'
        case ("W", t, u) if plain:
            return spelled(("|", ("U", t, u), ("G", t)), plain=True)
        case ("R", t, u) if plain:
            return spelled(("!", ("U", ("!", t), ("!", u))), plain=True)
        case (operator, t):
            return f"({operator} {spelled(t, plain=plain)})"
        case (operator, t, u):
            return f"({spelled(t, plain=plain)} {operator} {spelled(u, plain=plain)})"
    raise AssertionError(tree)
