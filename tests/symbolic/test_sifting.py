"""Orders that sifting finds: smaller diagrams, the same model."""

from __future__ import annotations

import gc
import weakref
from pathlib import Path

import numpy as np
import pytest

import symcheck
from symbolic.oracle import assert_same, bound, symbolic
from symbolic.test_order import partners
from symcheck.dd.manager import DiagramManager
from symcheck.engines import registry, tuning
from symcheck.errors import MemoryLimitError, TimeLimitError, UnsupportedError, UsageError
from symcheck.exchange.explicit_export import explicit_export
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind
from symcheck.symbolic.build import build, chosen_order
from symcheck.symbolic.encoding.variables import encode
from symcheck.symbolic.events.encode_events import encode_events
from symcheck.symbolic.ordering import sifting as module
from symcheck.symbolic.ordering.sifting import SiftedOrder, sift
from symcheck.symbolic.reachability.search import reach
from symcheck.symbolic.tuning import SiftLimits
from symcheck.syntax.parse import parse_model_file

MODELS = Path(__file__).parents[2] / "models"
SIFTED = Options(order=("sift",))


def instance(name: str):
    folder = MODELS / name.partition(".")[0].rstrip("0123456789")
    constants = {
        "kanban.sm": {"t": 2},
        "tandem.sm": {"c": 7},
        "crowds.pm": {"TotalRuns": 2, "CrowdSize": 4},
    }.get(name, {})
    return bind(parse_model_file(folder / name), {n: str(v) for n, v in constants.items()})


def nodes(model, options: Options) -> int:
    return reach(build(model, options)).states.node_count


@pytest.mark.parametrize("n", [4, 8, 12])
def test_an_order_that_is_exponential_as_declared_becomes_linear(n):
    model = bound(partners(n))
    assert nodes(model, Options()) > 2**n
    assert nodes(model, SIFTED) <= 8 * n


def test_it_is_found_where_the_search_as_declared_is_too_long():
    model = bound(partners(18))
    found = sift(model, Options(), SiftLimits(lookups=20_000, part_nodes=(500, 500, 500, 500)))
    assert found.whole
    assert nodes(model, Options(order=found.order)) <= 8 * 18


def test_what_is_found_is_an_order_of_all_variables_and_can_be_given():
    model = bound(
        "dtmc module m a : [0..3]; one : [5..5]; b : bool; [] true -> (a'=mod(a+1,4))&(b'=!b); endmodule"
    )
    found = sift(model, Options())
    assert sorted(found.order) == ["a", "b", "one"]
    assert (
        chosen_order(model, Options(order=found.order))
        == found.order
        == chosen_order(model, SIFTED)
    )
    assert encode(model, found.order).ordered[-1].name == "one"  # no bits: below all
    assert ",".join(found.order) in str(found)


def test_the_same_model_gets_the_same_order():
    model = instance("kanban.sm")
    assert len({sift(model, Options()).order for _ in range(3)}) == 1


@pytest.mark.parametrize(
    "name", ["kanban.sm", "polling.sm", "dining.nm", "crowds.pm", "herman7.pm"]
)
def test_states_and_relations_never_take_more_nodes(name):
    found = sift(instance(name), Options())
    assert found.whole
    assert found.note is None
    assert found.after <= found.before


def test_a_sifted_model_is_the_same_model():
    model = bound("""mdp
        module m x : [0..5]; y : bool; [a] x<5 -> 0.5:(x'=x+1) + 0.5:(x'=0)&(y'=!y); [] y -> (x'=5); endmodule
        module n z : [-3..2]; [a] z<2 -> (z'=z+1); [a] z=2 -> (z'=-3); endmodule""")
    order = ["z", "x", "y"]
    assert_same(model, symbolic(model, order=sift(model, Options()).order))
    assert_same(model, symbolic(model, order=order))


@pytest.mark.parametrize("engine", ["hybrid", "sparse", "mtbdd"])
@pytest.mark.parametrize("name", ["polling.sm", "tandem.sm", "dining.nm", "herman7.pm"])
def test_what_is_exported_does_not_depend_on_the_order(name, engine):
    model = instance(name)
    declared, sifted = (
        explicit_export(registry.build(model, options))
        for options in (Options(engine=engine), Options(engine=engine, order=("sift",)))
    )
    assert (sifted.n, sifted.matrix.indptr.tolist()) == (
        declared.n,
        declared.matrix.indptr.tolist(),
    )
    assert all(np.array_equal(a, b) for a, b in zip(sifted.columns, declared.columns, strict=True))
    assert np.array_equal(sifted.matrix.indices, declared.matrix.indices)
    assert np.allclose(sifted.values, declared.values, rtol=1e-15)


def test_the_default_engine_looks_for_an_order_once_and_tells_it(monkeypatch):
    told: list[object] = []
    registry.build(instance("kanban.sm"), SIFTED, told.append)
    assert not any(isinstance(x, SiftedOrder) for x in told)  # few states: no diagram, no order
    monkeypatch.setattr(tuning, "SMALL_MODEL_STATES", 10)
    monkeypatch.setattr(tuning, "SPARSE_MODEL_STATES", 20)
    engine = registry.build(instance("kanban.sm"), SIFTED, told.append)
    assert engine.name.startswith("sparse")
    assert sum(isinstance(x, SiftedOrder) for x in told) == 1


def test_learned_relations_stay_as_declared():
    wide = "; ".join(f"x{i} : [0..1000]" for i in range(7))
    total = "+".join(f"x{i}" for i in range(7))
    found = sift(
        bound(f"dtmc module m {wide}; [] true -> (x6'=mod(ceil(pow({total},0.5)),7)); endmodule"),
        Options(),
    )
    assert found.order == tuple(f"x{i}" for i in range(7))
    assert "on the fly" in str(found)


def test_unbounded_integers_are_refused_as_everywhere_on_diagrams():
    with pytest.raises(UnsupportedError, match="no bounds"):
        sift(bound("dtmc module m x : int; [] true -> (x'=x+1); endmodule"), Options())


def test_limits_of_time_end_it_in_some_order():
    found = sift(bound(partners(4)), Options(time_limit=1e-6))
    assert found.order == tuple(f"{x}{i}" for x in "xy" for i in range(4))
    assert "as declared" in str(found)


def test_a_limit_of_time_in_the_middle_leaves_the_order_reached_by_then(monkeypatch):
    rounds = []

    def stopped(manager, groups, growth, whole=DiagramManager.sift):
        rounds.append(len(groups))
        whole(manager, groups, growth)
        raise TimeLimitError("no more")

    monkeypatch.setattr(DiagramManager, "sift", stopped)
    found = sift(bound(partners(6)), Options())
    assert rounds == [12]
    assert found.whole
    assert found.after < found.before / 2


def test_diagrams_that_would_be_too_much_work_are_left_as_they_are():
    found = sift(bound(partners(8)), Options(), SiftLimits(work=1000, part_nodes=(100,)))
    assert not found.whole
    assert found.order == tuple(f"{x}{i}" for x in "xy" for i in range(8))
    assert "a part of the states" in str(found)


@pytest.mark.parametrize("engine", ["hybrid", "sparse", "mtbdd"])
def test_values_are_the_same(engine):
    folder = MODELS / "kanban"
    properties = (folder / "kanban.csl").read_text()
    one, other = (
        symcheck.load(folder / "kanban.sm", {"t": 1}, engine=engine, order=order)
        for order in (None, ("sift",))
    )
    declared, sifted = (
        [result.value for _, result in model.check_all(properties)] for model in (one, other)
    )
    assert declared
    assert sifted == pytest.approx(declared, rel=2e-6)


def test_where_the_declared_order_does_not_fit_it_starts_from_the_one_of_force(monkeypatch):
    orders = []

    def failing(model, manager, order, *rest, **named):
        orders.append(order)
        if order is None:
            raise MemoryLimitError("too many nodes")
        return encode_events(model, manager, order, *rest, **named)

    monkeypatch.setattr(module, "encode_events", failing)
    found = sift(bound(partners(6)), Options())
    assert orders[0] is None
    assert len(orders) == 2
    assert found.whole
    assert found.note is None


def test_a_variable_may_be_called_sift():
    model = bound("dtmc module m a : bool; sift : bool; [] true -> (a'=sift); endmodule")
    assert chosen_order(model, SIFTED) == ("sift",)


def test_nothing_of_the_search_for_an_order_is_kept(monkeypatch):
    made: list[weakref.ref[DiagramManager]] = []
    first = DiagramManager.__init__

    def noted(manager, **named):
        made.append(weakref.ref(manager))
        first(manager, **named)

    monkeypatch.setattr(DiagramManager, "__init__", noted)
    sift(bound(partners(4)), Options())
    gc.collect()
    assert len(made) == 1
    assert made[0]() is None


@pytest.mark.parametrize("engine", ["auto", "explicit", "sparse", "exact"])
def test_an_order_of_unknown_variables_is_refused_on_every_engine(engine):
    options = {"exact": True} if engine == "exact" else {"engine": engine}
    model = symcheck.loads(
        "dtmc module m x:[0..3]; [] x<3 -> (x'=x+1); [] x=3 -> true; endmodule",
        order=("sfit",),
        **options,
    )
    with pytest.raises(UsageError, match="names sfit"):
        model.check("P=? [ F x=3 ]")
