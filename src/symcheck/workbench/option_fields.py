"""The fields of the options, in the words of `symcheck --help`."""

from __future__ import annotations

from typing import Any

from symcheck.options import OPTIONS, Option

__all__ = ["option_fields", "shown_options"]

_WITHOUT_FIELD = (
    *("strategy", "everywhere"),  # jobs set them
    *("regions", "lifting"),  # of parameters, which have no field
    *("ltl2da", "ltl2da_syntax", "workdir"),  # programs and folders: not from a browser
)
_GROUPS = {"method": "How values are computed", "model": "How the model is built"}


def shown_options() -> list[Option]:
    """The options with a field."""
    return [o for o in OPTIONS if o.name not in _WITHOUT_FIELD]


def option_fields() -> list[dict[str, Any]]:
    """The groups of fields: their title, and the fields.

    A field has the name of its option, its switch and words, a sentence of help, the text of its
    default, and its other values, as pairs of texts and words. One other value is set by a box that
    is ticked, several by a list; where there is none, a text is written.
    """
    return [
        {"title": title, "fields": [_field(o) for o in shown_options() if o.group == group]}
        for group, title in _GROUPS.items()
    ]


def _field(option: Option) -> dict[str, Any]:
    default = "" if option.default is None else str(option.default).lower()
    switches = [s for s in option.switches if s.value is None or s.value != option.default]
    values = {name: name for name in option.values.names}
    for s in switches:
        if s.value is not None:
            values[str(s.value).lower()] = f"{s.help} (-{s.names[0]})"
    values.pop(default, None)
    is_one = len(switches) == 1
    return {
        "name": option.name,
        "switch": f"-{switches[0].names[0]}" if is_one else "",
        "words": switches[0].help if is_one else option.name,
        "about": _with_default(option, "" if len(values) == 1 else default or "none"),
        "default": default,
        "values": list(values.items()),
    }


def _with_default(option: Option, default: str) -> str:
    """The sentence with the default, of which it may tell as `None`; "" for a box."""
    if "None: " in option.sentence:
        return option.sentence.replace("None: ", "Default: ")
    return f"{option.sentence} Default: {default}." if default else option.sentence
