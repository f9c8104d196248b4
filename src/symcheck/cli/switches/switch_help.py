"""What the switches say about themselves: `-help SWITCH`, completion in shells, the manual page.

All of it comes from the parser of the command line, and so from the table in `symcheck.options`.
"""

from __future__ import annotations

import re
from argparse import ArgumentParser
from collections.abc import Sequence
from typing import NamedTuple

from symcheck.cli.switches.prism_options import ignored_switches, refused_switches
from symcheck.errors import UsageError
from symcheck.options import OPTIONS, Option

__all__ = ["SHELLS", "SwitchDescription", "completion", "explain", "manual_page"]

_FILES = ("FILE", "BASE", "PROGRAM")
"""Values that name files."""

SHELLS = ("bash", "zsh", "fish")
"""The shells with completion."""

_WORDS = {
    "-completion": SHELLS,
    "-with": ("storm", "prism"),
    "-simmethod": ("ci", "aci", "apmc", "sprt"),
}
"""The words that may follow a switch that sets no option."""


class SwitchDescription(NamedTuple):
    """A switch of the parser.

    names: with one dash, the usual one first. values: what follows it, for help. help: its line of
    `symcheck --help`. option: the name of the option that it sets, or "".
    """

    names: tuple[str, ...]
    values: tuple[str, ...]
    help: str
    option: str = ""

    @property
    def usage(self) -> str:
        """Its spellings, with what follows: `-epsilon X, -e X`."""
        return ", ".join(" ".join((name, *self.values)) for name in self.names)


# ------------------------------------------------------------------------------ -help SWITCH

_COMPARE = """\
symcheck compare MODEL PROPERTIES -with PEER [switches]
  Checks the properties with symcheck and with a peer that is installed, and prints both answers,
  the bounds that symcheck proves, the difference, and which side the bounds prove wrong.

  PEER: storm (the package stormpy, or the program storm) or prism (the program prism). Words after
  the name are switches of the program: -with 'prism -explicit -epsilon 1e-9'.
  Other switches: -const, -prop, -pf, -timeout, and those of engines and methods. No files are
  written, and no tests are made.

  Exit status: 0 if the answers agree; 1 if two differ, or none can be compared.
  In Python: symcheck.compare("model.pm", "model.pctl", peer="storm")"""


def explain(word: str, switches: Sequence[SwitchDescription]) -> str:
    """What a switch does, also one of PRISM that is ignored or refused; or `compare`.

    Raises UsageError.
    """
    if word == "compare":
        return _COMPARE
    name = "-" + word.lstrip("-")
    ignored, refused = ignored_switches(), refused_switches()
    if name in ignored:
        return f"{name} has no effect: {ignored[name]}"
    if name in refused:
        return f"{name} is not supported: {refused[name]}"
    for switch in switches:
        if name in switch.names:
            lines = [switch.usage, f"  {switch.help}"]
            option = next((o for o in OPTIONS if o.name == switch.option), None)
            return "\n".join(lines + ([] if option is None else _described(option)))
    from difflib import get_close_matches

    known = [n for switch in switches for n in switch.names]
    near = get_close_matches(name, [*known, *ignored, *refused], 1, 0.7)
    hint = f"did you mean {near[0]}? " if near else ""
    raise UsageError(f"-help: there is no switch {name}", hint=f"{hint}-help lists the switches")


def _described(option: Option) -> list[str]:
    others = [f"-{s.names[0]}" for s in option.switches]
    return [
        "",
        f"  {option.sentence}",
        f"  Values: {option.values.expected}. Default: {option.default!r}.",
        f"  In Python: symcheck.load(…, {option.name}=…)",
        *([f"  Switches of this option: {', '.join(others)}"] if len(others) > 1 else []),
    ]


# -------------------------------------------------------------------------------- completion


def completion(shell: str, parser: ArgumentParser, switches: Sequence[SwitchDescription]) -> str:
    """A script that completes switches, names and files in a shell.

    Args:
        shell: its name.
        parser: it serves no other purpose afterwards.
        switches: those of the parser.

    Raises UsageError: the shell is another one.
    """
    if shell not in SHELLS:
        raise UsageError(f"-completion: '{shell}' is none of {', '.join(SHELLS)}")
    import shtab

    described = {s.names[0]: s for s in switches}
    names = [name[1:] for s in switches for name in s.names if name != "-?"]
    words = {**_WORDS, "-help": ("compare", *names)}
    of_options = {o.name: o.values.names for o in OPTIONS}
    for action in parser._actions:
        switch = described.get(action.option_strings[0]) if action.option_strings else None
        if switch is None or any(part in v for v in switch.values for part in _FILES):
            action.complete = shtab.FILE  # type: ignore[attr-defined]
        elif switch.values:
            action.choices = words.get(switch.names[0]) or of_options.get(switch.option)
        action.option_strings = [n for n in action.option_strings if n.strip("-") != "?"]
    script = shtab.complete(parser, shell)
    # In fish -s has one letter; shtab writes it before long names with one dash, too.
    return script.replace(" -s ", " -o ") if shell == "fish" else script


# ------------------------------------------------------------------------------- manual page


def manual_page(
    version: str, description: str, epilogue: str, switches: Sequence[SwitchDescription]
) -> str:
    """The manual page, in the macros of man(7)."""
    entries = "".join(f".TP\n.B {_roff(s.usage)}\n{_roff(s.help)}\n" for s in switches)
    examples = "".join(
        f".TP\n.B {_roff(command)}\n{_roff(what)}\n"
        for command, what in re.findall(r"^  (symcheck .+?)  +(\S.*)$", epilogue, re.MULTILINE)
    )
    paragraphs = epilogue[epilogue.index("Switches of PRISM") :].strip().split("\n\n")
    notes = "".join(f".PP\n{_roff(' '.join(p.split()))}\n" for p in paragraphs)
    return f"""\
.TH SYMCHECK 1 "" "symcheck {version}" "User Commands"
.SH NAME
symcheck \\- check probabilistic models against temporal logic
.SH SYNOPSIS
.B symcheck
.I MODEL
.RI [ PROPERTIES ]
.RI [ switches ]
.SH DESCRIPTION
{_roff(description)}
.SH EXAMPLES
{examples}.SH SWITCHES
{entries}.SH NOTES
{notes}"""


def _roff(text: str) -> str:
    """A text without the characters that roff interprets."""
    escaped = text.replace("\\", "\\e").replace("-", "\\-").replace("…", "...")
    return f"\\&{escaped}" if escaped.startswith((".", "'")) else escaped
