"""The quick `dataclass` does what that of the standard library does: every test runs with both, the standard one as the oracle."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
from collections.abc import Callable
from dataclasses import FrozenInstanceError, field, fields, replace
from functools import cached_property
from typing import Any

import pytest

from symcheck import records


@pytest.fixture(params=[dataclasses.dataclass, records.dataclass], ids=["standard", "symcheck"])
def dataclass(request: pytest.FixtureRequest) -> Callable[..., Any]:
    return request.param


@records.dataclass(frozen=True, slots=True)
class Point:
    """At module level, so that it can be pickled."""

    x: int
    y: int = field(default=7, compare=False)


def made(dataclass, **switches):
    @dataclass(**switches)
    class Base:
        name: str
        size: int = 3
        parts: list[int] = field(default_factory=list, repr=False)
        where: str = field(default="-", compare=False, kw_only=True)

    return Base


FORMS = [{}, {"frozen": True}, {"frozen": True, "slots": True}, {"slots": True}, {"frozen": True, "kw_only": True}]


@pytest.mark.parametrize("switches", FORMS, ids=str)
def test_values_are_given_by_place_by_name_or_by_default(dataclass, switches):
    cls = made(dataclass, **switches)
    one = cls(name="a", parts=[1], where="here")
    assert (one.name, one.size, one.parts, one.where) == ("a", 3, [1], "here")
    assert cls(name="a").parts is not cls(name="b").parts
    with pytest.raises(TypeError):
        cls()
    with pytest.raises(TypeError):
        cls("a", 4, [], "here")
    if not switches.get("kw_only"):
        assert cls("a", 5).size == 5


@pytest.mark.parametrize("switches", FORMS, ids=str)
def test_signature_names_the_fields(switches):
    ours, standard = (inspect.signature(made(d, **switches)) for d in (records.dataclass, dataclasses.dataclass))
    assert [(p.name, p.kind, p.annotation) for p in ours.parameters.values()] == [
        (p.name, p.kind, p.annotation) for p in standard.parameters.values()
    ]


@pytest.mark.parametrize("switches", FORMS, ids=str)
def test_equality_compares_the_fields_that_say_so(dataclass, switches):
    cls = made(dataclass, **switches)
    assert cls(name="a", where="here") == cls(name="a", where="there")
    assert cls(name="a") != cls(name="b")
    assert cls(name="a") != made(dataclass, **switches)(name="a")
    assert cls(name="a") != "a"


def test_frozen_values_hash_as_they_compare(dataclass):
    @dataclass(frozen=True)
    class Two:
        a: int
        b: int = field(default=0, compare=False)

    @dataclass(frozen=True)
    class Nothing:
        pass

    assert hash(Two(1, 2)) == hash(Two(1, 3))
    assert {Two(1): "found"}[Two(1)] == "found"
    assert Nothing() == Nothing()
    assert hash(Nothing()) == hash(Nothing())


def test_values_that_change_have_no_hash_and_identity_keeps_its_own(dataclass):
    with pytest.raises(TypeError):
        hash(made(dataclass)("a"))
    one, other = (made(dataclass, frozen=True, eq=False)("a") for _ in range(2))
    assert one != other
    assert hash(one) == object.__hash__(one)


def test_a_method_that_the_class_writes_is_kept(dataclass):
    @dataclass(frozen=True)
    class Own:
        a: int

        def __repr__(self):
            return "own"

        def __eq__(self, other):
            return True

        def __hash__(self):
            return 5

    assert (repr(Own(1)), Own(1) == 3, hash(Own(1))) == ("own", True, 5)


@pytest.mark.parametrize("slots", [False, True])
def test_frozen_values_cannot_be_changed(dataclass, slots):
    one = made(dataclass, frozen=True, slots=slots)("a")
    with pytest.raises(FrozenInstanceError, match="cannot assign to field 'name'"):
        one.name = "b"
    with pytest.raises(FrozenInstanceError, match="cannot delete field 'name'"):
        del one.name
    assert one.name == "a"


def test_slots_leave_no_room_for_other_names(dataclass):
    assert not hasattr(made(dataclass, slots=True)("a"), "__dict__")


@pytest.mark.parametrize("switches", FORMS, ids=str)
def test_replace_and_fields_of_the_standard_library_take_them(dataclass, switches):
    cls = made(dataclass, **switches)
    assert replace(cls(name="a", where="here"), size=9) == cls(name="a", size=9)
    assert replace(cls(name="a", where="here"), size=9).where == "here"
    assert [f.name for f in fields(cls)] == ["name", "size", "parts", "where"]


def test_representation_shows_the_fields_that_say_so(dataclass):
    assert repr(made(dataclass)("a")) == "made.<locals>.Base(name='a', size=3, where='-')"


def test_a_class_that_inherits_has_the_fields_of_both(dataclass):
    @dataclass(frozen=True, slots=True)
    class Node:
        span: int = field(default=0, compare=False, repr=False, kw_only=True)

    @dataclass(frozen=True, slots=True)
    class Leaf(Node):
        value: int

    match Leaf(4, span=2):
        case Leaf(value):
            assert value == 4
    assert Leaf(4, span=2) == Leaf(4)
    assert Leaf(4) != Node()
    assert Node(span=3).span == 3


def test_what_follows_initialisation_is_called(dataclass):
    @dataclass
    class Sum:
        a: int
        b: int = field(init=False)
        c: int = field(default=6, init=False)

        def __post_init__(self):
            self.b = self.a + 1

    assert (Sum(1).b, Sum(1).c) == (2, 6)


def test_what_is_computed_once_may_be_kept_in_a_frozen_value(dataclass):
    @dataclass(frozen=True)
    class Lazy:
        a: int

        @cached_property
        def double(self):
            return [self.a] * 2

    one = Lazy(2)
    assert one.double is one.double


def test_copies_are_equal():
    for again in (copy.copy(Point(1)), copy.deepcopy(Point(1, 2)), pickle.loads(pickle.dumps(Point(1, 2)))):
        assert again == Point(1)
        assert type(again) is Point
