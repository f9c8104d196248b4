"""The parser of the command line: switches with one dash or two, and what each of them needs."""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Callable, Sequence
from copy import copy
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn, TypeVar

from symcheck.cli.switches.needs import ALWAYS, Given, Needs
from symcheck.errors import UsageError
from symcheck.options import read_count, read_number

__all__ = [
    "Export",
    "ExportPart",
    "HelpFormatter",
    "SetOption",
    "SwitchParser",
    "digits",
    "positive_count",
    "positive_number",
    "typed",
]

if TYPE_CHECKING:  # most runs do without
    from symcheck.cli.switches.switch_help import SwitchDescription

T = TypeVar("T")

_STORE = argparse._StoreAction


class Export(NamedTuple):
    """A switch that writes a part of the model.

    kind: an extension, or 'model'. argument: FILE[:OPTIONS], or FILES[:OPTIONS] for 'model'.
    """

    kind: str
    argument: str


class HelpFormatter(argparse.RawDescriptionHelpFormatter):
    """Help as wide as the terminal; argparse would import shutil to find the width."""

    def __init__(self, prog: str) -> None:
        try:
            width = os.get_terminal_size(1).columns
        except OSError:
            width = 120
        super().__init__(prog, width=max(width - 2, 60))

    def _format_action_invocation(self, action: argparse.Action) -> str:
        """The switch with one dash only; the epilogue says that two are accepted."""
        shown = copy(action)
        shown.option_strings = [
            name for name in action.option_strings if not name.startswith("--")
        ] or action.option_strings
        return super()._format_action_invocation(shown)


class SwitchParser(argparse.ArgumentParser):
    """The parser of the command line. needs: of each switch, by its usual name with a dash."""

    def __init__(self, **keywords: Any) -> None:
        super().__init__(**keywords)
        self.needs: dict[str, Needs] = {}

    def error(self, message: str) -> NoReturn:
        """Raise UsageError with the message of argparse."""
        # argparse names each spelling: "argument -e/--e: expected one argument".
        message = re.sub(r"^argument (-\w+)[^:]*:", r"\1:", message)
        message = message.replace("expected one argument", "expected a value")
        raise UsageError(message, hint="symcheck --help lists the switches")

    def add(
        self, names: str, values: str, help: str, needs: Needs = ALWAYS, **keywords: Any
    ) -> None:
        """A switch that is written with one dash, and with two as well.

        Args:
            names: the usual one first.
            values: the names of what follows it; empty: nothing follows.
            help: one line of the help.
            needs: what it must have to have an effect.
            keywords: for `add_argument`.
        """
        spellings = [f"-{n}" for n in names.split()]
        self.needs[spellings[0]] = needs
        spellings += [f"-{n}" for n in spellings if len(n) > 2]
        if values:
            keywords["metavar"] = tuple(values.split()) if " " in values else values
        else:
            keywords.setdefault("action", "store_true")
        self.add_argument(*spellings, help=help, **keywords)

    def switches(self) -> list[SwitchDescription]:
        """The switches, in the order of the help."""
        from symcheck.cli.switches.switch_help import SwitchDescription

        result = []
        for action in self._actions:
            names = [n for n in action.option_strings if not n.startswith("--")]
            values = action.metavar if isinstance(action.metavar, tuple) else (action.metavar,)
            if names:
                given = () if action.nargs == 0 else tuple(v for v in values if v)
                option = action.dest if isinstance(action, SetOption) else ""
                result.append(SwitchDescription(tuple(names), given, action.help or "", option))
        return result

    def counts(self) -> dict[str, int]:
        """For each switch, how many words follow it; -1 for one that may be missing."""
        return {
            name: action.nargs
            if isinstance(action.nargs, int)
            else -1
            if action.nargs == "?"
            else 1
            for action in self._actions
            for name in action.option_strings
        }

    def given(self, words: Sequence[str]) -> dict[str, Given]:
        """The switches among words, by their usual names. Raises UsageError.

        Of an option that is given twice the last value holds, as in PRISM. For other switches with
        a value it is an error: only one file would be written.
        """
        actions = {name: a for a in self._actions for name in a.option_strings}
        result: dict[str, Given] = {}
        for word in words:
            written = word.partition("=")[0]
            if (action := actions.get(written)) is None:
                continue  # a file, or the value of a switch
            name = action.option_strings[0]
            if name in result and type(action) is _STORE and action.nargs != 0:
                raise UsageError(f"{written} is given twice", hint="leave out one of them")
            result[name] = Given(written, self.needs[name])
        return result


def typed(read: Callable[[str], T]) -> Callable[[str], T]:
    """A reader of values as argparse wants it: its ValueError is the message."""

    def reader(text: str) -> T:
        try:
            return read(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return reader


@typed
def positive_count(text: str) -> int:
    """A whole number from 1."""
    value = read_count(text)
    if not value:
        raise ValueError("0 is too few")
    return value


@typed
def digits(text: str) -> int:
    """A number of digits."""
    if not text.isdigit() or int(text) < 1:
        raise ValueError(f"'{text}' is not a number of digits")
    return int(text)


@typed
def positive_number(text: str) -> float:
    """A finite number above 0."""
    value = read_number(text)
    if not 0 < value < float("inf"):
        raise ValueError(f"'{text}' is not a number above 0")
    return value


class SetOption(argparse.Action):
    """Notes the value of an option of `symcheck.options`: `const`, or what follows."""

    def __call__(
        self, _: object, arguments: argparse.Namespace, values: object, __: str | None = None
    ) -> None:
        """Note the value."""
        arguments.settings[self.dest] = values if self.const is None else self.const


class ExportPart(argparse.Action):
    """Appends a part of the model to `exports`, one for each kind."""

    def __init__(
        self, option_strings: Sequence[str], dest: str, *, kinds: str, **keywords: Any
    ) -> None:
        super().__init__(option_strings, dest, default=argparse.SUPPRESS, **keywords)
        self.kinds = kinds.split()

    def __call__(
        self, _: object, arguments: argparse.Namespace, values: object, __: str | None = None
    ) -> None:
        """Append the exports."""
        files = values if isinstance(values, list) else [values]
        arguments.exports += map(Export, self.kinds, files)
