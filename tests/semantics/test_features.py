"""What is not offered for a class of models is refused by name, wherever it is asked for."""

from __future__ import annotations

from dataclasses import replace

import pytest

import symcheck
from symcheck.errors import UnsupportedError
from symcheck.semantics.features import Feature, offers, require, require_type
from symcheck.syntax.ast import ModelType, Weights

CHAIN = "dtmc module m x : [0..1]; [] x=0 -> 0.5:(x'=1) + 0.5:true; endmodule"


def test_every_type_offers_something_or_is_refused() -> None:
    bound = symcheck.loads(CHAIN).bound
    for kind in ModelType:
        if any(offers(replace(bound, type=kind), feature) for feature in Feature):
            require_type(kind)
        else:
            with pytest.raises(UnsupportedError, match=rf"models of type {kind.value} \("):
                require_type(kind)


def test_chains_and_decision_processes_offer_everything_but_what_is_about_players() -> None:
    bound = symcheck.loads(CHAIN).bound
    for name in ("dtmc", "ctmc", "mdp"):
        require(
            replace(bound, type=ModelType(name)),
            *(f for f in Feature if f not in (Feature.ENDED_REWARDS, Feature.EQUILIBRIA)),
        )


def test_what_a_kind_of_probabilities_does_not_offer_is_refused_by_name() -> None:
    bound = replace(symcheck.loads(CHAIN).bound, weights=Weights.PARAMETERS)
    message = "are not available for discrete-time Markov chains with parameters"
    with pytest.raises(UnsupportedError, match=message):
        require(bound, Feature.BISIMULATION)
