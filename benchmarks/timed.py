"""Random timed automata against the region oracle: digital clocks and zones.

usage: timed.py [--runs 1000] [--seed 0] [--seconds S] [--method digital|backwards|auto]

A difference is written with its model, and the exit status is 1.
"""

from __future__ import annotations

import argparse
import random
import sys
from fractions import Fraction
from pathlib import Path
from time import monotonic

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import symcheck
from oracles.regions import Atom, Component, Edge, Question, TimeStops, solve
from symcheck.errors import ModelFault, UnsupportedError


class Draw:
    """A random automaton and a question."""

    def __init__(self, seed: int, *, strict: bool, diagonal: bool) -> None:
        self.random = r = random.Random(seed)
        self.strict, self.diagonal = strict, diagonal
        self.largest = r.choice([1, 2]) if diagonal else r.choice([1, 2, 3])
        names = r.choice([[["x"]], [["x", "y"]], [["x"], ["y"]]])
        self.clocks = [c for own in names for c in own]
        self.actions = r.random() < 0.4 and len(names) > 1
        self.components = [self.component(own) for own in names]
        self.question = self.ask()

    def atom(self, *, upper: bool = False) -> Atom:
        r = self.random
        operators = ["<=", ">=", "="] + (["<", ">"] if self.strict else [])
        if upper:
            operators = ["<="] + (["<"] if self.strict else [])
        other = None
        x = r.choice(self.clocks)
        if self.diagonal and len(self.clocks) > 1 and r.random() < 0.4:
            x, other = r.sample(self.clocks, 2)
        operator = r.choice(operators)
        return x, other, operator, r.randint(-2 if other else 1 if upper else 0, self.largest)

    def component(self, own: list[str]) -> Component:
        r = self.random
        places = r.randint(2, 3)
        invariants = [[self.atom(upper=True)] if r.random() < 0.4 else [] for _ in range(places)]
        edges = []
        for source in range(places):
            for _ in range(r.randint(1, 3)):
                guard = [self.atom() for _ in range(r.choice([0, 1, 1, 2]))]
                count = r.choice([1, 1, 2, 2])
                weights = (
                    [Fraction(1)]
                    if count == 1
                    else [Fraction(w, 10) for w in r.choice([(1, 9), (5, 5), (3, 7)])]
                )
                branches = []
                for w in weights:
                    resets = {c: r.choice([0, 0, 0, 1]) for c in own if r.random() < 0.5}
                    branches.append((w, r.randrange(places), resets))
                edges.append(
                    Edge(
                        source, "a" if self.actions and r.random() < 0.4 else None, guard, branches
                    )
                )
        return Component(own, invariants, edges)

    def ask(self) -> Question:
        r = self.random
        sets = [set(range(len(m.invariants))) for m in self.components]
        right = [s if r.random() < 0.4 else {r.choice(sorted(s))} for s in sets]
        left = sets
        if r.random() < 0.3:
            left = [s - {r.choice(sorted(s))} if r.random() < 0.7 else s for s in sets]
        atoms = [self.atom()] if r.random() < 0.3 else []
        window: tuple[int, int | None, bool, bool] = (0, None, False, False)
        if r.random() < 0.5:
            high = r.randint(1, self.largest)
            strict = r.random() < 0.3
            window = (0, high, False, strict)
            if r.random() < 0.3:
                low = r.randint(0, high - 1)
                window = r.choice(
                    [
                        (low, high, False, strict),
                        (low, None, False, False),
                        (low, None, True, False),
                    ]
                )
        return Question(
            r.choice(["min", "max"]), (left, []), (right, atoms), window, r.random() < 0.2
        )

    def text(self) -> str:
        lines = ["pta"]
        for i, m in enumerate(self.components):
            lines += [f"module m{i}", f"  l{i} : [0..{len(m.invariants) - 1}];"]
            lines += [f"  {c} : clock;" for c in m.clocks]
            conditions = [f"(l{i}={k} => {_atoms(a)})" for k, a in enumerate(m.invariants) if a]
            if conditions:
                lines.append(f"  invariant {' & '.join(conditions)} endinvariant")
            for e in m.edges:
                guard = " & ".join([f"l{i}={e.source}", *([_atoms(e.guard)] if e.guard else [])])
                updates = []
                for p, target, resets in e.branches:
                    changes = [f"(l{i}'={target})", *(f"({c}'={x})" for c, x in resets.items())]
                    updates.append(f"{p.numerator}/{p.denominator} : {' & '.join(changes)}")
                lines.append(f"  [{e.action or ''}] {guard} -> {' + '.join(updates)};")
            lines.append("endmodule")
        return "\n".join(lines) + "\n"

    def property(self) -> str:
        q = self.question
        low, high, low_strict, high_strict = q.window
        if high is None and (low or low_strict):
            bound = f">{'' if low_strict else '='}{low}"
        elif high is None:
            bound = ""
        elif low:
            # PRISM's intervals are closed.
            self.question.window = (low, high, False, False)
            bound = f"[{low},{high}]"
        else:
            bound = f"<{'' if high_strict else '='}{high}"
        path = f"{_places(q.left)} U{bound} {_places(q.right)}"
        return f"P{q.direction}=? [ {'!' if q.negative else ''}({path}) ]"


def _atoms(atoms: list[Atom]) -> str:
    return " & ".join(f"{x}{'-' + y if y else ''}{op}{c}" for x, y, op, c in atoms)


def _places(condition: tuple[list[set[int]], list[Atom]]) -> str:
    sets, atoms = condition
    parts = [
        "(" + " | ".join(f"l{i}={k}" for k in sorted(s)) + ")" if s else "false"
        for i, s in enumerate(sets)
    ]
    return "(" + " & ".join([*parts, *([_atoms(atoms)] if atoms else [])]) + ")"


def outcome(draw: Draw, method: str) -> tuple[str, str]:
    """What symcheck says, and what the oracle says: a value, or why there is none."""
    question = draw.property()
    try:
        result = symcheck.loads(draw.text(), timed_method=method).check(question)
        ours = f"{float(result.value):.6f}"
    except ModelFault as fault:
        ours = fault.diagnostics[0].code
    except UnsupportedError as refused:
        ours = f"refused: {refused}"
    try:
        truth = f"{solve(draw.components, draw.question, diagonal=draw.diagonal):.6f}"
    except TimeStops as stops:
        truth = str(stops)
    return ours, truth


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=1e9)
    parser.add_argument("--method", default="auto", choices=["auto", "digital", "backwards"])
    a = parser.parse_args()
    counts: dict[str, int] = {}
    started = monotonic()
    differences = 0
    for seed in range(a.seed, a.seed + a.runs):
        kind = (
            "digital"
            if a.method == "digital"
            else random.Random(seed).choice(["closed", "strict", "diagonal"])
        )
        draw = Draw(seed, strict=kind in ("strict", "diagonal"), diagonal=kind == "diagonal")
        ours, truth = outcome(draw, a.method)
        same = ours == truth
        if not same and not ours.startswith("refused") and ours[0].isdigit() and truth[0].isdigit():
            same = abs(float(ours) - float(truth)) <= 2e-6
        # Digital clocks do not see that time stops in states whose clocks are no whole numbers.
        # They go on to the value, or to a fault of states that they do see.
        seen_less = ours[0].isdigit() or (ours, truth) == ("zeno", "timelock")
        unseen = seen_less and not truth[0].isdigit() and not draw.strict
        same = same or (unseen and a.method != "backwards")
        what = (
            "refused" if ours.startswith("refused") else ours if not ours[0].isdigit() else "value"
        )
        counts[what] = counts.get(what, 0) + 1
        if not same and what != "refused":
            differences += 1
            print(f"--- seed {seed} ({kind}, {a.method}): {ours}, oracle {truth}")
            print(draw.text() + draw.property(), flush=True)
        if monotonic() - started > a.seconds:
            break
    print(f"{seed - a.seed + 1} runs, {differences} differences; {counts}")
    return 1 if differences else 0


if __name__ == "__main__":
    sys.exit(main())
