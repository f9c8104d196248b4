"""The probability of LTL formulas, without automata.

On chains: the refinement of C. Courcoubetis and M. Yannakakis, The complexity of probabilistic
verification (JACM 1995). An innermost temporal formula is replaced by a proposition of a finer
chain, in which each state says whether the formula holds on the rest of the path.

On MDPs: for Boolean combinations of co-safe formulas and of `G F` of propositions. A co-safe
formula is unfolded along the path until it is true (F. Bacchus and F. Kabanza, 1998); the end
components of the product that satisfy the formula are found among all sets of states
(L. de Alfaro, 1997).

A formula is a label, or a tuple of an operator and its formulas: ("U", "a", ("X", "b")).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
from itertools import combinations

from oracles import chains, decisions
from oracles.chains import Chain, Column, Row, States
from oracles.decisions import Processes

Formula = str | bool | tuple["str | Formula", ...]
Labels = Mapping[str, States]


def text(formula: Formula) -> str:
    """The formula in PRISM's language."""
    if isinstance(formula, str):
        return f'"{formula}"'
    if isinstance(formula, bool):
        return str(formula).lower()
    operator, *operands = formula
    if len(operands) == 1:
        return f"({operator} {text(operands[0])})"
    return f"({text(operands[0])} {operator} {text(operands[1])})"


def core(formula: Formula) -> Formula:
    """The formula with the operators !, &, X and U only."""
    if not isinstance(formula, tuple):
        return formula
    operator, *operands = formula
    a, b = core(operands[0]), core(operands[-1])
    match operator:
        case "!" | "X":
            return (operator, a)
        case "&" | "U":
            return (operator, a, b)
        case "|":
            return ("!", ("&", ("!", a), ("!", b)))
        case "F":
            return ("U", True, a)
        case "G":
            return ("!", ("U", True, ("!", a)))
        case "W":  # there is no first violation of a before b
            return ("!", ("U", ("!", b), ("&", ("!", a), ("!", b))))
        case "R":
            return ("!", ("U", ("!", a), ("!", b)))
    raise ValueError(operator)


def holds(formula: Formula, state: int, labels: Labels) -> bool:
    """Whether a formula without temporal operators holds in a state."""
    if isinstance(formula, bool):
        return formula
    if isinstance(formula, str):
        return state in labels[formula]
    operator, *operands = formula
    values = [holds(f, state, labels) for f in operands]
    return not values[0] if operator == "!" else all(values)


def _innermost(formula: Formula) -> Formula | None:
    """A temporal formula whose operands have no temporal operator."""
    if not isinstance(formula, tuple):
        return None
    operator, *operands = formula
    inner = next(filter(None, map(_innermost, operands)), None)
    return formula if inner is None and operator in ("X", "U") else inner


def _replaced(formula: Formula, old: Formula, new: str) -> Formula:
    if formula == old:
        return new
    if not isinstance(formula, tuple):
        return formula
    return (formula[0], *(_replaced(f, old, new) for f in formula[1:]))


def probability(chain: Chain, labels: Labels, formula: Formula) -> Column:
    """The probability of an LTL formula in each state of a chain."""
    rows, names = list(chain), {name: set(states) for name, states in labels.items()}
    origin, weight = list(range(len(rows))), [Fraction(1)] * len(rows)
    formula = core(formula)
    while (inner := _innermost(formula)) is not None:
        assert isinstance(inner, tuple)
        operands = [{s for s in range(len(rows)) if holds(f, s, names)} for f in inner[1:]]
        left, right = operands[0], operands[-1]
        if inner[0] == "X":
            probabilities = chains.next_step(rows, right)
        else:
            probabilities = chains.until(rows, left, right)
        finer = {
            (s, truth): p if truth else 1 - p
            for s, p in enumerate(probabilities)
            for truth in (True, False)
            if (p if truth else 1 - p)
        }
        index = {pair: i for i, pair in enumerate(finer)}
        old_rows, rows = rows, []
        for (s, truth), share in finer.items():
            row: Row = {}
            for t, p in old_rows[s].items():
                for after in (True, False):
                    if (t, after) not in finer:
                        continue
                    if inner[0] == "X":
                        possible = truth == (t in right)
                    else:  # an undecided until is decided by the next state
                        possible = s in right or s not in left or truth == after
                    if possible:
                        row[index[t, after]] = p * finer[t, after] / share
            rows.append(row)
        name = f"#{len(names)}"
        formula = _replaced(formula, inner, name)
        names = {n: {index[p] for p in finer if p[0] in states} for n, states in names.items()}
        names[name] = {index[pair] for pair in finer if pair[1]}
        weight = [weight[s] * share for (s, _), share in finer.items()]
        origin = [origin[s] for s, _ in finer]
    found = [Fraction(0)] * len(chain)
    for i, s in enumerate(origin):
        if holds(formula, i, names):
            found[s] += weight[i]
    return found


def conditional(
    chain: Chain, labels: Labels, path: Formula, given: Formula
) -> list[Fraction | None]:
    """The probability of a formula given another one; None where that has probability 0."""
    both = probability(chain, labels, ("&", path, given))
    condition = probability(chain, labels, given)
    return [b / c if c else None for b, c in zip(both, condition, strict=True)]


def unfolded(formula: Formula, state: int, labels: Labels) -> Formula:
    """What the rest of the path has to satisfy after a state, for a co-safe formula."""
    if isinstance(formula, bool):
        return formula
    if isinstance(formula, str):
        return state in labels[formula]
    operator, *operands = formula
    match operator:
        case "!":  # of a label
            return state not in labels[operands[0]]
        case "X":
            return operands[0]
        case "F":
            return _joined("|", unfolded(operands[0], state, labels), formula)
        case "U":
            stay = _joined("&", unfolded(operands[0], state, labels), formula)
            return _joined("|", unfolded(operands[1], state, labels), stay)
    return _joined(operator, *(unfolded(f, state, labels) for f in operands))


def _joined(operator: str, *formulas: Formula) -> Formula:
    """A conjunction or disjunction without repetitions, in a fixed order."""
    flat: list[Formula] = []
    for formula in formulas:
        same = isinstance(formula, tuple) and formula[0] == operator
        flat.extend(formula[1:] if same else [formula])
    neutral = operator == "&"
    if (not neutral) in flat:
        return not neutral
    kept = sorted({f for f in flat if f is not neutral}, key=repr)
    if not kept:
        return neutral
    return kept[0] if len(kept) == 1 else (operator, *kept)


def maximum(
    processes: Processes,
    labels: Labels,
    prefixes: list[Formula],
    recurring: list[str],
    accepts: Callable[[list[bool], list[bool]], bool],
    *,
    most_states: int = 10,
) -> Column | None:
    """The greatest probability of a Boolean combination of path formulas in each state of an MDP.

    Args:
        processes: the MDP.
        labels: the states of each label.
        prefixes: co-safe formulas: labels, their negations, &, |, X, F and U.
        recurring: labels p of which `G F p` is asked.
        accepts: the combination, of the truth of both.
        most_states: of the product.

    Returns:
        One value per state, or None if the product is larger.
    """

    def step(s: int, rest: tuple[Formula, ...]) -> tuple[int, tuple[Formula, ...]]:
        return s, tuple(unfolded(f, s, labels) for f in rest)

    starts = [step(s, tuple(prefixes)) for s in range(len(processes))]
    index = {pair: i for i, pair in enumerate(dict.fromkeys(starts))}
    product: list[list[Row]] = []
    for s, rest in (queue := list(index)):
        choices = []
        for row in processes[s]:
            choice: Row = {}
            for t, p in row.items():
                pair = step(t, rest)
                if pair not in index:
                    index[pair] = len(index)
                    queue.append(pair)
                choice[index[pair]] = p
            choices.append(choice)
        product.append(choices)
        if len(index) > most_states:
            return None
    accepting: set[int] = set()
    pairs = list(index)
    for size in range(1, len(pairs) + 1):
        for group in combinations(range(len(pairs)), size):
            if not _is_end_component(product, set(group)):
                continue
            finished = [f is True for f in pairs[group[0]][1]]
            often = [any(pairs[i][0] in labels[p] for i in group) for p in recurring]
            if accepts(finished, often):
                accepting |= set(group)
    values = decisions.until(product, max, range(len(product)), accepting)
    return [values[index[start]] for start in starts]


def _is_end_component(product: Processes, group: set[int]) -> bool:
    """Whether some strategy stays in these states and visits each of them again and again."""
    inside = [
        {t: Fraction(1) for row in choices if set(row) <= group for t in row} for choices in product
    ]
    return all(inside[s] and chains.reachable(inside, s) == group for s in group)
