"""Guesses of what happens infinitely often and what holds for ever, and what a word must do for a guess to be right.

The master theorem (Esparza, Kretinsky & Sickert 2020, theorem 16): a word w satisfies f exactly if there are sets X of
U formulas and Y of R formulas of f with
  (1) for some i, the word from i on satisfies after(f, w[:i]) with all U outside of X false and those in X weak,
  (2) for each g in X: w satisfies G F g, where R in g is true for those in Y and strong otherwise,
  (3) for each g in Y: w satisfies F G g, where U in g is false outside of X and weak in X.
Only formulas that the conditions look at are guessed about, so that there are few guesses in practice.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from symcheck.automata.boolean import FALSE, TRUE
from symcheck.automata.derivatives import After, release_kept, until_kept
from symcheck.automata.formula import Formula, Kind
from symcheck.errors import UnsupportedError

__all__ = ["Again", "Guess", "Main", "Never", "Requirement", "guesses", "requirements"]

_LIMIT = 4096


@dataclass(frozen=True, slots=True)
class Guess:
    """Numbers of the U formulas that hold infinitely often, and of the R formulas that hold from some time on for ever."""

    often: frozenset[int] = frozenset()
    stable: frozenset[int] = frozenset()


@dataclass(frozen=True, slots=True)
class Again:
    """(2): the combination F g (g of co-safety) is satisfied again and again."""

    formula: int


@dataclass(frozen=True, slots=True)
class Never:
    """(3): the combination G g (g of safety), begun anew where it is violated, is violated finitely often."""

    formula: int


@dataclass(frozen=True, slots=True)
class Main:
    """(1): what is left of the whole formula, under the guess, as safety: (state, combination) for each state of a component."""

    formulas: tuple[tuple[int, int], ...]


Requirement = Again | Never | Main


@dataclass(frozen=True, slots=True)
class _Search:
    """What was decided so far, and what is still to be looked at: as safety (U matters) and as co-safety (R matters)."""

    decided: frozenset[tuple[int, bool]] = frozenset()
    seen: frozenset[tuple[int, bool]] = frozenset()
    todo: tuple[tuple[Formula, bool], ...] = ()

    def with_parts(self, parts: Sequence[Formula], *, as_safety: bool) -> _Search:
        return replace(self, todo=self.todo + tuple((p, as_safety) for p in parts))

    @property
    def missed(self) -> frozenset[int]:
        """The formulas that were decided not to hold."""
        return frozenset(n for n, value in self.decided if not value)

    def deciding(self, f: Formula, value: bool) -> _Search:
        return replace(self, decided=self.decided | {(f.number, value)})


def guesses(after: After, states: Sequence[int]) -> Iterator[Guess]:
    """All guesses about the formulas in some states that make a difference."""
    formulas = {f.number: f for s in states for f in after.formulas_in(s)}
    kinds = {g.number: g.kind for f in formulas.values() for g in f.below()}
    todo = [_Search(todo=tuple((f, True) for f in formulas.values()))]
    count = 0
    while todo:
        search = todo.pop()
        if search.todo:
            todo.extend(
                s
                for s in _looked(search)
                if s.decided == search.decided or _possible(after, states, s.missed)
            )
            continue
        count += 1
        if count > _LIMIT:
            raise UnsupportedError(
                "this formula of linear time has too many nested temporal operators; an external translator (-ltl2datool) may do"
            )
        held = [n for n, value in search.decided if value]
        often = frozenset(n for n in held if kinds[n] is Kind.UNTIL)
        yield Guess(often, frozenset(held) - often)


def _possible(after: After, states: Sequence[int], missed: frozenset[int]) -> bool:
    """Whether condition (1) can hold in some of the states, when some formulas do not, and the others are guessed to."""
    known = {g.number for s in states for f in after.formulas_in(s) for g in f.below()}
    return any(_as_safety(after, s, Guess(frozenset(known - missed))) != FALSE for s in states)


def _looked(search: _Search) -> Iterator[_Search]:
    """The searches that follow from looking at the next formula."""
    (f, as_safety), rest = search.todo[-1], search.todo[:-1]
    search = replace(search, todo=rest)
    key = (f.number, as_safety)
    if key in search.seen or (f.safe if as_safety else f.co_safe):
        yield search
        return
    search = replace(search, seen=search.seen | {key})
    guessed = Kind.UNTIL if as_safety else Kind.RELEASE
    if not f.fixpoint or f.kind is not guessed:
        yield search.with_parts(f.parts, as_safety=as_safety)
        return
    # Held: an R is true, and a U weak, so that its parts are looked at as before; and condition (3) or (2), in which only
    # the right part matters, looks at that in the other way. Not held: a U is false, and an R strong.
    held = search.deciding(f, True).with_parts(f.parts[1:], as_safety=not as_safety)
    missed = search.deciding(f, False)
    yield held.with_parts(f.parts, as_safety=True) if as_safety and f.eventually is None else held
    yield (
        missed if as_safety or f.always is not None else missed.with_parts(f.parts, as_safety=False)
    )


def requirements(
    after: After, states: Sequence[int], guess: Guess
) -> frozenset[Requirement] | None:
    """What a word that stays among some states must do for the guess to be right; None where it cannot be."""
    result: set[Requirement] = set()
    formulas = after.formulas
    known = {f.number: f for s in states for g in after.formulas_in(s) for f in g.below()}
    for number in guess.often:
        f = known[number]
        wanted = after.simplified(
            after.of(formulas.eventually(until_kept(formulas, f, guess.stable)[number]))
        )
        if wanted == FALSE:
            return None
        result |= {Again(wanted)} if wanted != TRUE else set()
    for number in guess.stable:
        f = known[number]
        wanted = after.simplified(
            after.of(formulas.always(release_kept(formulas, f, guess.often)[number]))
        )
        if wanted == FALSE:
            return None
        result |= {Never(wanted)} if wanted != TRUE else set()
    main = [(s, _as_safety(after, s, guess)) for s in states]
    if all(f == FALSE for _, f in main):
        return None
    if any(f != TRUE for _, f in main):
        result.add(Main(tuple(main)))
    return frozenset(result)


def _as_safety(after: After, state: int, guess: Guess) -> int:
    kept: dict[int, Formula] = {}
    for f in after.formulas_in(state):
        kept[f.number] = release_kept(after.formulas, f, guess.often)[f.number]
    return after.rewritten(state, kept)
