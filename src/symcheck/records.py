"""`dataclass` as in the standard library, but quick to make: the start of a small run makes more than a hundred of them.

The standard decorator writes six methods of a frozen class as text and compiles them, in half a millisecond. They say nothing of
the class but the names of its fields, so here all classes share them. Only `__init__` is compiled, because instances are made in
great numbers, and that not before the first one is.
"""

from __future__ import annotations

import dataclasses
from dataclasses import MISSING, FrozenInstanceError, field, fields
from operator import attrgetter
from typing import TYPE_CHECKING, Any

__all__ = ["dataclass", "field"]

if TYPE_CHECKING:
    from dataclasses import dataclass
else:

    def dataclass(
        cls: type | None = None,
        /,
        *,
        frozen: bool = False,
        eq: bool = True,
        repr: bool = True,
        slots: bool = False,
        kw_only: bool = False,
    ) -> Any:
        """As `dataclasses.dataclass`, and its instances are taken by `dataclasses.replace` and `fields` alike."""

        def make(cls: type) -> type:
            made: Any = dataclasses.dataclass(cls, init=False, repr=False, eq=False, slots=slots, kw_only=kw_only)
            written = vars(cls)
            for name, method in _methods(made, frozen=frozen, eq=eq, repr=repr, slots=slots):
                if name not in written or (name == "__hash__" and written[name] is None):
                    setattr(made, name, method)
            return made

        return make if cls is None else make(cls)


def _methods(cls: Any, *, frozen: bool, eq: bool, repr: bool, slots: bool) -> list[tuple[str, Any]]:
    """What the decorator adds, unless the class has written it itself."""
    methods: list[tuple[str, Any]] = [("__init__", _Initialiser(cls, frozen=frozen))]
    if repr:
        methods.append(("__repr__", _repr))
    if eq:
        compared = [f.name for f in fields(cls) if f.compare]
        methods += [("_compared", _values(compared)), ("__eq__", _eq), ("__hash__", _hash if frozen else None)]
    if frozen:
        methods += [("__setattr__", _setattr), ("__delattr__", _delattr)]
        if slots:
            methods += [("__getstate__", _getstate), ("__setstate__", _setstate)]
    return methods


class _Initialiser:
    """The `__init__` of a class, which puts the compiled one into its own place when it is first looked up."""

    def __init__(self, cls: Any, *, frozen: bool) -> None:
        self.cls, self.frozen = cls, frozen

    def __get__(self, instance: object, owner: type) -> Any:
        self.cls.__init__ = function = _compiled(self.cls, frozen=self.frozen)
        return function if instance is None else function.__get__(instance)


def _compiled(cls: Any, *, frozen: bool) -> Any:
    """`def __init__(self, a, b=_default_b, *, c): …` for the fields of a class."""
    known: dict[str, Any] = {"_set": object.__setattr__ if frozen else setattr, "_missing": MISSING}
    places, keywords = ["self"], list[str]()
    body: list[str] = []
    for f in fields(cls):
        value, optional = f.name, True
        if f.default is not MISSING:
            known[f"_default_{f.name}"] = f.default
        elif f.default_factory is not MISSING:
            known[f"_default_{f.name}"], known[f"_make_{f.name}"] = MISSING, f.default_factory
            value = f"_make_{f.name}() if {f.name} is _missing else {f.name}"
        else:
            optional = False
        if f.init:
            (keywords if f.kw_only else places).append(f"{f.name}=_default_{f.name}" if optional else f.name)
            body.append(f"_set(self, {f.name!r}, {value})")
    if hasattr(cls, "__post_init__"):
        body.append("self.__post_init__()")
    parameters = ", ".join([*places, *(["*"] if keywords else []), *keywords])
    exec(f"def __init__({parameters}):\n " + "\n ".join(body or ["pass"]), known)
    function = known["__init__"]
    function.__qualname__, function.__module__ = f"{cls.__qualname__}.__init__", cls.__module__
    function.__annotations__ = {f.name: f.type for f in fields(cls)} | {"return": None}
    return function


def _values(names: list[str]) -> Any:
    """A function from an instance to the tuple of some of its fields."""
    match names:
        case []:
            return staticmethod(lambda _: ())
        case [name]:
            return attrgetter(name, name)  # of a single one it would give no tuple
        case _:
            return attrgetter(*names)


def _repr(self: Any) -> str:
    shown = ", ".join(f"{f.name}={getattr(self, f.name)!r}" for f in fields(self) if f.repr)
    return f"{type(self).__qualname__}({shown})"


def _eq(self: Any, other: Any) -> Any:
    return self._compared(self) == other._compared(other) if other.__class__ is self.__class__ else NotImplemented


def _hash(self: Any) -> int:
    return hash(self._compared(self))


def _setattr(_self: Any, name: str, _value: Any) -> None:
    raise FrozenInstanceError(f"cannot assign to field {name!r}")


def _delattr(_self: Any, name: str) -> None:
    raise FrozenInstanceError(f"cannot delete field {name!r}")


def _getstate(self: Any) -> list[Any]:
    return [getattr(self, f.name) for f in fields(self)]


def _setstate(self: Any, state: list[Any]) -> None:
    for f, value in zip(fields(self), state, strict=True):
        object.__setattr__(self, f.name, value)
