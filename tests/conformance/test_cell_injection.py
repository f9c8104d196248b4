"""The cell-injection model: its results, its variants, and every engine on an instance small enough for all of them."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pytest

from checking import judge_file, lines_without_run
from symcheck.api.loading import load
from symcheck.check.checker import check
from symcheck.check.testing.expected_results import VerdictKind
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.registry import BUILDERS
from symcheck.errors import ModelFault
from symcheck.explicit.build import explore
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind, bind_properties
from symcheck.semantics.reduction.reset_dead_variables import observe, reduce
from symcheck.syntax.parse import parse_model_file, parse_properties_file

FOLDER = Path(__file__).parents[2] / "models" / "cell_injection"
MODEL, PROPERTIES = FOLDER / "cell_injection.pm", FOLDER / "cell_injection.pctl"
PAPER = {
    "NoisePercentage": "0.01",
    "StepSizeXY": "18",
    "InitialPositionXY": "100",
    "MaxDistance": "250",
    "Damping": "1",
}
SMALL = {
    **PAPER,
    "CellBoundaryX": "104",
    "CellBoundaryY": "104",
    "MaxDistance": "163",  # a little beyond the last stage: tables have a row for each position
    "NoisePercentage": "0.005",
    "StepSizeXY": "27",
}


VARIANTS = [
    {**PAPER, "CellBoundaryX": x, "CellBoundaryY": y, "ForceBound": bound}
    for x, y in product(("174", "175", "176"), repeat=2)
    for bound in ("10", "5")
]


@pytest.mark.parametrize("constants", VARIANTS, ids=lambda c: "-".join([*c.values()][-3:]))
def test_results_of_the_study(constants):
    checked = judge_file(MODEL, PROPERTIES, constants, "explicit")
    assert [c.verdict.kind for c in checked] == [VerdictKind.PASS] * 9


UNDAMPED = {**VARIANTS[0], "CellBoundaryX": "175", "CellBoundaryY": "175", "Damping": "0"}


def test_results_without_damping():
    kinds = [c.verdict.kind for c in judge_file(MODEL, PROPERTIES, UNDAMPED, "explicit")]
    assert kinds.count(VerdictKind.PASS) == 4
    assert set(kinds) == {VerdictKind.PASS, VerdictKind.NOT_TESTED}


def test_every_result_line_is_compared():
    left = lines_without_run(PROPERTIES, [(MODEL, c) for c in (*VARIANTS, UNDAMPED)])
    # The search ends with an error there: see the damping of the other sign.
    assert len(left) == 9
    assert all("RESULT (Damping=-1): Error" in line for line in left)


def answers(engine: str) -> dict[str | None, float]:
    model = load(
        MODEL, SMALL, exact=engine == "exact", engine="explicit" if engine == "exact" else engine
    )
    return {p.name: float(r.value) for p, r in model.check_all(PROPERTIES, {"ForceBound": "10"})}


@pytest.mark.parametrize("engine", [e for e in BUILDERS if e not in ("explicit", "exact")])
def test_engines_agree_on_a_small_instance(engine):
    expected, found = answers("explicit"), answers(engine)
    assert found == pytest.approx(expected, abs=1e-6)
    assert 0.3 < expected["position_error"] < 0.4  # not a trivial instance
    assert expected["injected"] == 1  # the needle passes all stages


def test_reduction_keeps_the_values_of_the_study():
    """Every property with a reduction of its own, against the model as it is, to the last digits of a double."""
    constants = {**PAPER, "CellBoundaryX": "175", "CellBoundaryY": "176"}
    model = bind(parse_model_file(MODEL), constants)
    bound = bind_properties(parse_properties_file(PROPERTIES), model, {"ForceBound": "10"})
    whole, options = ExplicitEngine(explore(model, Options())), Options()
    for one in bound.properties:
        assert one.formula is not None
        small = ExplicitEngine(
            explore(reduce(model, observe(model, [one.formula], bound.labels)).model, options)
        )
        assert small.states < whole.states
        a, b = (check(e, one.formula, options, labels=bound.labels).value for e in (whole, small))
        assert a == pytest.approx(b, abs=1e-13)


def test_damping_of_the_other_sign_drives_the_needle_away():
    constants = {**PAPER, "CellBoundaryX": "175", "CellBoundaryY": "175", "Damping": "0"}
    model = load(MODEL, constants, engine="explicit")
    values = {p.name: r.value for p, r in model.check_all(PROPERTIES, {"ForceBound": "10"})}
    assert (values["deadlock_free"], values["injected"], values["position_error"]) == (True, 0, 1)
    with pytest.raises(
        ModelFault,
        match=r"X_cur would become 94, outside of \[100\.\.250\], for example in state \(count=2,k=1",
    ):
        explore(bind(parse_model_file(MODEL), {**constants, "Damping": "-1"}), Options())
