"""Write the table of options in command_line.md, and the manual page symcheck.1, from their
declaration in `symcheck.options`.

.venv/bin/python docs/make_options.py
"""

from __future__ import annotations

import re
from pathlib import Path

from symcheck import __version__
from symcheck.cli.switches.arguments import HELP_EPILOGUE, make_parser
from symcheck.cli.switches.switch_help import manual_page
from symcheck.options import OPTIONS, Option

PAGE = Path(__file__).parent / "command_line.md"
MANUAL = Path(__file__).parent / "symcheck.1"
TABLE = re.compile(r"(?<=<!-- options -->\n\n).*?(?=<!-- end of options -->)", re.DOTALL)


def table() -> str:
    """The table: switches, keyword parameter with its default, and what the option does."""
    rows = "".join(
        f"| {_switches(o)} | `{o.name}={o.default!r}` | {_sentence(o)} |\n" for o in OPTIONS
    )
    return f"| switches | `symcheck.load(…)` | |\n|---|---|---|\n{rows}"


def manual() -> str:
    """The manual page."""
    parser = make_parser()
    assert parser.description is not None
    return manual_page(__version__, parser.description, HELP_EPILOGUE, parser.switches())


def _sentence(option: Option) -> str:
    """What the option does, and its values if these are names."""
    expected = option.values.expected
    return option.sentence + (f" O{expected[1:]}." if expected.startswith("one of") else "")


def _switches(option: Option) -> str:
    """The switches of an option; those with the same effect stand together."""
    return ", ".join(
        " ".join(f"`-{name}`" for name in s.names)
        + (f" {option.values.metavar}".replace("|", " or ") if s.value is None else "")
        for s in option.switches
    )


if __name__ == "__main__":
    PAGE.write_text(TABLE.sub(lambda _: table(), PAGE.read_text()))
    MANUAL.write_text(manual())
