"""What the switches say about themselves: `-help SWITCH`, completion in shells, the manual page.

All of it comes from the parser of the command line, and so from the table in `symcheck.options`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

from symcheck.cli.switches.prism_options import ignored_switches, refused_switches
from symcheck.errors import UsageError
from symcheck.options import OPTIONS, Option

__all__ = ["SHELLS", "SwitchDescription", "completion", "explain", "manual_page"]

_FILES = ("FILE", "BASE", "PROGRAM")
"""Values that name files."""


_WORDS: dict[str, tuple[str, ...]] = {
    "-completion": ("bash", "zsh", "fish"),
    "-with": ("storm", "prism"),
    "-simmethod": ("ci", "aci", "apmc", "sprt"),
}
"""The words that may follow a switch that sets no option."""


class SwitchDescription(NamedTuple):
    """A switch of the parser.

    names: with one dash, the usual one first. values: what follows it, for help. help: its line of
    `symcheck --help`. option: the name of the option that it sets, or "".
    words: those that may follow; empty: those of the option, or any.
    """

    names: tuple[str, ...]
    values: tuple[str, ...]
    help: str
    option: str = ""
    words: tuple[str, ...] = ()

    @property
    def takes_file(self) -> bool:
        """Whether a file follows."""
        return any(part in value for value in self.values for part in _FILES)

    @property
    def choices(self) -> tuple[str, ...]:
        """The names that may follow."""
        if self.words:
            return self.words
        options = [o for o in OPTIONS if o.name == self.option and self.values]
        expected = options[0].values.expected if options else ""
        return tuple(expected[7:].split(", ")) if expected.startswith("one of ") else ()

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


def _bash(switches: Sequence[SwitchDescription]) -> str:
    named = [s for s in switches if s.choices]
    files = [name for s in switches if s.takes_file for name in s.names]
    other = [
        n for s in switches if s.values and not s.choices and not s.takes_file for n in s.names
    ]
    cases = "".join(
        f"        {'|'.join(s.names)})\n"
        f'            COMPREPLY=($(compgen -W "{" ".join(s.choices)}" -- "$word")); return ;;\n'
        for s in named
    )
    return f"""\
# Completion of symcheck in bash: source <(symcheck -completion bash)
_symcheck() {{
    local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}}
    COMPREPLY=()
    case ${{before/#--/-}} in
{cases}        {"|".join(files)})
            COMPREPLY=($(compgen -f -- "$word")); return ;;
        {"|".join(other)}) return ;;
    esac
    local switches="{" ".join(n for s in switches for n in s.names)}"
    if [[ $word == --* ]]; then
        COMPREPLY=($(compgen -P - -W "$switches" -- "${{word#-}}"))
    elif [[ $word == -* ]]; then
        COMPREPLY=($(compgen -W "$switches" -- "$word"))
    else
        COMPREPLY=($(compgen -f -- "$word"))
    fi
}}
complete -o filenames -F _symcheck symcheck
"""


def _zsh(switches: Sequence[SwitchDescription]) -> str:
    specs = []
    for s in switches:
        text = re.sub(r"([\[\]:])", r"\\\1", s.help).replace("'", "’")
        action = f"({' '.join(s.choices)})" if s.choices else "_files" if s.takes_file else " "
        values = "".join(f":{value.lower().replace(':', ' ')}:{action}" for value in s.values)
        specs += [f"    '*{name}[{text}]{values}' \\\n" for name in s.names]
    return f"""\
#compdef symcheck
# Completion of symcheck in zsh: symcheck -completion zsh > a folder of $fpath, as _symcheck
_arguments \\
{"".join(specs)}    '*:file:_files'
"""


def _fish(switches: Sequence[SwitchDescription]) -> str:
    lines = []
    for s in switches:
        values = f" -x -a '{' '.join(s.choices)}'" if s.choices else ""
        values = values or (" -r -F" if s.takes_file else " -x" if s.values else "")
        text = s.help.replace("\\", "\\\\").replace("'", "\\'")
        lines += [f"complete -c symcheck -o '{n[1:]}'{values} -d '{text}'\n" for n in s.names]
    head = "# Completion of symcheck in fish: symcheck -completion fish | source\n"
    return head + "".join(lines)


_COMPLETIONS: dict[str, Callable[[Sequence[SwitchDescription]], str]] = {
    "bash": _bash,
    "zsh": _zsh,
    "fish": _fish,
}
SHELLS = tuple(_COMPLETIONS)
"""The shells with completion."""


def completion(shell: str, switches: Sequence[SwitchDescription]) -> str:
    """A script that completes switches, names and files in a shell. Raises UsageError."""
    if shell not in _COMPLETIONS:
        raise UsageError(f"-completion: '{shell}' is none of {', '.join(SHELLS)}")
    names = tuple(n[1:] for s in switches for n in s.names if n != "-?")
    words = {**_WORDS, "-help": ("compare", *names)}
    return _COMPLETIONS[shell]([s._replace(words=words.get(s.names[0], ())) for s in switches])


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
