"""Write what a UMB file holds as text, to be read by people: each member of the archive in turn.

Source: PRISM's option to write UMB files as text (.umbt).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from umbi.binary import SizedType
from umbi.datatypes import JsonLike, json_to_string
from umbi.umb import ExplicitUmb
from umbi.umb.umb_to_tar import UmbEncoder

__all__ = ["umb_text"]


class _Texts(UmbEncoder):  # type: ignore[misc]  # umbi has no types
    """The members of a UMB archive as texts: umbi names them and calls `add_…` for each."""

    def __init__(self) -> None:
        super().__init__()
        self.texts: list[tuple[str, str]] = []

    def add_json(self, filename: str, json_obj: JsonLike, optional: bool = False) -> None:
        self.texts.append((filename, json_to_string(json_obj, compact_formatting=False)))

    def add_vector(
        self,
        filename: str,
        sized_type: SizedType,
        vector: Sequence[Any] | None,
        optional: bool = False,
    ) -> None:
        if vector is not None:
            self._add_list(filename, (f"{x:.14g}" if isinstance(x, float) else x for x in vector))

    def add_bitvector(
        self,
        filename: str,
        vector: Sequence[bool],
        optional: bool = False,
        pad_to_8_bytes: bool = True,
    ) -> None:
        self.texts.append((filename, f"[{''.join('1' if bit else '0' for bit in vector)}]"))

    def add_strings(
        self, filename: str, vector: Sequence[str], filename_csr: str, optional: bool = False
    ) -> None:
        self._add_list(filename, vector)

    def add_valuation_description(
        self, umb: ExplicitUmb, applies_to: str, valuation_desc: object
    ) -> None:
        states = umb.valuations[applies_to]
        self._add_list(
            f"valuations/{applies_to}/valuations.bin",
            ("{" + ",".join(f"{name}={value}" for name, value in x.items()) + "}" for x in states),
        )

    def _add_list(self, filename: str, values: Iterable[object]) -> None:
        self.texts.append((filename, f"[{','.join(map(str, values))}]"))


def umb_text(model: ExplicitUmb) -> Iterator[str]:
    """The text of a model: the name of each member of its UMB file, and its values."""
    encoder = _Texts()
    encoder.encode(model, insert_umbi_metadata=False)
    for name, text in encoder.texts:
        yield f"/{name}:\n{text}\n"
