"""Random small models and properties with extreme numbers, as texts in PRISM's language, and their truth.

Nothing here knows symcheck: the numbers of a model are drawn as texts whose fractions are known, and
the oracles compute with these fractions. All states are reachable from state 0, the initial one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import inf, isnan, nextafter
from operator import ge, gt, le, lt
from random import Random

from oracles import chains, continuous, decisions, linear_time
from oracles.chains import Row, Value
from oracles.linear_time import Formula

Interval = tuple[Fraction, Fraction]
Truth = Value | Interval | bool | frozenset[int] | None
"""Of an interval, the value lies in it; of a set, it is the states of argmin; None is undefined."""

ORDINARY = ("0.5", "0.25", "1/3", "0.1", "0.3", "1/7")
TINY = ("1e-200", "1e-300", "1e-16", "1e-9", "1e-17", "1e-12")
REWARDS = ("0", "1", "2", "0.5", "3", "1/3")
FAR_REWARDS = ("1e17", "1e17", "1e-200", "1e10", "1e16", "1e-9")
RATES = ("1", "2", "1/3", "0.5", "3")
FAR_RATES = ("1e-9", "1e-6", "1e6", "1e9", "1e-100", "1e3")
ACTIONS = "uv"
"""Of the choices of each state, in their order."""
STEPS = (0, 1, 2, 3, 7, 40)
TIMES = ("0", "1e-9", "0.5", "3", "1000", "1e12")
COMPARISONS: dict[str, Callable[[Value, Value], bool]] = {"<": lt, "<=": le, ">": gt, ">=": ge}


@dataclass(frozen=True)
class Question:
    """A property and what it is in the initial state.

    `under` is the value under a memoryless strategy, one choice per state, if some are optimal.
    """

    text: str
    truth: Truth
    under: Callable[[Sequence[int]], Value] | None = None


@dataclass(frozen=True)
class Case:
    """A model and questions about it."""

    kind: str
    text: str
    questions: tuple[Question, ...]


@dataclass(frozen=True)
class Asked:
    """A measure without its bound: letter, path or reward, and the value in each state."""

    letter: str
    body: str
    values: Sequence[Value | Interval | None]
    measure: Callable[[chains.Chain, Sequence[Fraction]], Sequence[Value]] | None = None
    """Of the chain of a memoryless strategy with its rewards."""


def fraction(text: str) -> Fraction:
    """The value of a sum of numbers and quotients of integers, such as `1-1e-200-1/3`."""
    first, *others = text.replace("e-", "e~").split("-")
    return Fraction(first.replace("~", "-")) - sum(
        (Fraction(t.replace("~", "-")) for t in others), Fraction(0)
    )


class Model:
    """A random model: its rows, rewards and labels, and its text."""

    def __init__(self, rng: Random, kind: str) -> None:
        """Draw a model in which every state is reachable."""
        self.rng, self.kind = rng, kind
        self.share = rng.choice((0.2, 0.6))
        """Of extreme numbers."""
        while True:
            self.n = rng.randint(2, 8 if kind == "dtmc" else 5)
            self.pairs = rng.random() < 0.4
            self.texts = [
                [self._row() for _ in range(rng.choice((1, 1, 2)) if kind == "mdp" else 1)]
                for _ in range(self.n)
            ]
            self.rows = [[self._summed(row) for row in choices] for choices in self.texts]
            union = [{t: Fraction(1) for row in choices for t in row} for choices in self.rows]
            if len(chains.reachable(union, 0)) == self.n:
                break
        self.chain = [choices[0] for choices in self.rows]
        self.everywhere = range(self.n)
        self.negative = kind != "ctmc" and rng.random() < 0.25
        self.state_rewards = [self._reward() for _ in range(self.n)]
        self.choice_rewards = [[self._reward(0.5) for _ in choices] for choices in self.rows]
        self.costs = [rng.choice((0, 1, 2)) for _ in range(self.n)]
        self.labels = {
            name: set(rng.sample(range(self.n), rng.randint(1, max(1, self.n // 2))))
            for name in "abc"
        }

    def _row(self) -> list[tuple[str, int]]:
        rng, count = self.rng, self.rng.choice((1, 2, 2, 3))
        targets = [rng.randrange(self.n) for _ in range(count)]
        if self.kind == "ctmc":
            numbers = [self._number(RATES, FAR_RATES) for _ in targets]
        else:
            while True:
                numbers = [self._number(ORDINARY, TINY) for _ in targets[1:]]
                numbers.append("-".join(["1", *numbers]))
                if fraction(numbers[-1]) > 0:
                    break
            rng.shuffle(numbers)
        return list(zip(numbers, targets, strict=True))

    def _number(self, ordinary: Sequence[str], extreme: Sequence[str]) -> str:
        return self.rng.choice(extreme if self.rng.random() < self.share else ordinary)

    def _reward(self, zeros: float = 0.2) -> str:
        if self.rng.random() < zeros:
            return "0"
        minus = "-" if self.negative and self.rng.random() < 0.5 else ""
        return minus + self._number(REWARDS, FAR_REWARDS)

    @staticmethod
    def _summed(row: list[tuple[str, int]]) -> Row:
        found: Row = {}
        for number, target in row:
            found[target] = found.get(target, Fraction(0)) + fraction(number)
        return found

    def text(self) -> str:
        """The model in PRISM's language."""
        lines = [self.kind, "module m"]
        if self.pairs:
            lines.append(f"  x : [0..{(self.n - 1) // 2}]; y : [0..1];")
        else:
            lines.append(f"  s : [0..{self.n - 1}];")
        for s, choices in enumerate(self.texts):
            for action, row in zip(ACTIONS, choices, strict=False):
                updates = " + ".join(f"{p} : {self._state(t, after=True)}" for p, t in row)
                lines.append(f"  [{action}] {self._state(s)} -> {updates};")
        lines.append("endmodule")
        for name, states in self.labels.items():
            lines.append(f'label "{name}" = {" | ".join(self._state(s) for s in sorted(states))};')
        lines.append('rewards "r"')
        lines += [f"  {self._state(s)} : {r};" for s, r in enumerate(self.state_rewards)]
        for s, rewards in enumerate(self.choice_rewards):
            for action, r in zip(ACTIONS, rewards, strict=False):
                lines.append(f"  [{action}] {self._state(s)} : {r};")
        lines += ["endrewards", 'rewards "c"']
        lines += [f"  {self._state(s)} : {c};" for s, c in enumerate(self.costs)]
        return "\n".join([*lines, "endrewards", ""])

    def _state(self, s: int, *, after: bool = False) -> str:
        prime = "'" if after else ""
        if self.pairs:
            return f"(x{prime}={s // 2})&(y{prime}={s % 2})"
        return f"(s{prime}={s})"

    def earned(self) -> list[list[Fraction]]:
        """The reward of a step: that of the state and of the choice."""
        return [
            [Fraction(state) + Fraction(r) for r in rewards]
            for state, rewards in zip(self.state_rewards, self.choice_rewards, strict=True)
        ]

    def states(self) -> tuple[str, set[int]]:
        """A text for states, and the states; some, but not all."""
        name, other = self.rng.sample("abc", 2)
        one, two = self.labels[name], self.labels[other]
        found = self.rng.choice(
            (
                (f'"{name}"', one),
                (f'"{name}"', one),
                (f'!"{name}"', set(self.everywhere) - one),
                (f'("{name}"|"{other}")', one | two),
                (f'("{name}"&!"{other}")', one - two),
            )
        )
        return found if found[1] else (f'"{name}"', one)


def draw(seed: str, questions: int = 5) -> Case:
    """A random model with questions."""
    rng = Random(seed)
    model = Model(rng, rng.choice(("dtmc", "dtmc", "ctmc", "mdp")))
    ask = {"dtmc": _of_chain, "ctmc": _of_continuous, "mdp": _of_processes}[model.kind]
    found: list[Question] = []
    while len(found) < questions:
        if model.kind == "dtmc" and rng.random() < 0.05:
            found += _quantile(model)
            continue
        asked = ask(model)
        if asked is None or (_is_trivial(asked.values[0]) and rng.random() < 0.75):
            continue
        question = _question(model, asked)
        if question is not None:
            found.append(question)
    return Case(model.kind, model.text(), tuple(found))


def _of_chain(model: Model) -> Asked | None:
    rng, chain = model.rng, model.chain
    everywhere = set(model.everywhere)
    rewards = [own[0] for own in model.earned()]
    (a, right), (b, left) = model.states(), model.states()
    k, low = rng.choice(STEPS), rng.randint(0, 3)
    factor = rng.choice(("0.5", "0.9", "0", "0.999", "0.999999"))
    match rng.randrange(12):
        case 0:
            return Asked("P", f"F<={k} {a}", chains.bounded_until(chain, everywhere, right, 0, k))
        case 1:
            return Asked("P", f"{b} U<={k} {a}", chains.bounded_until(chain, left, right, 0, k))
        case 2:
            values = chains.bounded_until(chain, left, right, low, low + k)
            return Asked("P", f"{b} U[{low},{low + k}] {a}", values)
        case 3:
            values = chains.bounded_until(chain, everywhere, right, k, k)
            return Asked("P", f"F={k} {a}", values)
        case 4:
            wrong = chains.bounded_until(chain, everywhere, everywhere - right, 0, k)
            return Asked("P", f"G<={k} {a}", [1 - v for v in wrong])
        case 5:
            return Asked("P", f"F>={k} {a}", chains.until_from(chain, everywhere, right, k))
        case 6:
            budget = rng.randint(0, 4)
            values = chains.until_within_cost(chain, model.costs, left, right, budget)
            return Asked("P", f'{b} U{{"c"}}<={budget} {a}', values)
        case 7:
            return Asked('R{"r"}', f"C<={k}", chains.cumulated(chain, rewards, k))
        case 8:
            states = [Fraction(r) for r in model.state_rewards]
            return Asked('R{"r"}', f"I={k}", chains.instantaneous(chain, states, k))
        case 9 if rng.random() < 0.5:
            values = chains.discounted(chain, rewards, Fraction(factor))
            return Asked('R{"r"}', f"C discount={factor}", values)
        case 9:
            values = chains.cumulated(chain, rewards, k, Fraction(factor))
            return Asked('R{"r"}', f"C<={k} discount={factor}", values)
        case 10:
            return Asked("S", a, chains.long_run(chain, [Fraction(s in right) for s in everywhere]))
        case _ if rng.random() < 0.2:
            return Asked('R{"r"}', "S", chains.long_run(chain, rewards))
    return _unbounded(model, chain, rewards, [Fraction(1)] * model.n)


def _quantile(model: Model) -> list[Question]:
    """The least number of steps within which a set is reached with some probability, if below 60."""
    rng = model.rng
    a, right = model.states()
    everywhere = set(model.everywhere)
    at = [
        chains.bounded_until(model.chain, everywhere, right, 0, k)[0]
        for k in range(rng.choice(STEPS) + 1)
    ]
    text, limit = _threshold(rng, "P", at[-1])
    comparison = rng.choice((">", ">="))
    enough = (k for k, v in enumerate(at) if _compared(comparison, v, limit))
    steps = next(enough, None)
    question = f"quantile(min B, P{comparison}{text} [ F<=B {a} ])"
    return [] if steps is None else [Question(question, Fraction(steps))]


def _unbounded(
    model: Model, chain: Sequence[Row], rewards: Sequence[Fraction], times: Sequence[Fraction]
) -> Asked | None:
    """A measure without bounds, of a chain or of the jumps of a CTMC; its steps take `times`."""
    rng, everywhere = model.rng, set(model.everywhere)
    (a, right), (b, left) = model.states(), model.states()
    match rng.randrange(10):
        case 0:
            return Asked("P", f"F {a}", chains.until(chain, everywhere, right))
        case 1:
            wrong = chains.until(chain, everywhere, everywhere - right)
            return Asked("P", f"G {a}", [1 - v for v in wrong])
        case 2:
            return Asked("P", f"{b} U {a}", chains.until(chain, left, right))
        case 3:
            outside = everywhere - left - right
            values = chains.until(chain, everywhere - right, outside)
            return Asked("P", f"{b} W {a}", [1 - v for v in values])
        case 4:
            return Asked("P", f"X {a}", chains.next_step(chain, right))
        case 5 if rng.random() < 0.3:
            return Asked("T", f"F {a}", chains.reach_reward(chain, times, right))
        case 5:
            return Asked('R{"r"}', f"F {a}", chains.reach_reward(chain, rewards, right))
        case 6:
            return None if model.negative else Asked('R{"r"}', "C", chains.total(chain, rewards))
        case 7:
            # a condition on a path formula, not on a state
            path = (rng.choice("XFG"), _formula(rng, rng.randint(0, 1)))
            given = (rng.choice("XFG"), _formula(rng, rng.randint(0, 1)))
            text = f"{linear_time.text(path)} || {linear_time.text(given)}"
            values = linear_time.conditional(chain, model.labels, path, given)
            return Asked("P", text, values)
        case _:
            path = _formula(rng, rng.randint(1, 3))
            values = linear_time.probability(chain, model.labels, path)
            return Asked("P", linear_time.text(path), values)


def _formula(rng: Random, size: int, *, co_safe: bool = False) -> Formula:
    """A formula of linear time with so many operators."""
    if size <= 0:
        name = rng.choice("abc")
        return name if rng.random() < 0.8 else ("!", name)
    operator = rng.choice("XFU&|" if co_safe else "!XFGFGUWR&|")
    if operator in "!XFG":
        return (operator, _formula(rng, size - 1, co_safe=co_safe))
    left = rng.randrange(size)
    sizes = (left, size - 1 - left)
    return (operator, *(_formula(rng, s, co_safe=co_safe) for s in sizes))


def _of_continuous(model: Model) -> Asked | None:
    rng, rates = model.rng, model.chain
    everywhere = set(model.everywhere)
    states = [Fraction(r) for r in model.state_rewards]
    jumps = [Fraction(own[0]) for own in model.choice_rewards]
    (a, right), (b, left) = model.states(), model.states()
    text, other = rng.choice(TIMES), rng.choice(TIMES)
    time = Fraction(text)
    low, high = sorted((text, other), key=Fraction)
    zero = Fraction(0)
    match rng.randrange(12):
        case 0 | 1:
            values = continuous.bounded_until(rates, everywhere, right, zero, time)
            return Asked("P", f"F<={text} {a}", values)
        case 2:
            values = continuous.bounded_until(rates, left, right, zero, time)
            return Asked("P", f"{b} U<={text} {a}", values)
        case 3:
            values = continuous.bounded_until(rates, left, right, Fraction(low), Fraction(high))
            return Asked("P", f"{b} U[{low},{high}] {a}", values)
        case 4:
            values = continuous.bounded_until(rates, everywhere, right, time, time)
            return Asked("P", f"F={text} {a}", values)
        case 5:
            wrong = everywhere - right
            values = continuous.bounded_until(rates, everywhere, wrong, zero, time)
            return Asked("P", f"G<={text} {a}", [(1 - v, 1 - u) for u, v in values])
        case 6:
            values = continuous.until_from(rates, everywhere, right, time)
            return Asked("P", f"F>={text} {a}", values)
        case 7:
            values = continuous.cumulated(rates, states, jumps, time)
            return Asked('R{"r"}', f"C<={text}", values)
        case 8:
            return Asked('R{"r"}', f"I={text}", continuous.instantaneous(rates, states, time))
        case 9:
            share = [Fraction(s in right) for s in everywhere]
            return Asked("S", a, continuous.long_run(rates, share, [zero] * model.n))
        case 10 if rng.random() < 0.3:
            return Asked('R{"r"}', "S", continuous.long_run(rates, states, jumps))
    earned = continuous.occupied(rates, states, jumps)
    times = continuous.occupied(rates, [Fraction(1)] * model.n, [zero] * model.n)
    return _unbounded(model, continuous.embedded(rates), earned, times)


def _of_processes(model: Model) -> Asked | None:
    rng, rows, rewards = model.rng, model.rows, model.earned()
    everywhere = set(model.everywhere)
    (a, right), (b, left) = model.states(), model.states()
    name = rng.choice(("min", "max"))
    best = min if name == "min" else max
    other = max if name == "min" else min
    k, low = rng.choice(STEPS), rng.randint(0, 3)
    p, r, share = f"P{name}", f'R{{"r"}}{name}', [Fraction(s in right) for s in everywhere]
    factor = rng.choice(("0.5", "0.9", "0", "0.999"))

    def unbounded(letter: str, body: str, measure: Callable[..., Sequence[Value]]) -> Asked:
        values = decisions.over_rewards(rows, rewards, best, measure)
        return Asked(letter, body, values, measure)

    match rng.randrange(16):
        case 0:
            return unbounded(p, f"F {a}", lambda c, _: chains.until(c, everywhere, right))
        case 1:
            wrong = decisions.until(rows, other, everywhere, everywhere - right)
            return Asked(p, f"G {a}", [1 - v for v in wrong])
        case 2:
            return unbounded(p, f"{b} U {a}", lambda c, _: chains.until(c, left, right))
        case 3:
            return Asked(p, f"X {a}", decisions.next_step(rows, best, right))
        case 4:
            values = decisions.bounded_until(rows, best, everywhere, right, 0, k)
            return Asked(p, f"F<={k} {a}", values)
        case 5:
            values = decisions.bounded_until(rows, best, left, right, low, low + k)
            return Asked(p, f"{b} U[{low},{low + k}] {a}", values)
        case 6:
            values = decisions.bounded_until(rows, best, everywhere, right, k, k)
            return Asked(p, f"F={k} {a}", values)
        case 7:
            wrong = decisions.bounded_until(rows, other, everywhere, everywhere - right, 0, k)
            return Asked(p, f"G<={k} {a}", [1 - v for v in wrong])
        case 8:
            return Asked(r, f"C<={k}", decisions.cumulated(rows, rewards, best, k))
        case 9:
            states = [Fraction(v) for v in model.state_rewards]
            return Asked(r, f"I={k}", decisions.instantaneous(rows, states, best, k))
        case 10:
            discount = Fraction(factor)
            return unbounded(
                r, f"C discount={factor}", lambda c, own: chains.discounted(c, own, discount)
            )
        case 11:
            if rng.random() < 0.5:
                return unbounded(r, "S", chains.long_run)
            return unbounded(f"S{name}", a, lambda c, _: chains.long_run(c, share))
        case 12 if not model.negative:
            return unbounded(r, f"F {a}", lambda c, own: chains.reach_reward(c, own, right))
        case 13 if not model.negative:
            return unbounded(r, "C", chains.total)
        case 14:
            return Asked(p, f"F {a} || F {b}", decisions.conditional(rows, best, right, left))
    return _of_strategies_with_memory(model, name)


def _of_strategies_with_memory(model: Model, name: str) -> Asked | None:
    rng = model.rng
    path = _formula(rng, rng.randint(1, 2), co_safe=True)
    a, b = rng.sample("abc", 2)
    labels = model.labels | {"not a": set(model.everywhere) - model.labels[a]}
    written = linear_time.text(path)
    text, accepts = rng.choice(
        (
            (written, lambda done, often: done[0]),
            (f"!{written}", lambda done, often: not done[0]),
            (f'(G F "{a}") & (G F "{b}")', lambda done, often: often[0] and often[1]),
            (f'(F G "{a}")', lambda done, often: not often[2]),
            (f'{written} & (G F "{a}")', lambda done, often: done[0] and often[0]),
            (f'{written} | (F G "{a}")', lambda done, often: done[0] or not often[2]),
            (f'(G F "{b}") & (F G "{a}")', lambda done, often: often[1] and not often[2]),
        )
    )
    if name == "max":
        values = linear_time.maximum(
            model.rows, labels, [path] if written in text else [], [a, b, "not a"], accepts
        )
    else:
        values = linear_time.maximum(
            model.rows,
            labels,
            [path] if written in text else [],
            [a, b, "not a"],
            lambda done, often: not accepts(done, often),
        )
        values = values and [1 - v for v in values]
    return None if values is None else Asked(f"P{name}", text, values)


def _question(model: Model, asked: Asked) -> Question | None:
    """A value, a verdict or a filter of a measure."""
    rng, first = model.rng, asked.values[0]
    is_plain = rng.random() < 0.45
    if is_plain or not all(map(_is_known, asked.values)):
        return Question(f"{asked.letter}=? [ {asked.body} ]", first, _under(model, asked))
    if rng.random() < 0.5:
        found = _threshold(rng, asked.letter, first)
        comparison = rng.choice(list(COMPARISONS))
        verdict = _compared(comparison, first, found[1])
        if verdict is None:
            return None
        return Question(f"{asked.letter}{comparison}{found[0]} [ {asked.body} ]", verdict)
    return _filtered(model, asked)


def _under(model: Model, asked: Asked) -> Callable[[Sequence[int]], Value] | None:
    """The initial state's value of a measure under a strategy."""
    measure = asked.measure
    if measure is None:
        return None

    def value(strategy: Sequence[int]) -> Value:
        rewards = [own[c] for own, c in zip(model.earned(), strategy, strict=True)]
        return measure(decisions.induced(model.rows, strategy), rewards)[0]

    return value


def _is_trivial(value: Value | Interval | None) -> bool:
    """Whether graph analysis alone gives the value."""
    return not isinstance(value, tuple) and value in (None, 0, 1, inf)


def _is_known(value: Value | Interval | None) -> bool:
    return value is not None and not (isinstance(value, float) and isnan(value))


def _ends(value: Value | Interval) -> tuple[Value, Value]:
    return value if isinstance(value, tuple) else (value, value)


def _threshold(rng: Random, letter: str, value: Value | Interval) -> tuple[str, Fraction]:
    """A number at the value, beside it, or elsewhere."""
    at = _ends(value)[0]
    texts, greatest = ["0", "1", "1e-9", "0.5"], 1 if letter[0] in "PS" else inf
    if not isinstance(at, float) and abs(at) < 1e300:
        near = float(at)
        beside = (near, near, nextafter(near, inf), nextafter(near, -inf))
        texts += [repr(v) for v in beside if 0 <= v <= greatest] * 2
        if max(abs(at.numerator), at.denominator) < 10**15 and at >= 0:
            texts += [f"{at.numerator}/{at.denominator}"] * 4
    text = rng.choice(texts)
    return text, Fraction(text)


def _compared(comparison: str, value: Value | Interval, limit: Fraction) -> bool | None:
    """The verdict; None if an interval does not decide it."""
    verdicts = {COMPARISONS[comparison](end, limit) for end in _ends(value)}
    return verdicts.pop() if len(verdicts) == 1 else None


def _filtered(model: Model, asked: Asked) -> Question | None:
    rng = model.rng
    text, chosen = model.states()
    states = sorted(chosen)
    number = f"{asked.letter}=? [ {asked.body} ]"
    values = [asked.values[s] for s in states]
    ends = list(zip(*map(_ends, values), strict=True))
    operator = rng.choice(("min", "max", "sum", "avg", "first", "forall", "exists", "count", "arg"))
    truth: Truth
    match operator:
        case "min" | "max" as name:
            best = min if name == "min" else max
            truth = (best(ends[0]), best(ends[1]))
        case "sum" | "avg":
            if inf in (*ends[0], *ends[1]):
                return None
            parts = 1 if operator == "sum" else len(states)
            truth = (Fraction(sum(ends[0])) / parts, Fraction(sum(ends[1])) / parts)
        case "first":
            truth = (ends[0][0], ends[1][0])
        case "arg":
            operator = rng.choice(("argmin", "argmax"))
            best = min if operator == "argmin" else max
            optimum = best(ends[0])
            truth = frozenset(s for s in states if asked.values[s] in (optimum, (optimum, optimum)))
            if any(u != v for u, v in map(_ends, values)):
                return None
        case _:
            limit = _threshold(rng, asked.letter, rng.choice(values))
            comparison = rng.choice(list(COMPARISONS))
            verdicts = [_compared(comparison, v, limit[1]) for v in values]
            if None in verdicts:
                return None
            bound = f"{asked.letter}{comparison}{limit[0]} [ {asked.body} ]"
            counts = {"forall": all(verdicts), "exists": any(verdicts)}
            return Question(
                f"filter({operator}, {bound}, {text})",
                counts.get(operator, Fraction(sum(map(bool, verdicts)))),
            )
    if isinstance(truth, tuple) and truth[0] == truth[1]:
        truth = truth[0]
    return Question(f"filter({operator}, {number}, {text})", truth)
