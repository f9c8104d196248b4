"""Models from files and texts."""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path
from typing import Unpack, cast

from symcheck.api.arguments import ModelTypeName, model_type, takes_options
from symcheck.api.model import Model
from symcheck.constant_values import GivenConstants, constant_values
from symcheck.errors import UsageError
from symcheck.options import OptionValues, make_options
from symcheck.syntax.ast import ModelType
from symcheck.syntax.parse import parse_model, parse_model_file

__all__ = ["load", "loads"]


@takes_options
def load(
    path: str | Path,
    constants: GivenConstants | str | None = None,
    *,
    type: ModelType | ModelTypeName | None = None,
    **options: Unpack[OptionValues],
) -> Model:
    """Read a model file in the PRISM language, or in the JANI format (.jani).

    `check_all` of the same JANI file checks its properties.

    Args:
        path: the file.
        constants: one value for each constant that the file leaves open: a mapping, or a text such
            as "N=3,p=0.5".
        type: read the model as this type ("dtmc", "ctmc" or "mdp"), whatever its keyword says.
        options: see `symcheck.Options`.

    Raises:
        InputError: the text is faulty, or there is no such constant.
        UsageError: the file cannot be read, or an option or constant has a wrong value.

    Examples:
        >>> import symcheck
        >>> model = symcheck.load("models/die/die.pm", engine="sparse")
        >>> print(f"{model.check('P=? [ F d=6 ]'):.6f}")
        0.166667
    """
    if not isinstance(cast(object, path), str | PathLike) or "endmodule" in str(path):
        raise UsageError(
            f"load takes the name of a file, not {path!r}", hint="symcheck.loads takes a text"
        )
    given, chosen = constant_values(constants), make_options(options)
    return Model(parse_model_file(path), given, chosen, model_type(type)).checked()


@takes_options
def loads(
    text: str,
    constants: GivenConstants | str | None = None,
    *,
    type: ModelType | ModelTypeName | None = None,
    **options: Unpack[OptionValues],
) -> Model:
    """A model from its text; everything else is as for `load`."""
    if not isinstance(cast(object, text), str) or re.fullmatch(r"\S+\.\S+", text):
        raise UsageError(
            f"loads takes the text of a model, not {text!r:.80}", hint="symcheck.load reads a file"
        )
    given, chosen = constant_values(constants), make_options(options)
    return Model(parse_model(text), given, chosen, model_type(type)).checked()
