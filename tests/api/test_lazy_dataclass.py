"""Lazy dataclasses behave as those of the standard library, and compile nothing before they are used."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
from dataclasses import FrozenInstanceError, field, fields, is_dataclass, replace
from typing import Any, ClassVar, Generic, TypeVar

import pytest

from symcheck.lazy_dataclass import dataclass

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Node:
    span: int = field(default=0, compare=False, repr=False, kw_only=True)
    letter: ClassVar[str] = "N"


class Between(Node):
    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Sum(Between):
    left: int
    right: int = 2
    letter: ClassVar[str] = "S"


@dataclass(frozen=True)
class Plain(Generic[T]):
    name: str
    items: list[T] = field(default_factory=list)
    seen: dict[str, T] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        self.seen["first"] = self.items[0] if self.items else None  # type: ignore[assignment]


@dataclass
class Open:
    x: int = 3


@dataclass(eq=False)
class Same:
    x: int


@dataclasses.dataclass(frozen=True)
class Eager(Plain[int]):
    more: int = 1


@dataclass(frozen=True, kw_only=True)
class Keywords(Eager):
    last: int


@dataclass(frozen=True)
class Spelled:
    x: int

    def __repr__(self) -> str:
        return "spelled"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Spelled)


def test_values_are_made_compared_and_shown() -> None:
    assert repr(Sum(1)) == "Sum(left=1, right=2)"
    assert Sum(1, span=5) == Sum(1, 2) != Sum(1, 3)
    assert hash(Sum(1, span=5)) == hash(Sum(1))
    assert Sum(1, span=5).span == 5
    assert (Sum.letter, Node.letter) == ("S", "N")
    assert Plain("a", [7]).seen == {"first": 7}
    assert Plain("a").items is not Plain("a").items
    assert repr(Eager("a")) == "Eager(name='a', items=[], seen={'first': None}, more=1)"
    assert Keywords("a", [1], 2, last=3).last == 3
    assert (repr(Spelled(1)), Spelled(1) == Spelled(2)) == ("spelled", True)
    assert Open() == Open(3)
    assert Open.x == 3
    assert Same(1) != Same(1)
    assert {Same(1), Same(1)}


def test_faults_are_refused() -> None:
    with pytest.raises(TypeError, match="unhashable"):
        hash(Open())
    for value in (Sum(1), Plain("a")):
        with pytest.raises(FrozenInstanceError):
            value.left = 3
        with pytest.raises(FrozenInstanceError):
            del value.left
    with pytest.raises(TypeError, match=r"Sum.__init__.* missing 1 required positional argument"):
        Sum()
    with pytest.raises(TypeError, match="positional"):
        Keywords("a", [1], 2, 3)
    value = Open()
    value.x = 5
    assert value.x == 5


def test_the_standard_library_sees_the_fields() -> None:
    assert [f.name for f in fields(Sum)] == ["span", "left", "right"]
    assert is_dataclass(Node)
    assert replace(Sum(1), left=4, span=2) == Sum(4)
    assert dataclasses.asdict(Sum(1)) == {"span": 0, "left": 1, "right": 2}
    match Sum(1):
        case Sum(left, right):
            assert (left, right) == (1, 2)
    assert not hasattr(Sum(1), "__dict__")


def test_values_are_pickled_and_copied() -> None:
    for value in (Sum(1, span=3), Open(4), Spelled(2)):
        for again in (pickle.loads(pickle.dumps(value)), copy.copy(value), copy.deepcopy(value)):
            assert again == value
    assert copy.copy(Sum(1, span=3)).span == 3


def test_a_class_whose_first_value_was_pickled_is_complete() -> None:
    @dataclass(frozen=True)
    class Late:
        x: int

    values = [object.__new__(Late) for _ in range(2)]
    for value in values:
        value.__dict__["x"] = 1
    assert values[0] == values[1]
    assert repr(values[0]).endswith("Late(x=1)")
    assert {*values} == {values[0]}
    assert Late.__match_args__ == ("x",)


def test_the_signature_is_that_of_the_standard_library_before_a_value_is_made() -> None:
    def signatures(dataclass: Any) -> list[str]:
        @dataclass(frozen=True)
        class Base:
            x: int
            items: list[int] = field(default_factory=list)
            hidden: int = field(default=0, init=False)

        @dataclass
        class Unfrozen:
            y: str = "a"
            last: bool = field(default=True, kw_only=True)

        @dataclass(frozen=True)
        class Derived(Base):
            more: int = 1

        class Other(Base):
            def __init__(self, of: str) -> None: ...

        return [str(inspect.signature(kind)) for kind in (Derived, Other, Base, Unfrozen)]

    lazy = signatures(dataclass)
    assert lazy[2] == "(x: 'int', items: 'list[int]' = <factory>) -> None"
    assert lazy == signatures(dataclasses.dataclass)


def test_nothing_is_compiled_before_a_class_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    used: list[str] = []
    monkeypatch.setattr(dataclasses, "_process_class", lambda cls, *_: used.append(cls.__name__))

    @dataclass(frozen=True, slots=True)
    class Unused:
        x: int

    assert not used
    with pytest.raises(AttributeError):
        Unused(1)
    assert used == ["Unused"]
