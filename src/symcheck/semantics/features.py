"""What symcheck offers for a class of models: one table, and the refusal of what is not in it.

A class of models is a type together with the kind of its probabilities. What is asked for a model
is checked by `require` before it is computed. A new class begins without any feature, and each is
added together with its tests. Timed automata have those that may be asked of the automaton; what is
checked in their place, with digital clocks, has those of its own class.
"""

from __future__ import annotations

from enum import Enum

from symcheck.errors import UnsupportedError
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import ModelType, Weights

__all__ = ["BY_DIGITAL_CLOCKS", "Feature", "class_name", "offers", "require", "require_type"]


class Feature(Enum):
    """What a class of models may offer. The value is its name in messages, in the plural."""

    # Representations of the states.
    ROWS = "explicit states"
    DIAGRAMS = "decision diagrams"
    RATIONALS = "exact computations"
    PARTS = "computations on a cluster"

    # Quantities.
    REACHABILITY = "probabilities of reaching states without a bound"
    BOUNDED_REACHABILITY = "probabilities of reaching states within a bound"
    LTL = "probabilities of LTL formulas"
    REWARD_BOUNDS = "probabilities with bounds on rewards"
    CONDITIONAL = "conditional probabilities"
    LONG_RUN = "long-run averages"
    REACH_REWARDS = "expected rewards until states are reached"
    TOTAL_REWARDS = "total rewards"
    CUMULATIVE_REWARDS = "rewards up to a bound"
    INSTANTANEOUS_REWARDS = "rewards at a time"
    DISCOUNTED_REWARDS = "discounted rewards"
    ENDED_REWARDS = "the rewards Fc and F0"
    MULTI_OBJECTIVE = "multi-objective queries"
    EQUILIBRIA = "equilibria"
    SOME_OR_ALL_PATHS = "the operators A and E"
    DISTRIBUTIONS = "distributions over states"
    QUANTILES = "quantiles"
    FAIRNESS = "fair strategies"

    # What explains, proves or estimates values.
    STRATEGIES = "strategies"
    COUNTEREXAMPLES = "counterexamples"
    CERTIFICATES = "certificates"
    SIMULATION = "estimates from random paths"
    STEPPING = "random paths"
    PAGES = "pages"
    COMPARISON = "comparisons with other model checkers"
    TRUNCATION = "explorations of a part of the states"

    # Transformations and files.
    BISIMULATION = "quotients by bisimulation"
    REDUCTION = "reductions of the text"
    SYMMETRY = "reductions by symmetry"
    EXPLICIT_FILES = "files with explicit states"
    JANI_FILES = "JANI files"


_ALL = frozenset(Feature)
_OF_GAMES = frozenset({Feature.ENDED_REWARDS, Feature.EQUILIBRIA})
_NONE: frozenset[Feature] = frozenset()
_OBSERVED = frozenset(
    {
        *(Feature.ROWS, Feature.RATIONALS),
        *(Feature.REACHABILITY, Feature.BOUNDED_REACHABILITY, Feature.REACH_REWARDS),
    }
)

_MARKOV_AUTOMATON = frozenset(
    {
        *(Feature.ROWS, Feature.DIAGRAMS, Feature.RATIONALS),
        *(Feature.REACHABILITY, Feature.BOUNDED_REACHABILITY, Feature.LTL, Feature.CONDITIONAL),
        *(Feature.REACH_REWARDS, Feature.TOTAL_REWARDS, Feature.CUMULATIVE_REWARDS),
        *(Feature.INSTANTANEOUS_REWARDS, Feature.REWARD_BOUNDS, Feature.LONG_RUN),
        *(Feature.MULTI_OBJECTIVE, Feature.SOME_OR_ALL_PATHS, Feature.SYMMETRY),
        *(Feature.EXPLICIT_FILES, Feature.STRATEGIES, Feature.STEPPING),
    }
)

_OF_TYPE: dict[ModelType, frozenset[Feature]] = {
    ModelType.DTMC: _ALL - _OF_GAMES,
    ModelType.CTMC: _ALL - _OF_GAMES,
    ModelType.MDP: _ALL - _OF_GAMES,
    ModelType.MA: _MARKOV_AUTOMATON,
    ModelType.POMDP: _OBSERVED | {Feature.STRATEGIES, Feature.STEPPING, Feature.EXPLICIT_FILES},
    ModelType.POPTA: _OBSERVED,
    ModelType.PTA: frozenset(
        {
            Feature.ROWS,
            Feature.DIAGRAMS,
            Feature.RATIONALS,
            Feature.REACHABILITY,
            Feature.BOUNDED_REACHABILITY,
            Feature.REACH_REWARDS,
            Feature.JANI_FILES,
        }
    ),
    ModelType.SMG: frozenset(
        {
            *(Feature.ROWS, Feature.DIAGRAMS, Feature.RATIONALS),
            *(Feature.REACHABILITY, Feature.BOUNDED_REACHABILITY, Feature.LTL),
            *(Feature.REACH_REWARDS, Feature.TOTAL_REWARDS, Feature.CUMULATIVE_REWARDS),
            *(Feature.INSTANTANEOUS_REWARDS, Feature.ENDED_REWARDS, Feature.STRATEGIES),
            Feature.STEPPING,
        }
    ),
    ModelType.CSG: frozenset(
        {
            *(Feature.ROWS, Feature.REACHABILITY, Feature.BOUNDED_REACHABILITY),
            *(Feature.REACH_REWARDS, Feature.CUMULATIVE_REWARDS, Feature.INSTANTANEOUS_REWARDS),
            Feature.EQUILIBRIA,
        }
    ),
    ModelType.TPTG: frozenset(
        {
            *(Feature.ROWS, Feature.DIAGRAMS, Feature.RATIONALS, Feature.REACHABILITY),
            *(Feature.BOUNDED_REACHABILITY, Feature.REACH_REWARDS),
        }
    ),
}
"""Per type what it offers; nothing where it has no row."""

_OF_WEIGHTS: dict[Weights, frozenset[Feature]] = {
    Weights.NUMBERS: _ALL,
    Weights.INTERVALS: frozenset(
        {
            *(Feature.ROWS, Feature.DIAGRAMS, Feature.RATIONALS),
            *(Feature.REACHABILITY, Feature.BOUNDED_REACHABILITY, Feature.LTL),
            *(Feature.REACH_REWARDS, Feature.CUMULATIVE_REWARDS, Feature.INSTANTANEOUS_REWARDS),
            *(Feature.LONG_RUN, Feature.SOME_OR_ALL_PATHS, Feature.STRATEGIES),
            Feature.EXPLICIT_FILES,
        }
    ),
    Weights.PARAMETERS: frozenset(
        {
            Feature.ROWS,
            Feature.RATIONALS,
            Feature.REACHABILITY,
            Feature.BOUNDED_REACHABILITY,
            Feature.LTL,
            Feature.LONG_RUN,
            Feature.REACH_REWARDS,
            Feature.TOTAL_REWARDS,
            Feature.CUMULATIVE_REWARDS,
            Feature.INSTANTANEOUS_REWARDS,
            Feature.CONDITIONAL,
            Feature.STRATEGIES,
        }
    ),
}
"""Per kind of probabilities what can be computed with it; nothing where it has no row."""

_EXCEPT: dict[tuple[ModelType, Weights], frozenset[Feature]] = {
    (ModelType.CTMC, Weights.PARAMETERS): frozenset(  # exponential functions are not rational
        {
            Feature.BOUNDED_REACHABILITY,
            Feature.CUMULATIVE_REWARDS,
            Feature.INSTANTANEOUS_REWARDS,
        }
    ),
    (ModelType.MDP, Weights.PARAMETERS): frozenset({Feature.LONG_RUN}),
}
"""What both the type and the weights offer, but not together."""

_NOT_TIMED = frozenset({Feature.FAIRNESS, Feature.SIMULATION, Feature.DISTRIBUTIONS})
"""What the process that is made of a timed automaton has, but not as a value of the automaton."""
BY_DIGITAL_CLOCKS = (
    "-ptamethod digital has them, where constraints are closed and none compares two clocks"
)
_OF_STATES = frozenset({Feature.STRATEGIES, Feature.COUNTEREXAMPLES, Feature.CERTIFICATES})
"""What is told by states: no process has it whose states are not those of the automaton."""

_COUNT_STEPS = frozenset({Feature.DISTRIBUTIONS, Feature.PAGES})
"""What counts steps, and is not offered where these are delays; see `semantics.timed.delays`."""

_WITH_WEIGHTS = {
    Weights.NUMBERS: "",
    Weights.INTERVALS: " with intervals of probabilities",
    Weights.PARAMETERS: " with parameters",
}


def class_name(model: BoundModel) -> str:
    """The class of a model in messages, such as 'Markov automata'."""
    if model.clocks is not None:
        return model.clocks.automaton.type.called
    of_automaton = "" if model.delays is None else " of timed automata"
    return model.type.called + of_automaton + _WITH_WEIGHTS[model.weights]


def require_type(kind: ModelType) -> None:
    """Refuse a type of models for which nothing is offered. Raises UnsupportedError."""
    if not _OF_TYPE.get(kind):
        offered = ", ".join(k.value for k in _OF_TYPE)
        raise UnsupportedError(
            f"models of type {kind.value} ({kind.called}) are not supported",
            hint=f"those of type {offered} are",
        )


def _is_lost_by_zones(model: BoundModel, feature: Feature) -> bool:
    """Whether a feature tells of states, and those of the model are no states of its automaton."""
    return feature in _OF_STATES and model.clocks is not None and not model.clocks.lists_states


def offers(model: BoundModel, feature: Feature) -> bool:
    """Whether a feature is offered for the class of a model.

    Examples:
        >>> import symcheck
        >>> offers(symcheck.load("models/die/die.pm").bound, Feature.LTL)
        True
    """
    if model.weights is not Weights.NUMBERS and model.type.has_own_syntax:
        return False  # the features of types and of weights are tested apart, and not together
    if _is_lost_by_zones(model, feature) or (model.clocks is not None and feature in _NOT_TIMED):
        return False
    if model.delays is not None and feature in _COUNT_STEPS:
        return False
    of_type = _OF_TYPE.get(model.type, _NONE)
    if feature in _EXCEPT.get((model.type, model.weights), _NONE):
        return False
    return feature in of_type and feature in _OF_WEIGHTS.get(model.weights, _NONE)


def require(model: BoundModel, *features: Feature) -> None:
    """Refuse what is not offered for the class of a model.

    Args:
        model: the bound model.
        features: what is asked for.

    Raises:
        UnsupportedError: one of the features is not offered.
    """
    for feature in features:
        if not offers(model, feature):
            by_zones = _is_lost_by_zones(model, feature)
            raise UnsupportedError(
                f"{feature.value} are not available for {class_name(model)}"
                + (" by zones" if by_zones else ""),
                hint=BY_DIGITAL_CLOCKS if by_zones else None,
            )
