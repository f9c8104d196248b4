"""Extension of griffe: the keyword parameters that are options have their sentence and default in
the library reference. Griffe's own `unpack_typeddict` writes them without, and has to run before.
"""

from __future__ import annotations

from typing import Any

from griffe import DocstringSectionKind, Extension, Function

from symcheck.options import OPTIONS

_OPTIONS = {option.name: option for option in OPTIONS}


class OptionParameters(Extension):
    """Completes the parameters of functions that take options."""

    def on_function(self, *, func: Function, **_: Any) -> None:
        """Complete those in the signature and those in the docstring."""
        taken = [p for p in func.parameters if p.default == "..." and p.name in _OPTIONS]
        for parameter in taken:
            parameter.default = repr(_OPTIONS[parameter.name].default)
        for section in func.docstring.parsed if taken and func.docstring else ():
            if section.kind is DocstringSectionKind.parameters:
                for described in section.value:
                    option = _OPTIONS.get(described.name)
                    if option is not None and described.value == "...":
                        described.value, described.description = (
                            repr(option.default),
                            option.sentence,
                        )
