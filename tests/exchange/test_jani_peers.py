"""The quantitative verification benchmark set through JANI: the known numbers of states, and the reference values.

Each model is written as JANI with its properties, and read again.
"""

from __future__ import annotations

import json
import os
import sys
from dataclasses import replace
from fractions import Fraction

import pytest

import symcheck
from peers_folder import PEERS, or_skipped
from symcheck.errors import UnsupportedError
from symcheck.semantics.binding.bind import split_constants
from symcheck.syntax.parse import parse_expression

SUITE = PEERS / "qcomp"
LIMIT = int(os.environ.get("SYMCHECK_PEERS_STATES", "30000"))


def _instances():
    for reference in sorted(SUITE.glob("*/*/reference.json")):
        for instance in json.loads(reference.read_text())["instances"]:
            states = instance["states"]
            if instance["props"] is not None and states and max(states) <= LIMIT:
                constants = ",".join(f"{k}={v}" for k, v in instance["constants"].items())
                yield pytest.param(
                    reference.parent, instance, id=f"{instance['model']}-{constants}"
                )


def _known(value):
    """A reference value: exact if it is known exactly; None if it is not known."""
    if not isinstance(value, dict):
        return value
    if value.get("exact"):
        sys.set_int_max_str_digits(0)
        return float(Fraction(value["exact"]))
    return value.get("approx")


def _given(program, file, constants):
    """The constants of the model, and those of the properties."""
    texts = {n: str(v).lower() if isinstance(v, bool) else str(v) for n, v in constants.items()}
    split = split_constants(program, file, texts)
    return ({n: texts[n] for n in names} for names in (split.of_model, split.of_properties))


@pytest.mark.parametrize(("folder", "instance"), or_skipped(list(_instances()), 2))
def test_states_and_values_through_jani(folder, instance, tmp_path):
    source = folder / instance["model"]
    expected = {
        n: known for n, v in instance["results"].items() if (known := _known(v)) is not None
    }
    program, file = (
        symcheck.parse_model_file(source),
        symcheck.parse_properties_file(folder / instance["props"]),
    )
    of_model, of_properties = _given(program, file, instance["constants"])
    original = symcheck.load(source, of_model)
    path = tmp_path / "model.jani"
    kept = [
        p
        for p in file.properties
        if p.name in expected and _can_be_written(original, file, p, of_properties)
    ]
    values = {n: parse_expression(v) for n, v in of_properties.items()}
    constants = tuple(replace(c, value=values.get(c.name, c.value)) for c in file.constants)
    symcheck.export(original, str(path), replace(file, constants=constants, properties=tuple(kept)))
    again = symcheck.load(path)
    assert again.engine.states == original.engine.states
    for found, result in again.check_all(path):
        assert result.value == pytest.approx(expected[found.name], rel=1e-5), found.name


def _can_be_written(model, file, asked, constants):
    from symcheck.exchange.formats.jani_writer import jani_text

    bound = model.properties(file, constants).properties
    try:
        "".join(jani_text(model.bound, [b for b in bound if b.name == asked.name]))
    except UnsupportedError:
        return False
    return True
