"""What the editor shows of the model and its properties. Places are counted in UTF-16 units."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

from symcheck.check.property_instance import PropertyInstance
from symcheck.check.strategies.strategy import has_strategy
from symcheck.errors import Diagnostic
from symcheck.lsp.answers import Document, formatted, quick_fixes
from symcheck.semantics.binding.bind import needed_constants, undefined_constants
from symcheck.syntax.declarations import Program, PropertiesFile

__all__ = ["Texts", "analysis", "completions", "faults", "formatted", "hover"]

_OTHER = {"model": "prism", "properties": "properties"}


class Texts(NamedTuple):
    """The texts in the editor, with the names of their files."""

    model_name: str
    model: str
    properties_name: str
    properties: str


@lru_cache(4)
def _document(name: str, text: str, part: str, model: Document | None = None) -> Document:
    return Document(name, text, _OTHER[part], model)


def _documents(texts: Texts) -> dict[str, Document]:
    model = _document(texts.model_name, texts.model, "model")
    of_model = _document(texts.properties_name, texts.properties, "properties", model)
    return {"model": model, "properties": of_model}


def _units(text: str, offset: int) -> int:
    """The UTF-16 units before an offset."""
    return offset if text.isascii() else len(text[:offset].encode("utf-16-le")) // 2


def _offset(text: str, units: int) -> int:
    if text.isascii():
        return units
    return len(text.encode("utf-16-le")[: 2 * units].decode("utf-16-le", "ignore"))


def faults(text: str, diagnostics: list[Diagnostic]) -> list[dict[str, Any]]:
    """The faults of a text for the editor, with what puts them right."""
    return [
        {
            "from": _units(text, d.span.start),
            "to": _units(text, max(d.span.end, min(d.span.start + 1, len(text)))),
            "severity": d.severity,
            "message": d.message + (f"\nhint: {d.hint}" if d.hint else ""),
            "fixes": [
                {"title": title, "from": _units(text, a), "to": _units(text, b), "text": new}
                for title, a, b, new in quick_fixes(d)
            ],
        }
        for d in diagnostics
    ]


def analysis(texts: Texts) -> dict[str, Any]:
    """Faults and colours of both texts, the properties, and the constants without a value.

    An empty text has no faults: it is a beginning.
    """
    documents = _documents(texts)
    found: dict[str, Any] = {
        part: {
            "faults": faults(d.text, [*d.diagnostics, *d.warnings]) if d.text.strip() else [],
            "colours": [
                [_units(d.text, start), _units(d.text, end), kind]
                for start, end, kind in d.colours()
            ],
        }
        for part, d in documents.items()
    }
    model, properties = documents["model"].program, documents["properties"].program
    if isinstance(properties, PropertiesFile):
        text = documents["properties"].text
        parsed: list[dict[str, Any]] = [
            {
                "name": p.name or "",
                "text": PropertyInstance(properties, i, {}).text,
                "at": _units(text, p.span.start),
            }
            for i, p in enumerate(properties.properties)
        ]
        unparsed = [
            {
                "name": "",
                "text": p.text,
                "at": _units(text, p.span.start),
                "constants": [],
                "fault": str(p.fault),
            }
            for p in documents["properties"].unparsed
        ]
        found["list"] = sorted([*parsed, *unparsed], key=lambda listed: listed["at"])
        if isinstance(model, Program):  # the fields stay while a text is faulty
            of_properties = (c for c in properties.constants if c.value is None)
            constants = [*undefined_constants(model), *of_properties]
            found["constants"] = [{"name": c.name, "type": c.type.value} for c in constants]
            found["of_model"] = [c.name for c in undefined_constants(model)]
            needed = needed_constants(model, properties)
            for listed, names in zip(parsed, needed, strict=True):
                listed["constants"] = names
            if (bound := documents["model"].bound) is not None:
                found["timed"] = bound.type.continuous_time
                for listed, p in zip(parsed, properties.properties, strict=True):
                    listed["chooses"] = has_strategy(bound, p.formula)
    return found


def hover(texts: Texts, part: str, units: int) -> str:
    """The help at a place, in Markdown; "" for none."""
    document = _documents(texts)[part]
    shown = document.hover(_offset(document.text, units))
    return "" if shown is None else shown[0]


def completions(texts: Texts, part: str, units: int) -> list[dict[str, str]]:
    """The words that may stand at a place."""
    document = _documents(texts)[part]
    found = document.completions(_offset(document.text, units))
    return [{"label": i.word, "type": i.what, "detail": i.detail or i.what} for i in found]
