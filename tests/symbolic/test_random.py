"""Random small models: every schedule, order and way of encoding gives what the scalar semantics
gives, faults included.
"""

from __future__ import annotations

import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from explicit.models import models
from symbolic.oracle import assert_same, bound, explore, symbolic
from symcheck.errors import InputError, ModelFault
from symcheck.symbolic.reachability.search import SCHEDULES
from symcheck.symbolic.tuning import EncodingLimits

_LIMITS = {
    "tabulated": EncodingLimits(),
    "composed": EncodingLimits(table_bits=0),
    "on the fly": EncodingLimits(
        table_bits=0, wide_table_bits=0, assignment_bits=0, max_nodes=0, max_leaves=0
    ),
}


@settings(max_examples=60, deadline=None)
@given(
    models(), st.sampled_from(sorted(SCHEDULES)), st.sampled_from(sorted(_LIMITS)), st.booleans()
)
def test_agrees_with_the_scalar_semantics(text, schedule, way, backwards):
    try:
        model = bound(text)
    except InputError:  # such as 1/0 in a constant expression
        return
    order = [v.name for v in reversed(model.variables)] if backwards else None
    schedule = "frontier" if way == "on the fly" else schedule
    try:
        explore(model)
    except ModelFault as fault:
        event("fault")
        codes = {d.code for d in fault.diagnostics}
        with pytest.raises(ModelFault) as found:
            symbolic(model, schedule, limits=_LIMITS[way], order=order)
        # The oracle stops at the first faulty state; the diagrams show one of each kind.
        assert codes <= {d.code for d in found.value.diagnostics}
        return
    assert_same(model, symbolic(model, schedule, limits=_LIMITS[way], order=order))
