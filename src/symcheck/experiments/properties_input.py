"""The properties of a run, from a file and from texts.

Those that do not follow the grammar are reported in their place.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from pathlib import Path

from symcheck.errors import SyntaxFault
from symcheck.syntax.declarations import PropertiesFile
from symcheck.syntax.parse import is_jani, parse_jani_file, text_of_file
from symcheck.syntax.properties_in_part import (
    PropertiesInput,
    UnparsedProperty,
    parse_properties_in_part,
)

__all__ = ["read_properties"]


def read_properties(
    path: str | Path | None,
    texts: Sequence[str],
    name: str = "<properties>",
    *,
    refuses: bool = True,
) -> PropertiesInput:
    """The properties of a file, followed by those of some texts.

    Args:
        path: the file, or None.
        texts: the texts.
        name: what messages call them.
        refuses: whether a text of which no property follows the grammar is refused as a whole.

    Raises:
        UsageError: the file cannot be read.
        SyntaxFault: a text is refused, or it is that of a model.
    """
    if path is None:
        parts = []
    elif is_jani(path):
        parts = [_jani(path)]
    else:
        parts = [_text(text_of_file(path), str(path), refuses)]
    parts += [_text(text, name, refuses) for text in texts]
    unparsed: dict[int, UnparsedProperty] = {}
    count = 0
    for part in parts:
        unparsed |= {count + i: fault for i, fault in part.unparsed.items()}
        count += len(part.file.properties)
    declarations = [fault for part in parts for fault in part.declarations]
    return PropertiesInput(_joined([part.file for part in parts]), unparsed, declarations)


def _text(text: str, name: str, refuses: bool) -> PropertiesInput:
    found = parse_properties_in_part(text, name)
    if refuses and found.diagnostics and not found.parsed.properties:
        raise SyntaxFault(*found.diagnostics)
    return found


def _jani(path: str | Path) -> PropertiesInput:
    parsed = parse_jani_file(path)
    unparsed = {}
    for i, fault in parsed.faults.items():
        given = parsed.properties.properties[i]
        unparsed[i] = UnparsedProperty(given.name or f"{i + 1}", fault, given.span)
    return PropertiesInput(parsed.properties, unparsed)


def _joined(files: Sequence[PropertiesFile]) -> PropertiesFile:
    return PropertiesFile(
        tuple(chain.from_iterable(f.constants for f in files)),
        tuple(chain.from_iterable(f.formulas for f in files)),
        tuple(chain.from_iterable(f.labels for f in files)),
        tuple(chain.from_iterable(f.properties for f in files)),
        tuple(chain.from_iterable(f.faulty for f in files)),
    )
