"""Tuning constants of the symbolic model construction. Work is counted in nodes and cache look-ups,
so that a run makes the same choices on every machine; two million look-ups in CUDD's cache take
about a second.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["EncodingLimits", "SiftLimits"]


@dataclass(frozen=True, slots=True)
class EncodingLimits:
    """Where one way of translating an expression ends and the next begins.

    Attributes:
        table_bits: row bits up to which an expression is tabulated at once.
        wide_table_bits: row bits up to which it is tabulated where it cannot be composed of
            diagrams.
        max_nodes: nodes of a composed diagram above which its expression counts as too large.
        assignment_bits: row bits up to which an assignment is tabulated where it cannot be composed
            of diagrams.
        max_leaves: distinct values of a diagram over more than `table_bits` bits above which it is
            not built.
    """

    table_bits: int = 14
    wide_table_bits: int = 20
    max_nodes: int = 500_000
    assignment_bits: int = 16
    max_leaves: int = 20_000


@dataclass(frozen=True, slots=True)
class SiftLimits:
    """Limits of the search for a variable order.

    Attributes:
        lookups: cache look-ups of one search for all states.
        part_nodes: nodes of the part of the states that is sifted where that search is too long,
            per attempt.
        work: nodes times bits of all rounds of sifting (two million take about a second).
        growth: factor by which the diagrams may grow while a variable moves.
        gain: sifting ends after two rounds in a row that reduce the nodes by less than this share.
    """

    lookups: int = 20_000_000
    part_nodes: tuple[int, ...] = (20_000, 50_000, 100_000)
    work: int = 40_000_000
    growth: float = 1.2
    gain: float = 0.1


SIFT_TIME_SHARE = 0.25
"""Share of the user's time limit that the search for a variable order may take."""

FORCE_ROUNDS = 100
"""Most rounds of FORCE; it ends sooner where an order repeats."""

MAX_VALUATIONS = 20_000_000
"""Valuations of an expression that are evaluated at once on the fly: they take 1 GB."""

ALTERNATION_LOOKUPS = ((500_000, 3_000_000), (6_000_000, 18_000_000))
"""Cache look-ups of the turns of saturation and of clock search. Saturation solves the models of
PRISM's benchmark suite that it solves at all within its first two turns; csma with 3 stations needs
the first turn of clock search only.
"""

PROBE_LOOKUPS = 150_000
"""Look-ups after which the first turn of clock search ends unless it has found at least as many
states. By then csma has found 26 to 90 states per look-up; firewire_impl_dl and zeroconf, where
saturation is better, at most 0.1.
"""
