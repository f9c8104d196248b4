"""The automatic choice of an engine, and materialized engines against the explicit engine."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from types import SimpleNamespace

import numpy as np
import pytest

from symcheck.engines import selection, tuning
from symcheck.engines.registry import build
from symcheck.engines.symbolic.forms import SparseEngine
from symcheck.engines.symbolic.materialized import MaterializedEngine, materialize
from symcheck.errors import MemoryLimitError, TimeLimitError
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind
from symcheck.symbolic.reachability import search as reaching
from symcheck.syntax.parse import parse_model

COUNTER = """
dtmc
module counter
  x : [0..99]; y : [0..99];
  [] true -> 0.5 : (x'=x<99 ? x+1 : 0) + 0.5 : (y'=y<99 ? y+1 : 0);
endmodule
rewards "r" x>50 : y; [] x=3 : 2; endrewards
"""
CHOICES = """
mdp
module m
  x : [2..9] init 2; b : bool;
  [a] x<9 -> 0.5 : (x'=x+1) + 0.5 : (b'=!b);
  [c] x<9 & b -> (x'=9);
  [] x=5 -> (x'=2);
endmodule
rewards "r" [a] true : x; b : 1; endrewards
"""
UNBOUNDED = "dtmc module m x : int; [] x<70000 -> (x'=x+1); [] x>=70000 -> true; endmodule"


def chosen(text, monkeypatch, **settings):
    for name, value in settings.items():
        monkeypatch.setattr(tuning if name.isupper() else selection, name, value)
    choices = []
    engine = selection.choose(
        bind(parse_model(text)),
        Options(),
        lambda news: choices.append(news) if isinstance(news, selection.EngineChoice) else None,
    )
    return engine, choices[-1]


def test_a_small_model_is_searched(monkeypatch):
    engine, choice = chosen(COUNTER, monkeypatch)
    assert (engine.name, choice.engine, engine.states) == ("explicit", "explicit", 10_000)


def test_a_model_that_diagrams_compress_is_built_by_them(monkeypatch):
    engine, choice = chosen(COUNTER, monkeypatch, SMALL_MODEL_STATES=100, SPARSE_MODEL_STATES=100)
    assert isinstance(engine, SparseEngine)
    assert (engine.states, choice.engine) == (10_000, "sparse")


def test_a_large_regular_model_is_recognised_by_the_first_diagrams(monkeypatch):
    small = {"SMALL_MODEL_STATES": 100, "SPARSE_MODEL_STATES": 100}
    engine, choice = chosen(COUNTER, monkeypatch, SELECTION_TURNS=(), **small)
    assert isinstance(engine, SparseEngine)
    assert "nodes holds 10,000 states" in choice.reason


def test_a_model_in_which_the_first_diagrams_find_few_states_is_searched(monkeypatch):
    limits = []
    explore = selection._explore_sparse_model

    def explore_later(exploration, limit):
        limits.append(limit)
        return len(limits) > 1 and explore(exploration, limit)

    engine, choice = chosen(
        COUNTER,
        monkeypatch,
        SMALL_MODEL_STATES=100,
        SELECTION_TURNS=(),
        _explore_sparse_model=explore_later,
    )
    assert (engine.name, choice.reason) == ("explicit", "the model has only 10,000 states")
    assert limits == [tuning.FIRST_EXPLORATION_TRANSITIONS, tuning.SPARSE_MODEL_TRANSITIONS]


def test_an_mdp_that_diagrams_compress_is_written_out(monkeypatch):
    engine, choice = chosen(
        CHOICES, monkeypatch, SMALL_MODEL_STATES=1, SPARSE_MODEL_STATES=1, MAX_NODES_PER_STATE=100.0
    )
    assert isinstance(engine, MaterializedEngine)
    assert (engine.states, choice.engine) == (16, "sparse")
    engine, _ = chosen(
        CHOICES,
        monkeypatch,
        SMALL_MODEL_STATES=1,
        SPARSE_MODEL_STATES=1,
        MAX_NODES_PER_STATE=100.0,
        MATERIALIZED_STATES=0,
    )
    assert isinstance(engine, SparseEngine)


def test_rows_that_do_not_fit_stay_blocks(monkeypatch):
    engine, choice = chosen(
        COUNTER,
        monkeypatch,
        SMALL_MODEL_STATES=100,
        SPARSE_MODEL_STATES=100,
        ROWS_MEMORY_SHARE=0.0,
        MATERIALIZED_STATES=0,
    )
    assert engine.name == choice.engine == "hybrid"


def test_a_model_that_does_not_compress_goes_on_being_searched(monkeypatch):
    engine, choice = chosen(
        COUNTER,
        monkeypatch,
        SMALL_MODEL_STATES=100,
        SPARSE_MODEL_STATES=100,
        MAX_NODES_PER_STATE=0.0,
    )
    assert engine.name == "explicit"
    assert "compress" in choice.reason


def test_diagrams_that_take_too_long_give_way(monkeypatch):
    def too_long(*_):
        raise selection._SearchInterrupted("time", 7)

    engine, choice = chosen(
        COUNTER,
        monkeypatch,
        SMALL_MODEL_STATES=100,
        SPARSE_MODEL_STATES=100,
        _explore_symbolically=too_long,
    )
    assert engine.name == "explicit"
    assert "did not finish" in choice.reason


def test_a_search_is_not_gone_on_with_where_diagrams_had_found_more_than_it_would_list(monkeypatch):
    def unfinished_at_first(model, options, lookups, reach=selection._explore_symbolically):
        if lookups is not None:
            raise selection._SearchInterrupted("time", 2_000)
        return reach(model, options, lookups)

    turns = ((1_000_000, 1000), (2_000_000, 1500))
    engine, choice = chosen(
        COUNTER,
        monkeypatch,
        SMALL_MODEL_STATES=100,
        SPARSE_MODEL_STATES=100,
        _explore_symbolically=unfinished_at_first,
        SELECTION_TURNS=turns,
    )
    assert isinstance(engine, SparseEngine)
    assert "more than 2,000 states" in choice.reason


def test_diagrams_that_miss_their_turn_say_what_they_had_found(monkeypatch):
    def stopped(symbolic, schedule, *, counting, search=reaching.search):
        yield from islice(search(symbolic, "frontier", counting=counting), 3)
        raise TimeLimitError("time")

    monkeypatch.setattr(reaching, "search", stopped)
    with pytest.raises(selection._SearchInterrupted) as caught:
        selection._explore_symbolically(bind(parse_model(COUNTER), {}), Options(), 10**8)
    assert caught.value.found_states == 1 + 2 + 3  # states at distance 0, 1 and 2


def test_arrays_beyond_the_memory_end_with_advice(monkeypatch):
    def too_large(*_):
        np.empty(2**62, dtype=np.uint8)

    monkeypatch.setattr(selection, "_explicit_engine", too_large)  # diagrams are tried next
    monkeypatch.setattr(selection, "_symbolic_engine", too_large)
    with pytest.raises(MemoryLimitError, match="hint: the engines -h and -m"):
        build(bind(parse_model(COUNTER), {}), Options())


def test_states_beyond_the_memory_limit_become_a_diagram():
    """500 500 states take more than 8 MB, and their diagram less."""
    text = "dtmc module m x:[0..999]; y:[0..999]; [] x<999 -> (x'=x+1); [] y<x -> (y'=y+1); [] x=999 & y=x -> true; endmodule"
    options = Options(max_memory=8 << 20)
    chosen: list[object] = []
    engine = build(bind(parse_model(text), {}), options, chosen.append)
    assert engine.states == 500_500
    (choice,) = [c for c in chosen if isinstance(c, selection.EngineChoice)]
    assert "exceed the memory limit" in choice.reason
    with pytest.raises(MemoryLimitError, match="of 8 MB is reached"):
        build(bind(parse_model(text), {}), replace(options, engine="explicit"))


def test_integers_without_bounds_leave_the_memory_limit_an_error():
    text = "dtmc module m x : int init 0; [] true -> 0.5 : (x'=x+1) + 0.5 : (x'=x-1); endmodule"
    with pytest.raises(MemoryLimitError, match="explicit exploration"):
        build(bind(parse_model(text), {}), Options(max_memory=8 << 20))


def test_rounding_of_very_many_bits_is_not_tried_on_diagrams_at_first(monkeypatch):
    wide = " ".join(f"x{i} : [0..255];" for i in range(5))
    total = "+".join(f"0.{i + 1}*x{i}" for i in range(5))
    text = f"dtmc module m {wide} [] true -> 0.5 : (x0'=mod(ceil({total})+1, 256)) + 0.5 : (x1'=mod(x0+x1, 256)); endmodule"
    engine, choice = chosen(
        text,
        monkeypatch,
        SMALL_MODEL_STATES=100,
        SPARSE_MODEL_STATES=100,
        _explore_symbolically=None,
    )
    assert engine.name == "explicit"
    assert choice.reason == "updates read too many variables for diagrams"


@pytest.mark.parametrize(
    "missed", [TimeLimitError("while encoding"), selection._SearchInterrupted("while searching", 7)]
)
def test_where_diagrams_found_less_in_their_long_turn_the_search_goes_on(monkeypatch, missed):
    def too_long(*_):
        raise missed

    engine, choice = chosen(
        COUNTER,
        monkeypatch,
        SMALL_MODEL_STATES=100,
        SPARSE_MODEL_STATES=100,
        _explore_symbolically=too_long,
        SELECTION_TURNS=((1_000_000, 1000), (10_000_000, 2000)),
    )
    assert engine.name == "explicit"
    assert choice.reason == "diagrams did not finish within 10 million look-ups"


def test_too_many_states_for_a_search_go_back_to_diagrams(monkeypatch):
    def too_long_at_first(model, options, lookups, reach=selection._explore_symbolically):
        if lookups is not None:
            raise selection._SearchInterrupted("time", 0)
        return reach(model, options, lookups)

    engine, choice = chosen(
        COUNTER,
        monkeypatch,
        SMALL_MODEL_STATES=100,
        SPARSE_MODEL_STATES=100,
        _explore_symbolically=too_long_at_first,
        SELECTION_TURNS=((1_000_000, 1000),),
    )
    assert isinstance(engine, SparseEngine)
    assert "more than 1,000 states" in choice.reason


def test_where_diagrams_are_no_help_the_search_goes_on_as_far_as_memory_reaches(monkeypatch):
    settings = {
        "SMALL_MODEL_STATES": 100,
        "SPARSE_MODEL_STATES": 100,
        "MAX_NODES_PER_STATE": 0.0,
        "SELECTION_TURNS": ((1_000_000, 1000),),
    }
    engine, choice = chosen(COUNTER, monkeypatch, **settings)
    assert engine.name == "explicit"
    assert "compress nothing" in choice.reason
    engine, _ = chosen(COUNTER, monkeypatch, **settings, EXPLORATION_MEMORY_SHARE=0.0)
    assert isinstance(engine, SparseEngine)


def test_integers_without_bounds_are_searched(monkeypatch):
    engine, choice = chosen(UNBOUNDED, monkeypatch, SMALL_MODEL_STATES=100, SPARSE_MODEL_STATES=100)
    assert engine.states == 70_001
    assert "without bounds" in choice.reason


def test_too_many_possible_initial_states_are_left_to_diagrams(monkeypatch):
    variables = " ".join(f"x{i} : [0..9];" for i in range(12))
    text = f"dtmc module m {variables} [] true -> (x0'=0); endmodule init x1=3 endinit"
    engine, choice = chosen(text, monkeypatch)
    assert engine.initial.count == engine.states == 10**11
    assert "initial states" in choice.reason


@pytest.mark.parametrize("text", [COUNTER, CHOICES])
def test_what_is_written_out_is_what_a_search_finds(text):
    model = bind(parse_model(text))
    ours = materialize(build(model, Options(engine="sparse")))
    theirs = build(model, Options(engine="explicit"))
    assert list(ours.explored.states) == list(theirs.explored.states)
    assert list(ours.valuations(ours.all, 3)) == list(theirs.valuations(theirs.all, 3))
    # The choices of a state may stand in another order: compare them as sets.
    assert rows(ours) == rows(theirs)
    assert np.array_equal(ours.explored.state_rewards[0], theirs.explored.state_rewards[0])


def rows(engine):
    explored, m = engine.explored, engine.matrix
    groups = range(m.rows + 1) if m.groups is None else m.groups.tolist()
    found = []
    for state in range(m.states):
        choices = []
        for r in range(groups[state], groups[state + 1]):
            part = slice(m.indptr[r], m.indptr[r + 1])
            entries = sorted(zip(m.indices[part].tolist(), m.data[part].tolist(), strict=True))
            choices.append(
                (int(explored.choice_actions[r]), float(explored.choice_rewards[0][r]), entries)
            )
        found.append(sorted(choices))
    return found


@pytest.mark.parametrize("complete", [False, True])
def test_few_states_with_many_transitions_are_not_searched_at_length(complete):
    class Search:
        progress = SimpleNamespace(transitions=tuning.SPARSE_MODEL_TRANSITIONS + 1)

        def run(self, budget, observer):
            assert budget == tuning.SPARSE_MODEL_STATES
            observer(self.progress)
            raise AssertionError("the search went on")

    search = Search()
    search.complete = complete
    assert selection._explore_sparse_model(search, tuning.SPARSE_MODEL_TRANSITIONS) is complete
