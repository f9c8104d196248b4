"""Composition: which commands happen together, as the operators' definitions say."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from symcheck.semantics.binding.composition import events
from symcheck.semantics.model import BoundCommand, BoundModule, Event
from symcheck.syntax.ast import Literal, Type
from symcheck.syntax.declarations import (
    Composition,
    Hiding,
    Interleaving,
    ModuleReference,
    Parallel,
    Renaming,
    Synchronised,
)
from symcheck.syntax.parse import parse_model

TRUE = Literal(True, Type.BOOL)


def module(number: int, actions: str) -> BoundModule:
    """A module M1, M2 … with a command per letter; `.` is an unlabelled one. Commands are told apart by their guards."""
    commands = (
        BoundCommand(number, None if a == "." else a, Literal(10 * number + i, Type.INT), ())
        for i, a in enumerate(actions)
    )
    return BoundModule(f"M{number}", (), tuple(commands))


def shown(found: tuple[Event, ...]) -> list[str]:
    """`a:11,12*21`: action a, commands 1 or 2 of M1 together with command 1 of M2."""
    return [
        f"{e.action or ''}:"
        + "*".join(",".join(str(c.guard.value) for c in p) for p in e.participants)
        for e in found
    ]


def compose(system: str, *modules: str) -> list[str]:
    text = (
        "mdp "
        + " ".join(f"module M{i} endmodule" for i in range(1, len(modules) + 1))
        + f" system {system} endsystem"
    )
    return shown(events([module(i, a) for i, a in enumerate(modules, 1)], parse_model(text).system))


@pytest.mark.parametrize(
    ("system", "modules", "expected"),
    [
        ("M1 || M2", ("a.", "a"), [":11", "a:10*20"]),
        ("M1 || M2", ("aa", "aab"), ["a:10,11*20,21", "b:22"]),
        ("M1 || M2 || M3", ("a", "b", "ab"), ["a:10*30", "b:20*31"]),
        ("M1 ||| M2", ("a", "a"), ["a:10", "a:20"]),
        ("M1 ||| M2 ||| M3", ("a", "a", "."), [":30", "a:10", "a:20"]),
        ("M1 |[a]| M2", ("ab", "ab"), ["a:10*20", "b:11", "b:21"]),
        # What is synchronised but missing on one side cannot happen.
        ("M1 |[a]| M2", ("a", "b"), ["b:20"]),
        # The third module has a in its alphabet, but the composition does not list it: it moves by itself.
        ("(M1 || M2) |[b]| M3", ("ab", "a", "ab"), ["a:10*20", "a:30", "b:11*31"]),
        ("(M1 ||| M2) || M3", ("a", "a", "a"), ["a:10*30", "a:20*30"]),
        ("M1 / {a}", ("ab",), [":10", "b:11"]),
        # A hidden action no longer synchronises.
        ("M1 / {a} || M2", ("a", "a"), [":10", "a:20"]),
        ("(M1 || M2) / {a}", ("a", "ab"), [":10*20", "b:21"]),
        ("M1 {a<-b}", ("a.",), [":11", "b:10"]),
        # Renaming makes two actions one, and happens at once.
        ("M1 {a<-b} || M2", ("ab", "b"), ["b:10*20", "b:11*20"]),
        ("M1 {a<-b,b<-a} || M2", ("ab", "b"), ["a:11", "b:10*20"]),
    ],
)
def test_operators(system: str, modules: tuple[str, ...], expected: list[str]) -> None:
    assert sorted(compose(system, *modules)) == sorted(expected)


def test_default_is_full_parallel_composition() -> None:
    modules = [module(1, ".ab"), module(2, "ba."), module(3, "c")]
    assert shown(events(modules)) == [":10", ":22", "a:11*21", "b:12*20", "c:30"]


def test_many_commands_are_not_multiplied_out() -> None:
    found = events([module(i, "a" * 50) for i in range(1, 11)])
    assert [len(p) for e in found for p in e.participants] == [50] * 10


alphabets = st.text("ab.", max_size=4)
systems = st.recursive(
    st.just(()),
    lambda inner: st.one_of(
        st.tuples(st.just("||"), inner, inner),
        st.tuples(st.just("|||"), inner, inner),
        st.tuples(st.just("|[]|"), inner, inner, st.frozensets(st.sampled_from("ab"))),
        st.tuples(st.just("/"), inner, st.frozensets(st.sampled_from("ab"))),
        st.tuples(
            st.just("{}"), inner, st.dictionaries(st.sampled_from("ab"), st.sampled_from("abc"))
        ),
    ),
    max_leaves=4,
)


def build(
    tree: tuple, alphabet: list[str], modules: list[BoundModule]
) -> tuple[Composition, dict, set[str]]:
    """The composition of a tree with a fresh module at each leaf; and, straight from the definitions of the operators,
    the sets of commands that happen together, with how often, and the alphabet."""
    if not tree:
        number = len(modules) + 1
        modules.append(module(number, alphabet[len(modules) % len(alphabet)]))
        own = modules[-1]
        steps: dict = {}
        for c in own.commands:
            steps.setdefault(c.action, []).append(frozenset([c.guard.value]))
        return ModuleReference(own.name), steps, {c.action for c in own.commands} - {None}
    operator, *rest = tree
    left, a, a_alphabet = build(rest[0], alphabet, modules)
    if operator == "/":
        return (
            Hiding(left, tuple(rest[1])),
            relabel(a, dict.fromkeys(rest[1])),
            a_alphabet - rest[1],
        )
    if operator == "{}":
        return (
            Renaming(left, tuple(rest[1].items())),
            relabel(a, rest[1]),
            {rest[1].get(x, x) for x in a_alphabet},
        )
    right, b, b_alphabet = build(rest[1], alphabet, modules)
    shared = {"||": a_alphabet & b_alphabet, "|||": set(), "|[]|": rest[-1]}[operator]
    steps = {}
    for action in {*a, *b}:
        if action in shared:
            steps[action] = [x | y for x in a.get(action, []) for y in b.get(action, [])]
        else:
            steps[action] = a.get(action, []) + b.get(action, [])
    node = {
        "||": Parallel((left, right)),
        "|||": Interleaving((left, right)),
        "|[]|": Synchronised(left, right, tuple(rest[-1])),
    }
    return node[operator], steps, a_alphabet | b_alphabet


def relabel(steps: dict, new: dict) -> dict:
    result: dict = {}
    for action, sets in steps.items():
        result.setdefault(new.get(action, action), []).extend(sets)
    return result


@given(systems, st.lists(alphabets, min_size=1, max_size=4))
def test_flattening_keeps_the_steps(tree: tuple, alphabet: list[str]) -> None:
    modules: list[BoundModule] = []
    system, expected, _ = build(tree, alphabet, modules)
    found: dict = {}
    for event in events(modules, system):
        combined = [frozenset()]
        for commands in event.participants:
            combined = [x | {c.guard.value} for x in combined for c in commands]
        found.setdefault(event.action, []).extend(combined)
    expected = {a: s for a, s in expected.items() if s}
    assert {a: sorted(map(sorted, s)) for a, s in found.items()} == {
        a: sorted(map(sorted, s)) for a, s in expected.items()
    }
