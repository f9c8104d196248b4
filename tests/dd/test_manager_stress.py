"""Thousands of random operations against truth tables, with sifting, garbage collection and limits in between."""

from __future__ import annotations

import operator
import random

import numpy as np
import pytest

from symcheck.dd.manager import DiagramManager
from symcheck.errors import MemoryLimitError

K = 8
SIZE = 2**K
NAMES = [f"v{i}" for i in range(K)]
ROWS = (np.arange(SIZE)[:, None] >> np.arange(K - 1, -1, -1) & 1).astype(np.uint8)
WEIGHTS = 1 << np.arange(K - 1, -1, -1)
LEAVES = np.array([0, 0, 0, 1, 2, 0.5, -1, 3.25, 1e-13, -7])
COMPARE = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "=": operator.eq,
    "!=": operator.ne,
}


def over(table, axes, reduce):
    """Reduce over some variables and spread the result again."""
    cut = reduce(table.reshape((2,) * K), axis=tuple(axes), keepdims=True)
    return np.broadcast_to(cut, (2,) * K).reshape(-1).copy()


class Stress:
    """Pools of diagrams with their truth tables; each `do_` method is an operation that returns a new pair, or None."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.numpy = np.random.default_rng(seed)
        self.manager = DiagramManager()
        self.manager.add_variables(NAMES)
        self.sets = [(self.manager.true, np.ones(SIZE, bool))]
        self.numbers = [(self.manager.one, np.ones(SIZE))]
        self.operations = [getattr(self, name) for name in dir(self) if name.startswith("do_")]

    def run(self, operations: int) -> None:
        for step in range(operations):
            self.keep(self.random.choice(self.operations)())
            if step % 250 == 0:
                self.manager.core.check()

    def keep(self, pair):
        if pair is None:
            return
        diagram, table = pair
        if table.dtype == bool:
            assert (diagram.evaluate(ROWS) == table).all()
            assert self.manager.bdd_table(NAMES, table) == diagram
            pool = self.sets
        else:
            value = diagram.evaluate(ROWS)
            np.testing.assert_allclose(value, table, rtol=1e-11, atol=1e-9)
            assert self.manager.table(NAMES, value) == diagram
            if np.abs(value).max() > 1e6:
                return
            pair, pool = (diagram, value), self.numbers
        pool.append(pair)
        if len(pool) > 20:
            pool.pop(self.random.randrange(len(pool)))

    def some(self):
        axes = self.random.sample(range(K), self.random.randint(0, 4))
        return axes, self.manager.cube([NAMES[i] for i in axes])

    def a_set(self):
        return self.random.choice(self.sets)

    def a_number(self):
        return self.random.choice(self.numbers)

    def do_new_set(self):
        table = self.numpy.random(SIZE) < self.random.random()
        return self.manager.bdd_table(NAMES, table), table

    def do_new_number(self):
        table = self.numpy.choice(LEAVES[: self.random.randint(2, len(LEAVES))], SIZE)
        return self.manager.table(NAMES, table), table

    def do_boolean(self):
        (f, s), (g, t) = self.a_set(), self.a_set()
        choices = [
            (f & g, s & t),
            (f | g, s | t),
            (f ^ g, s ^ t),
            (f - g, s & ~t),
            (~f, ~s),
        ]
        return self.random.choice(choices)

    do_boolean_too = do_boolean

    def do_through_dd(self):
        (f, s), (g, t) = self.a_set(), self.a_set()
        assert (f <= g) == bool((~s | t).all())
        assert f.disjoint(g) == (not (s & t).any())
        return self.manager.from_dd(f.to_dd() & g.to_dd()), s & t

    def do_quantify(self):
        (f, s), (axes, cube) = self.a_set(), self.some()
        return f.exists(cube), over(s, axes, np.any)

    def do_and_exists(self):
        (f, s), (g, t), (axes, cube) = self.a_set(), self.a_set(), self.some()
        return f.and_exists(g, cube), over(s & t, axes, np.any)

    def do_rename_set(self):
        f, s = self.a_set()
        to = self.random.sample(range(K), K)
        return f.rename(self.manager.renaming({NAMES[i]: NAMES[to[i]] for i in range(K)})), s[
            ROWS[:, to] @ WEIGHTS
        ]

    def do_rename_number(self):
        f, s = self.a_number()
        to = [self.random.randrange(K) for _ in range(K)]
        return f.rename(self.manager.renaming({NAMES[i]: NAMES[to[i]] for i in range(K)})), s[
            ROWS[:, to] @ WEIGHTS
        ]

    def do_arithmetic(self):
        (f, s), (g, t) = self.a_number(), self.a_number()
        choices = [
            (f + g, s + t),
            (f - g, s - t),
            (f * g, s * t),
            (f.minimum(g), np.minimum(s, t)),
            (f.maximum(g), np.maximum(s, t)),
        ]
        return self.random.choice(choices)

    do_arithmetic_too = do_arithmetic

    def do_scale(self):
        f, s = self.a_number()
        k = self.random.choice([0.5, 2.0, -1.0])
        return self.random.choice(
            [(f + k, s + k), (k - f, k - s), (f * k, s * k), (f / k, s / k), (-f, -s)]
        )

    def do_compare(self):
        (f, s), (g, t) = self.a_number(), self.a_number()
        name = self.random.choice(list(COMPARE))
        if self.random.random() < 0.5:
            g, t = 0.5, np.full(SIZE, 0.5)
        return f.compare(name, g), COMPARE[name](s, t)

    def do_mask(self):
        (f, s), (g, t) = self.a_number(), self.a_set()
        return f.times_bdd(g), np.where(t, s, 0)

    def do_choose(self):
        (f, s), (g, t), (h, u) = self.a_number(), self.a_set(), self.a_number()
        return g.ite(f, h), np.where(t, s, u)

    def do_choose_set(self):
        (f, s), (g, t), (h, u) = self.a_set(), self.a_set(), self.a_set()
        return g.ite(f, h), np.where(t, s, u)

    def do_abstract(self):
        (f, s), (axes, cube) = self.a_number(), self.some()
        return f.sum_over(cube), over(s, axes, np.sum)

    def do_multiply_sum(self):
        (f, s), (g, t), (axes, cube) = self.a_number(), self.a_number(), self.some()
        return f.multiply_sum(g, cube), over(s * t, axes, np.sum)

    def do_bridge(self):
        (f, s), (g, t) = self.a_number(), self.a_set()
        return self.random.choice([(f.to_bdd(), s != 0), (g.to_mtbdd(2.5), t * 2.5)])

    def do_arrays(self):
        (f, s), (g, _) = self.a_number(), self.a_set()
        assert self.manager.import_bdd(self.manager.export_bdd(g, ~g)) == [g, ~g]
        return self.manager.import_mtbdd(self.manager.export_mtbdd([self.manager.one, f]))[1], s

    def do_rows(self):
        f, s = self.a_set()
        order = self.random.sample(range(K), K)
        rows = ROWS[:, order][s]
        rows = rows[np.lexsort(rows.T[::-1])]
        names = [NAMES[i] for i in order]
        assert self.manager.count(f, names) == len(rows)
        assert self.manager.bdd_from_rows(names, rows) == f
        ordered = [n for n in self.manager.order() if n in NAMES]
        first, members = (
            self.manager.pick(f, ordered),
            ROWS[:, [NAMES.index(n) for n in ordered]][s],
        )
        assert (first is None) if not len(members) else tuple(first) == min(map(tuple, members))
        values = self.numpy.choice(LEAVES[3:], len(rows))
        table = np.zeros((2,) * K)
        table[tuple(rows.T.astype(int))] = values
        return self.manager.mtbdd_from_rows(names, rows, values), table.transpose(
            np.argsort(order)
        ).reshape(-1)

    def do_step(self):
        """States over the even variables, relations over some pairs: the fused steps against the composed ones."""
        m, (f, _), (g, _) = self.manager, self.a_set(), self.a_set()
        rows, columns = NAMES[0::2], NAMES[1::2]
        touched = self.random.sample(range(K // 2), self.random.randint(1, K // 2))
        states = f.exists(m.cube(columns))
        relation = g.exists(m.cube([columns[i] for i in range(K // 2) if i not in touched]))
        pairs = {rows[i]: columns[i] for i in touched}
        step = m.transition(list(pairs), list(pairs.values()))
        back = m.renaming({b: a for a, b in pairs.items()})
        assert step.image(states, relation) == states.and_exists(relation, step.rows).rename(back)
        assert step.preimage(states, relation) == states.rename(m.renaming(pairs)).and_exists(
            relation, step.columns
        )

    def do_many(self):
        union = self.manager.disjunction([f for f, _ in self.sets])
        assert union == self.manager.bdd_table(NAMES, np.any([s for _, s in self.sets], axis=0))
        total = self.manager.sum([f for f, _ in self.numbers])
        np.testing.assert_allclose(
            total.evaluate(ROWS), np.sum([s for _, s in self.numbers], axis=0), atol=1e-6
        )

    def do_disturb(self):
        order = self.random.sample(NAMES, K)
        self.random.choice(
            [
                self.manager.collect,
                self.manager.sift,
                lambda: self.manager.reorder(NAMES),
                lambda: self.manager.reorder(order),
                lambda: self.manager.bdd.reorder({name: level for level, name in enumerate(order)}),
                lambda: self.manager.sift(
                    [self.manager.order()[i : i + 2] for i in range(0, K, 2)]
                ),
            ]
        )()


@pytest.mark.parametrize("seed", [1, 2])
def test_three_thousand_operations(seed):
    stress = Stress(seed)
    stress.run(3000)
    manager = stress.manager
    manager.core.check()
    assert manager.statistics().collections > 20
    stress.sets.clear()
    stress.numbers.clear()
    manager.true = manager.false = manager.zero = manager.one = None
    manager.collect()
    # dd counts what is still referenced, besides variables and constants: nothing leaked, nothing was given back twice.
    assert len(manager.bdd) == 0


def heavy(manager, names, random, kind):
    """One operation that needs much memory."""
    size = len(names) // 2
    left = manager.table(names[0::2], np.arange(2**size) % 7)
    right = manager.table(names[size:], random.permutation(2**size) % 5)
    if kind == "times":
        return left * right + random.integers(7)
    if kind == "compare":
        return left.compare("<", right)
    if kind == "sum":
        return (left + random.integers(7)).multiply_sum(right, manager.cube(names[-3:]))
    if kind == "choose":
        return left.compare(">", 3).ite(right, left)
    if kind == "mask":
        return left.times_bdd(right.compare("=", random.integers(5)))
    if kind == "rename":
        return right.rename(manager.renaming(dict(zip(names, reversed(names), strict=True))))
    if kind == "rows":
        return manager.bdd_from_rows(
            names, np.unique(random.integers(0, 2, (20_000, len(names)), np.uint8), axis=0)
        )
    states = manager.bdd_table(names[0::2], random.random(2**size) < 0.5)
    relation = manager.bdd_table(names[20:], random.random(2**8) < 0.2)
    return manager.transition(names[20::2], names[21::2]).image(states, relation)


@pytest.mark.parametrize(
    "kind", ["times", "compare", "sum", "choose", "mask", "rename", "rows", "image"]
)
def test_a_memory_limit_in_the_middle_leaves_everything_usable(kind):
    random = np.random.default_rng(3)
    manager = DiagramManager(max_memory=8 * 2**20)
    names = [f"x{i}" for i in range(28)]
    manager.add_variables(names)
    base = manager.table(names[:6], np.arange(64))
    hit = 0
    for _ in range(3):
        kept = []
        with pytest.raises(MemoryLimitError, match="8 MiB"):
            kept.extend(heavy(manager, names, random, kind) for _ in range(300))
        hit += 1
        kept.clear()
        assert (base + base).leaves.tolist() == list(range(0, 128, 2))
        assert base.compare("<", 32) == ~manager.variable("x0")
    assert hit == 3
    base = manager.true = manager.false = manager.zero = manager.one = None
    manager.collect()
    assert len(manager.bdd) == 0
