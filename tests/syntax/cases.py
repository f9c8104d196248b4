"""Read and run the error cases in tests/errors/syntax.

A case is a text of two sections: `=== model`, `=== properties` or `=== expression`, then `===
error` with exactly what the user sees. `python tests/syntax/cases.py` writes the errors anew, to be
read before they are kept.
"""

from __future__ import annotations

from pathlib import Path

from symcheck.errors import InputError
from symcheck.syntax.parse import parse_expression, parse_model, parse_properties

FOLDER = Path(__file__).parents[1] / "errors" / "syntax"
READERS = {"model": parse_model, "properties": parse_properties, "expression": parse_expression}


def read(path: Path) -> dict[str, str]:
    """The sections of a case."""
    parts = (part.partition("\n") for part in path.read_text(encoding="utf-8").split("=== ")[1:])
    return {name: text for name, _, text in parts}


def outcome(sections: dict[str, str]) -> str:
    """What the user sees."""
    kind = next(k for k in READERS if k in sections)
    try:
        READERS[kind](sections[kind], kind)
    except InputError as error:
        return str(error) + "\n"
    return "no error\n"


def main() -> None:
    for path in sorted(FOLDER.glob("*.case")):
        sections = read(path)
        sections["error"] = outcome(sections)
        path.write_text(
            "".join(f"=== {name}\n{text}" for name, text in sections.items()), encoding="utf-8"
        )


if __name__ == "__main__":
    main()
