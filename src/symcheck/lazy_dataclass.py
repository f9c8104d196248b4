"""`dataclass`, whose methods are written when a class is first used.

That of the standard library compiles up to seven methods for each class, which takes half a
millisecond, and a run uses few of the classes that it imports. Here, `__init__` is compiled when
the first value is made. The standard library reads the fields then, and writes the other methods
when they are first called. Slots are made at once, because a class with slots is another one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

TYPE_CHECKING = False
if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass

__all__ = ["dataclass"]

_METHODS = {"__repr__": "repr", "__eq__": "eq", "__hash__": "eq"}
"""The option on which a method depends."""
_OF_CLASS = ("__dict__", "__weakref__")
_FACTORY: Any = type("", (), {"__repr__": lambda _: "<factory>"})()
"""The default of a field that a function makes, as a signature shows it."""


class _Attribute:
    """An attribute of a class whose fields are not yet read."""

    def __init__(self, name: str, write: Callable[[], type]) -> None:
        self._name, self._write = name, write

    def __get__(self, _instance: object, _owner: type) -> object:
        return getattr(self._write(), self._name)


def _method(name: str, write: Callable[[], type]) -> Callable[..., object]:
    def method(self: object, /, *arguments: object, **keywords: object) -> object:
        return getattr(write(), name)(self, *arguments, **keywords)

    return method


def _refuse(_self: object, name: str, *_value: object) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")


def _lazy(
    cls: Any, *, frozen: bool = False, slots: bool = False, kw_only: bool = False, **options: bool
) -> Any:
    """The class, with methods and attributes that are written when they are first used."""
    given = {n: v for n, v in cls.__dict__.items() if n not in _OF_CLASS}
    if slots:
        cls = _with_slots(cls, given, frozen)

    def read(bases: tuple[type, ...], **which: bool) -> Any:
        """What the standard library makes of the class without slots; that with them is in use."""
        which = {"init": False, "repr": False, "eq": False, "kw_only": kw_only} | which
        return dataclasses.dataclass(**which)(type(cls)(cls.__name__, bases, given))

    def write() -> Any:
        own = read(())
        fields: dict[str, dataclasses.Field[object]] = {}
        for base in cls.__mro__[:0:-1]:
            fields |= getattr(base, "__dataclass_fields__", {})
        for name in () if slots else own.__dataclass_fields__:
            if name in own.__dict__:
                setattr(cls, name, own.__dict__[name])
            else:  # it has no default, or a factory; another thread may be as far
                with suppress(AttributeError):
                    delattr(cls, name)
        own.__dataclass_params__.frozen = frozen
        cls.__dataclass_params__ = own.__dataclass_params__
        cls.__dataclass_fields__ = fields | own.__dataclass_fields__
        positional = [f.name for f in dataclasses.fields(cls) if f.init and not f.kw_only]
        setattr(cls, "__match_args__", tuple(positional))  # noqa: B010 (mypy lets nobody assign it)
        if "__init__" not in given:
            cls.__init__ = _init(cls, frozen)
        with suppress(AttributeError):  # the signature is that of `__init__` from now on
            del cls.__signature__
        return cls

    def write_others(option: str) -> Any:
        written = read(cls.__bases__, frozen=frozen, **{option: True})
        for name, of_option in _METHODS.items():
            if of_option == option:
                setattr(cls, name, written.__dict__[name])
        return cls

    if "__init__" not in given:
        cls.__init__ = _method("__init__", write)
    names = "__dataclass_fields__", "__dataclass_params__", "__match_args__", "__signature__"
    for name in names:
        setattr(cls, name, _Attribute(name, write))
    for name, option in _METHODS.items():
        if options.get(option, True) and given.get(name) is None:
            setattr(cls, name, _method(name, partial(write_others, option)))
    if frozen:
        cls.__setattr__ = cls.__delattr__ = _refuse
    return cls


def _init(cls: Any, frozen: bool) -> Callable[..., None]:
    """The method `__init__` of a class whose fields are known."""
    known: dict[str, object] = {"_set": object.__setattr__, "_factory": _FACTORY}
    positional, keywords, lines = ["self"], ["*"], []
    for f in dataclasses.fields(cls):
        name, parameter, value = f.name, f.name, f.name
        if f.default is not dataclasses.MISSING:
            known[f"_default_{name}"] = f.default
            parameter += f"=_default_{name}"
        elif f.default_factory is not dataclasses.MISSING:
            known[f"_make_{name}"] = f.default_factory
            parameter += "=_factory"
            value = (
                f"_make_{name}() if {name} is _factory else {name}" if f.init else f"_make_{name}()"
            )
        if f.init:
            (keywords if f.kw_only else positional).append(parameter)
        if f.init or value != name:
            lines.append(f"_set(self, {name!r}, {value})" if frozen else f"self.{name} = {value}")
    if hasattr(cls, "__post_init__"):
        lines.append("self.__post_init__()")
    parameters = positional + (keywords if len(keywords) > 1 else [])
    body = "\n ".join(lines or ["pass"])
    exec(f"def __init__({', '.join(parameters)}):\n {body}", known)
    init: Any = known["__init__"]
    init.__qualname__ = f"{cls.__qualname__}.__init__"
    types = {f.name: f.type for f in dataclasses.fields(cls) if f.init}
    init.__annotations__ = types | {"return": None}
    return init  # type: ignore[no-any-return]


def _with_slots(cls: Any, given: dict[str, Any], frozen: bool) -> Any:
    """The class anew, with slots. Frozen values are pickled by the values of their fields."""
    annotations = given.get("__annotations__", {}).items()
    fields = [name for name, kind in annotations if not kind.startswith("ClassVar")]
    inherited = {name for base in cls.__mro__ for name in base.__dict__.get("__slots__", ())}
    namespace = {name: value for name, value in given.items() if name not in fields}
    namespace["__slots__"] = tuple(name for name in fields if name not in inherited)
    namespace["__qualname__"] = cls.__qualname__
    if frozen:
        namespace |= {"__getstate__": _state, "__setstate__": _restore}
    return type(cls)(cls.__name__, cls.__bases__, namespace)


def _state(self: Any) -> list[object]:
    return [getattr(self, field.name) for field in dataclasses.fields(self)]


def _restore(self: Any, state: list[object]) -> None:
    for field, value in zip(dataclasses.fields(self), state, strict=True):
        object.__setattr__(self, field.name, value)


if not TYPE_CHECKING:

    def dataclass(cls=None, /, **options):
        """A class whose methods are written when they are used; see `dataclasses.dataclass`."""
        return (lambda given: _lazy(given, **options)) if cls is None else _lazy(cls, **options)
