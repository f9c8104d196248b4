"""The model of a run: a text in the PRISM language, or explicit files."""

from __future__ import annotations

import sys
from pathlib import Path

from symcheck.api.model import Model
from symcheck.cli.output_paths import of_switch
from symcheck.cli.switches.arguments import Arguments
from symcheck.errors import UsageError
from symcheck.syntax.parse import is_jani, parse_model, parse_model_file
from symcheck.whole_file import uncompressed_name

__all__ = ["STANDARD_INPUT", "choose_model_file", "read_model"]

_MODEL_ENDINGS = (".pm", ".sm", ".nm", ".prism", ".jani")
_EXPLICIT_ENDINGS = (".all", ".pexp", ".umb", ".drn")


def _ends(path: str, endings: tuple[str, ...]) -> bool:
    """Whether the name of a file, compressed or not, has one of the endings."""
    return uncompressed_name(path)[0].endswith(endings)


STANDARD_INPUT = "-"
"""The name of the standard input in the place of the model."""


def choose_model_file(a: Arguments) -> str:
    """The file of the model. The files without a switch become the model and the properties.

    A first file `*.all`, `*.pexp`, `*.umb` or `*.drn` is an explicit model. If an -import switch
    names the model, the first file is that of the properties. A JANI file has properties of its
    own, which are checked if no others are given.

    Raises:
        UsageError: there is no model, or there are two.
    """
    if a.importmodel is None and a.model is not None and _ends(a.model, _EXPLICIT_ENDINGS):
        if not a.model.split(":")[0].endswith(".all") and not Path(a.model).exists():
            raise UsageError(f"cannot read {a.model}: there is no such file")
        a.model, a.properties, a.importmodel = a.properties, None, a.model
    if a.importmodel is not None and a.importtrans is not None:
        raise UsageError("-importmodel and -importtrans both name a model to read")
    if a.imports_model and a.properties is None:
        if a.model is not None and _ends(a.model, _MODEL_ENDINGS):
            raise UsageError(f"'{a.model}' and -import… both name a model to read")
        a.model, a.properties = None, a.model
    for file in (a.model, a.properties):
        if file is not None and "[" in file and not Path(file).exists():
            raise UsageError(
                f"cannot read {file}: there is no such file", hint=f"-pf '{file}' checks a property"
            )
    if a.model is not None and not _ends(a.model, _MODEL_ENDINGS):
        if a.properties is not None and _ends(a.properties, _MODEL_ENDINGS):
            raise UsageError(
                f"'{a.model}' stands in the place of the model, and '{a.properties}' in that of "
                "the properties",
                hint="symcheck MODEL PROPERTIES",
            )
    if a.properties is not None and "=" in a.properties and not Path(a.properties).exists():
        raise UsageError(
            f"cannot read {a.properties}: there is no such file",
            hint="commas separate constants: -const N=3,p=0.5",
        )
    if a.model is not None and is_jani(a.model) and a.properties is None and not a.pf:
        a.properties = a.model
    source = a.model or a.importmodel or a.importtrans
    if source is None:
        raise UsageError(
            "no model file is given",
            hint="symcheck MODEL [PROPERTIES] [switches]; --help lists the switches",
        )
    return source


def _standard_input(a: Arguments) -> str:
    """The text of the standard input. Raises UsageError."""
    if a.step:
        raise UsageError("-step reads the standard input, which holds the model")
    try:
        return sys.stdin.read()
    except (OSError, UnicodeDecodeError):
        raise UsageError("cannot read the standard input: not a UTF-8 text") from None


def read_model(a: Arguments) -> Model:
    """The model that the arguments name, without values of its constants.

    Raises InputError, UsageError.
    """
    if not a.imports_model:
        assert a.model is not None
        if a.model == STANDARD_INPUT:
            program = parse_model(_standard_input(a), "<stdin>")
            return Model(program, {}, a.options, a.model_type)
        return Model(parse_model_file(a.model), {}, a.options, a.model_type)
    from symcheck.exchange.api_io import imported_model
    from symcheck.exchange.formats.prism_reader import ModelFiles

    if a.importmodel is not None:
        with of_switch("-importmodel"):
            return imported_model(a.importmodel, a.options, a.model_type)
    assert a.importtrans is not None
    states, labels, state_rewards, transition_rewards = (
        None if name is None else Path(name)
        for name in (a.importstates, a.importlabels, a.importstaterewards, a.importtransrewards)
    )
    rewards = ((state_rewards, transition_rewards),) if state_rewards or transition_rewards else ()
    files = ModelFiles(Path(a.importtrans), states, labels, rewards)
    return imported_model(files, a.options, a.model_type)
