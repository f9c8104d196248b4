"""Functions of parameters against the exact engine, on random models at random points.

    python benchmarks/parameters.py --runs 1000 --seed 1

Each run draws a chain or an MDP with the parameters p and q in its probabilities (rates) and
rewards, and a property. The outcome of the parametric model is evaluated at random rational points
of its ranges, and has to be equal to what the exact engine answers for these constants. A
difference is printed with the model.
"""

from __future__ import annotations

import argparse
from fractions import Fraction
from random import Random

import symcheck
from symcheck.errors import SymcheckError, UnsupportedError
from symcheck.matrices.rational_functions import RationalFunction

SPLITS = (
    ("p", "1-p"),
    ("q", "1-q"),
    ("p*q", "1-p*q"),
    ("p*q", "p*(1-q)", "1-p"),
    ("p/2", "1/2", "(1-p)/2"),
    ("q^2", "2*q*(1-q)", "(1-q)^2"),
    ("p/(p+q)", "q/(p+q)"),
    ("x/4*p", "1-x*p/4"),
    ("0.3", "0.7"),
    ("1",),
)
RATES = ("p", "q", "2", "p+q", "p*q", "1+x*p", "1/(1+q)")
REWARDS = ("1", "p", "2*q", "x", "p*x+q", "0")
MODELS = ("dtmc", "ctmc", "mdp")


def random_model(rng: Random, kind: str) -> str:
    """The text of a model with the parameters p and q."""
    size = rng.randint(1, 4)
    other = rng.random() < 0.4
    lines = [kind, "const double p; const double q;", "module a", f"x : [0..{size}];"]
    for value in range(size + 1):
        for _ in range(rng.choice((0, 1, 1, 2)) if kind != "dtmc" else rng.choice((1, 1, 1, 2, 0))):
            action = rng.choice(("a", "", "")) if other else rng.choice(("", "b"))
            weights = [rng.choice(RATES)] if kind == "ctmc" else rng.choice(SPLITS)
            updates = " + ".join(f"{w} : (x'={rng.randint(0, size)})" for w in weights)
            lines.append(f"[{action}] x={value} -> {updates};")
    lines.append("endmodule")
    if other:
        lines += ["module b", "y : [0..1];"]
        for value in (0, 1):
            weights = [rng.choice(("1", "q"))] if kind == "ctmc" else rng.choice(SPLITS[:4])
            updates = " + ".join(f"{w} : (y'={rng.randint(0, 1)})" for w in weights)
            lines.append(f"[a] y={value} -> {updates};")
        lines.append("endmodule")
    lines += ["rewards", f"x<{rng.randint(0, size + 1)} : {rng.choice(REWARDS)};"]
    lines += [f"[{rng.choice(('a', '')) if other else ''}] true : {rng.choice(REWARDS)};"]
    return "\n".join([*lines, "endrewards"])


def random_property(rng: Random, kind: str, size: int = 4) -> str:
    """A property of the kinds that are supported."""
    goal, other = f"x={rng.randint(0, size)}", f"x!={rng.randint(0, size)}"
    direction = rng.choice(("min", "max")) if kind == "mdp" else ""
    paths = [f"F {goal}", f"{other} U {goal}", f"X {goal}", f"G {other}"]
    if kind != "ctmc":
        paths += [f"F<={rng.randint(0, 5)} {goal}", f"G<=2 {other}", f"G F {goal}"]
    rewards = [f"F {goal}"]
    if kind != "ctmc":
        rewards += [f"C<={rng.randint(0, 4)}", "I=2"]
    if kind != "mdp":
        rewards += ["S", "C"]
    if rng.random() < 0.5:
        query = rng.choice(("=?", "=?", ">=0.4", "<0.7", ">p/2"))
        return f"P{direction if query == '=?' else ''}{query} [ {rng.choice(paths)} ]"
    if kind != "mdp" and rng.random() < 0.3:
        return f"S=? [ {goal} ]"
    query = rng.choice(("=?", "=?", ">=1"))
    return f"R{direction if query == '=?' else ''}{query} [ {rng.choice(rewards)} ]"


def difference(rng: Random, text: str, formula: str) -> tuple[str | None, str]:
    """What differs at some point (None: nothing), and whether anything was compared."""
    lifting = "=?" not in formula and rng.random() < 0.5
    model = symcheck.loads(text).parametric("p=0.01:0.99,q=0.01:0.99")
    try:
        result = model.with_options(lifting=lifting, regions=0.9).check(formula)
    except UnsupportedError as error:
        return None, f"refused: {str(error)[:60]}"
    except SymcheckError as error:
        return None, f"error: {str(error)[:60]}"
    except Exception as error:
        return repr(error), "crash"
    regions = result.regions
    for _ in range(4):
        box = rng.choice([b for c in regions.cases for b in c.boxes] or [regions.box])
        point = {
            n: low + (high - low) * Fraction(rng.randint(1, 96), 97)
            for n, (low, high) in box.items()
        }
        constants = {n: str(v) for n, v in point.items()}
        exact = symcheck.loads(text, constants, exact=True).check(formula).value
        inside = [c for c in regions.cases if box in c.boxes]
        case = inside[0] if inside else regions.at(**point)
        value = case(**point)
        if value != exact:
            return f"{value} at {constants}, exactly {exact}: {case.value}", "compared"
    if lifting:
        return None, "lifted"
    return None, "compared" if isinstance(result.value, RationalFunction) else "cases"


def main() -> int:
    """Run the comparison; gives the number of differences."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    outcomes: dict[str, int] = {}
    found = 0
    for number in range(arguments.runs):
        rng = Random(f"{arguments.seed} {number}")
        kind = rng.choice(MODELS)
        text = random_model(rng, kind)
        formula = random_property(rng, kind)
        wrong, what = difference(rng, text, formula)
        outcomes[what] = outcomes.get(what, 0) + 1
        if wrong is not None:
            found += 1
            print(f"run {number}: {formula}: {wrong}\n{text}\n")
    for what, times in sorted(outcomes.items(), key=lambda pair: -pair[1]):
        print(f"{times:6} {what}")
    print(f"{found} differences in {arguments.runs} runs")
    return found


if __name__ == "__main__":
    raise SystemExit(bool(main()))
