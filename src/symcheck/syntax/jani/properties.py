"""Properties of JANI as properties of the PRISM language."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal as Choice
from typing import cast

from symcheck.syntax.ast import (
    Bound,
    CumulativeReward,
    Eventually,
    Expression,
    Filter,
    FilterOperator,
    Globally,
    InstantaneousReward,
    LabelReference,
    Name,
    Next,
    PathBound,
    PathQuantifier,
    ProbabilityOperator,
    Release,
    RewardBound,
    RewardBounds,
    RewardOperator,
    RewardQuery,
    SteadyState,
    SteadyStateReward,
    TimeBound,
    TotalReward,
    Type,
    Until,
    WeakUntil,
)
from symcheck.syntax.declarations import Label, Property
from symcheck.syntax.jani.expressions import (
    ExpressionReader,
    is_boolean,
    is_literal,
    simplified,
)
from symcheck.syntax.jani.json_tree import Json
from symcheck.syntax.jani.network import Network
from symcheck.syntax.jani.rewards import RewardRequest, has_branching_rewards, is_additive
from symcheck.syntax.operators import OPERATOR_IN_JANI, Operator
from symcheck.syntax.traversal import names, nodes, substitute

__all__ = ["FILTERS", "PropertyReader", "default_requests", "state_labels"]

FILTERS: dict[str, FilterOperator] = {
    "min": "min",
    "max": "max",
    "sum": "sum",
    "avg": "avg",
    "count": "count",
    "∀": "forall",
    "∃": "exists",
    "argmin": "argmin",
    "argmax": "argmax",
    "values": "print",
}
_MEASURES = ("Pmin", "Pmax", "Emin", "Emax", "Smin", "Smax")
_UNARY_TEMPORAL = {"F": Eventually, "G": Globally, "X": Next}
_BINARY_TEMPORAL = {"U": Until, "W": WeakUntil, "R": Release}
_STATES = {"initial": "init", "deadlock": "deadlock"}


def state_labels(network: Network) -> tuple[Label, ...]:
    """A label for each transient variable of type bool that has values in states."""
    return tuple(
        Label(_label(t.name), simplified(network.in_states(Name(t.name))))
        for t in network.transients.values()
        if t.type is Type.BOOL and t.name not in network.edges_only
    )


def _label(name: str) -> str:
    return f"{name}_" if name in ("init", "deadlock") else name


def default_requests(network: Network) -> dict[str, RewardRequest]:
    """A reward structure for each transient variable that is a number, as PRISM reads rewards."""
    return {
        t.name: RewardRequest(Name(t.name), states=True, exits=False, steps=True)
        for t in network.transients.values()
        if t.type is not Type.BOOL
    }


def _has_measure(expression: Expression) -> bool:
    """Whether a value is to be computed for it."""
    measures = (ProbabilityOperator, RewardOperator, SteadyState)
    return any(isinstance(node, measures) for node in nodes(expression))


@dataclass(frozen=True)
class PropertyReader(ExpressionReader):
    """Reads properties, and notes the reward structures that they need.

    Attributes:
        network: the model.
        requests: the reward structures by name; grows.
    """

    network: Network = field(kw_only=True)
    requests: dict[str, RewardRequest] = field(kw_only=True)

    def property(self, node: Json) -> Property:
        """A property of the model. Raises SyntaxFault, UnsupportedError."""
        comment = node.get("comment")
        lines = tuple(comment.text.splitlines()) if comment is not None else ()
        formula = self.read(node["expression"])
        self._check_read_in_states(node["expression"], formula)
        values: dict[str, Expression] = {}
        for name, transient in self.network.transients.items():
            label = LabelReference(_label(name))
            is_condition = transient.type is Type.BOOL
            values[name] = label if is_condition else self.network.in_states(Name(name))
        return Property(node["name"].text, substitute(formula, values), lines)

    def _check_read_in_states(self, node: Json, expression: Expression) -> None:
        """Refuse a value in states of a variable that has its values on edges."""
        for part in nodes(expression):
            if isinstance(part, Name) and part.name in self.network.edges_only:
                place = node if not part.span.source.text else replace(node, span=part.span)
                identifier = self.network.transients[part.name].identifier
                raise place.unsupported(
                    f"'{identifier}' is read in states, and edges assign it: no location gives it "
                    "a value",
                    '"accumulate": ["steps"] and the long-run averages Smin and Smax say what '
                    "edges earn",
                )

    def operation(self, node: Json, operator: str) -> Expression:
        """The formula of an object with an "op". Raises SyntaxFault, UnsupportedError."""
        if (comparison := OPERATOR_IN_JANI.get(operator)) and comparison.is_comparison:
            for side, other in (("left", "right"), ("right", "left")):
                if _operator(node[side]) in _MEASURES:
                    sign, threshold = comparison, self.read(node[other])
                    if sign in (Operator.EQ, Operator.NE) or _has_measure(threshold):
                        break  # the two values are compared
                    sign = sign if side == "left" else sign.mirrored
                    bound = Bound(sign, threshold, span=node.span)
                    return self._measure(node[side], bound)
        if operator in _MEASURES:
            return self._measure(node, None)
        if operator in _UNARY_TEMPORAL:
            unary = _UNARY_TEMPORAL[operator]
            inner, bounds = self.read(node["exp"]), self._bounds(node)
            return cast(Expression, unary(inner, bounds, span=node.span))
        if operator in _BINARY_TEMPORAL:
            binary = _BINARY_TEMPORAL[operator]
            left, right = self.read(node["left"]), self.read(node["right"])
            return cast(Expression, binary(left, right, self._bounds(node), span=node.span))
        match operator:
            case "∀" | "∃":
                quantifier: Choice["A", "E"] = "A" if operator == "∀" else "E"
                return PathQuantifier(quantifier, self.read(node["exp"]), span=node.span)
            case "P" | "E" | "S":
                raise node["op"].fault(
                    f"'{operator}' needs a direction",
                    f"the operators are {operator}min and "
                    f"{operator}max; they are the same in chains",
                )
            case "filter":
                return self._filter(node)
            case "initial" | "deadlock":
                return LabelReference(_STATES[operator], span=node.span)
            case "timelock":
                raise node.unsupported("models have no timelocks: they are DTMCs, CTMCs and MDPs")
            case _:
                return super().operation(node, operator)

    def _filter(self, node: Json) -> Expression:
        function = node["fun"]
        if function.text not in FILTERS:
            raise function.fault(
                f"'{function.text}' is no filter", f"filters are {' '.join(FILTERS)}"
            )
        values, states = self.read(node["values"]), self.read(node["states"])
        if function.text == "values" and states == LabelReference("init"):
            return values
        return Filter(FILTERS[function.text], values, states, span=node.span)

    # ----------------------------------------------------------------------------------- measures

    def _measure(self, node: Json, bound: Bound | None) -> Expression:
        operator = node["op"].text
        direction = None
        if self.network.type.has_choices:
            direction = operator[1:]
        match operator[0]:
            case "P":
                path = self.read(node["exp"])
                return ProbabilityOperator(direction, bound, path, span=node.span)
            case "S":
                return self._long_run(node, direction, bound)
            case _:
                return self._expected(node, direction, bound)

    def _long_run(self, node: Json, direction: str | None, bound: Bound | None) -> Expression:
        value, kinds = self.read(node["exp"]), node.get("accumulate")
        if is_boolean(value, self.network.types):
            return SteadyState(direction, bound, value, span=node.span)
        if kinds is None:
            structure = self._long_run_structure(node, value)
        else:
            structure = self._accumulated(node, value, kinds)
        return RewardOperator(direction, bound, structure, SteadyStateReward(), span=node.span)

    def _long_run_structure(self, node: Json, value: Expression) -> str:
        """The structure of a long-run average that does not say what accumulates.

        States earn the value that it has in them, and edges what they assign: so the published
        models mean it.
        """
        network = self.network
        assigned = names(value) & network.assigned & network.transients.keys()
        for name in sorted(assigned):
            if not is_literal(network.transients[name].initial, 0):
                raise node["exp"].unsupported(
                    f"edges assign '{network.transients[name].identifier}', whose initial value is "
                    "not 0: what accumulates is not plain",
                    'give "accumulate": ["time"], ["steps"], or both',
                )
        return self._structure(
            node, value, states=True, exits=False, steps=bool(assigned), assigned_only=True
        )

    def _expected(self, node: Json, direction: str | None, bound: Bound | None) -> Expression:
        value, kinds = self.read(node["exp"]), node.get("accumulate")
        if node.get("reward-instants") is not None:
            raise node["reward-instants"].unsupported(
                "expected values at the instant of a reward are not supported",
                "step-instant and time-instant are",
            )
        instant, reach = self._instant(node), node.get("reach")
        query: RewardQuery
        if kinds is None:
            if instant is None or reach is not None:
                raise node.unsupported(
                    'an expected value needs "accumulate", or an instant at which it is read',
                    "Smin and Smax give the long-run average",
                )
            self._check_read_in_states(node["exp"], value)
            structure = self._structure(node, value, states=True, exits=False, steps=False)
            query = InstantaneousReward(instant)
        else:
            structure = self._accumulated(node, value, kinds)
            if reach is not None:
                if instant is not None:
                    raise node.unsupported('"reach" together with an instant is not supported')
                query = Eventually(self.read(reach))
            elif instant is not None:
                query = CumulativeReward(TimeBound(upper=instant))
            else:
                query = TotalReward()
        return RewardOperator(direction, bound, structure, query, span=node.span)

    def _instant(self, node: Json) -> Expression | None:
        is_timed = self.network.is_timed
        key, other = ("time-instant", "step-instant")[:: 1 if is_timed else -1]
        wrong = node.get(other)
        if wrong is not None:
            raise wrong.unsupported(
                f'"{other}" is not supported for a {self.network.type.name}: "{key}" is'
            )
        bound = node.get(key)
        return None if bound is None else self.read(bound)

    def _accumulated(self, node: Json, value: Expression, kinds: Json) -> str:
        """The structure of a value that is accumulated."""
        kinds_of_node = {kind.text for kind in kinds.items}
        for kind in kinds.items:
            if kind.text not in ("steps", "time", "exit"):
                raise kind.fault("rewards accumulate over steps, time or exit")
        steps = "steps" in kinds_of_node
        if self.network.is_timed:
            return self._structure(
                node,
                value,
                states="time" in kinds_of_node,
                exits="exit" in kinds_of_node,
                steps=steps,
            )
        if kinds_of_node == {"time"}:
            raise kinds.unsupported(
                f"no time passes in the states of a {self.network.type.name}",
                "steps and exit count its steps",
            )
        # No time passes in the states of a DTMC or MDP; each step leaves a state.
        return self._structure(
            node, value, states="exit" in kinds_of_node, exits=False, steps=steps
        )

    def _structure(
        self,
        node: Json,
        value: Expression,
        *,
        states: bool,
        exits: bool,
        steps: bool,
        assigned_only: bool = False,
    ) -> str:
        """The name of a reward structure."""
        network = self.network
        transients = set(network.transients)
        read = names(value)
        if steps and read & set(network.variables):
            raise node["exp"].unsupported(
                "what accumulates on steps cannot depend on a variable of states",
                "assign it to a transient variable on the edges",
            )
        if steps and not is_additive(value, transients):
            raise node["exp"].unsupported(
                "what accumulates on steps should be a sum of transient variables"
            )
        # A single variable that is 0 where nothing is assigned earns the same either way.
        assigned_only = assigned_only and steps and not isinstance(value, Name)
        request = self._effective(RewardRequest(value, states, exits, steps, assigned_only))
        for name, other in self.requests.items():
            if self._effective(other) == request:
                return name
        label = network.unique.take(
            "_".join(
                [
                    value.name if isinstance(value, Name) else "reward",
                    *(k for k, on in (("state", states), ("exit", exits), ("step", steps)) if on),
                ]
            )
        )
        self.requests[label] = request
        return label

    def _effective(self, request: RewardRequest) -> RewardRequest:
        """The request without kinds of rewards that are 0 in this model."""
        transient = self.network.transients.get(
            request.expression.name if isinstance(request.expression, Name) else ""
        )
        if transient is None or not is_literal(transient.initial, 0):
            return request
        in_states = transient.name in self.network.valued_in_states
        return replace(
            request,
            states=request.states and in_states,
            exits=request.exits and in_states,
            steps=request.steps and transient.name in self.network.assigned,
        )

    # ------------------------------------------------------------------------------------- bounds

    def _bounds(self, node: Json) -> PathBound | None:
        is_timed = self.network.is_timed
        result: list[TimeBound | RewardBound] = []
        steps, time = node.get("step-bounds"), node.get("time-bounds")
        if time is not None:
            if not is_timed:
                raise time.unsupported(f"{self.network.type.name}s have no time: use step-bounds")
            result.append(TimeBound(*self._interval(time), span=time.span))
        if steps is not None:
            limits = self._interval(steps)
            result.append(
                RewardBound(*limits, span=steps.span)
                if is_timed
                else TimeBound(*limits, span=steps.span)
            )
        for part in node.each("reward-bounds"):
            value = self.read(part["exp"])
            structure = self._accumulated(part, value, part["accumulate"])
            if has_branching_rewards(self.requests[structure], self.network):
                raise part.unsupported(
                    "a bound on rewards that depend on the destination of an edge is not supported"
                )
            bounds = part["bounds"]
            result.append(RewardBound(*self._interval(bounds), structure, span=bounds.span))
        if not result:
            return None
        if len(result) == 1 and isinstance(result[0], TimeBound):
            return result[0]
        parts = tuple(
            RewardBound(b.lower, b.lower_strict, b.upper, b.upper_strict, span=b.span)
            if isinstance(b, TimeBound)
            else b
            for b in result
        )
        if is_timed and time is not None:
            raise node.unsupported("a bound on time together with other bounds is not supported")
        return parts[0] if len(parts) == 1 else RewardBounds(parts)

    def _interval(self, node: Json) -> tuple[Expression | None, bool, Expression | None, bool]:
        lower, upper = node.get("lower"), node.get("upper")
        if lower is None and upper is None:
            raise node.fault('a bound needs "lower" or "upper"')
        return (
            None if lower is None else self.read(lower),
            node.flag("lower-exclusive"),
            None if upper is None else self.read(upper),
            node.flag("upper-exclusive"),
        )


def _operator(node: Json) -> str | None:
    """The operator of an expression."""
    if not isinstance(node.value, Mapping):
        return None
    operator = node.get("op")
    return None if operator is None else operator.text
