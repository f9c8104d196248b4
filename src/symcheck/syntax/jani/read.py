"""Reads a JANI file: its model as a program, and its properties."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from symcheck.errors import Source, SymcheckError, SyntaxFault, UnsupportedError
from symcheck.syntax.ast import Literal, Type
from symcheck.syntax.declarations import Program, PropertiesFile, Property
from symcheck.syntax.jani.compose import compose
from symcheck.syntax.jani.json_tree import parse_json
from symcheck.syntax.jani.network import Network, read_network
from symcheck.syntax.jani.properties import PropertyReader, default_requests, state_labels
from symcheck.syntax.jani.rewards import RewardRequest

__all__ = ["JaniFile", "read_jani"]

_FRAMES_PER_LEVEL = 12
_NOTHING = Literal(0, Type.INT)


@dataclass(frozen=True)
class JaniFile:
    """A model and its properties.

    Attributes:
        properties: in the order of the file, with the number 0 in the place of each fault.
        faults: the properties that cannot be read, by index.
    """

    program: Program
    properties: PropertiesFile
    faults: Mapping[int, SymcheckError]


@lru_cache(maxsize=1)
def read_jani(text: str, name: str = "<model>") -> JaniFile:
    """Read a model and its properties in the JANI format, version 1.

    Locations become a variable of their automaton, transient variables become labels (type bool)
    and reward structures (numbers).

    Args:
        text: the file.
        name: what diagnostics call it.

    Raises:
        SyntaxFault: the text is no JSON, or no model.
        UnsupportedError: the model has parts that DTMCs, CTMCs and MDPs over bounded variables do
            not have, such as clocks and arrays.

    Source: C. E. Budde, C. Dehnert, E. M. Hahn, A. Hartmanns, S. Junges, A. Turrini: JANI:
    quantitative model and tool interaction. TACAS 2017; https://jani-spec.org.
    """
    levels = text.count("{") // 2  # nested expressions are read by recursion
    needed = 1000 + _FRAMES_PER_LEVEL * min(levels, 3000)
    sys.setrecursionlimit(max(sys.getrecursionlimit(), needed))
    root = parse_json(Source(name, text))
    network = read_network(root)
    requests = default_requests(network)
    reader = PropertyReader(
        network.names,
        network.functions,
        arrays=network.arrays,
        network=network,
        requests=requests,
    )
    properties: list[Property] = []
    faults: dict[int, SymcheckError] = {}
    for i, node in enumerate(root.each("properties")):
        try:
            properties.append(reader.property(node))
        except (SyntaxFault, UnsupportedError) as fault:
            faults[i] = fault
            named = node.members.get("name")
            text_of = named.value if named is not None and isinstance(named.value, str) else None
            properties.append(Property(text_of, _NOTHING, span=node.span))
    file = PropertiesFile(properties=tuple(properties))
    return JaniFile(_program(network, requests), file, faults)


def _program(network: Network, requests: Mapping[str, RewardRequest]) -> Program:
    composed = compose(network, requests)
    return Program(
        network.type,
        network.constants,
        (),
        state_labels(network),
        composed.globals,
        composed.modules,
        composed.rewards,
        composed.initial,
        composed.system,
    )
