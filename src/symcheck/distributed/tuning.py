"""Constants of distributed models."""

BATCH_STATES = 1 << 16
"""States that a worker expands at a time: the arrays of their successors take some megabytes."""

ROUND_STATES = 1 << 20
"""States that a worker expands at most before it sends states to others: messages stay small."""

SWEEPS_PER_ROUND = 4
"""Sweeps of a worker between two exchanges. A hash puts most successors on other workers: more
sweeps with their old values gain little.
"""

FIRST_TOLERANCE = 0.1
"""Guess upper bounds when lower bounds change by less than this share of their width in a round."""

MAX_ROUNDS = 1_000_000
"""Rounds after which an iteration is given up."""

VERIFICATION_ROUNDS = 200
"""Rounds in which a candidate for upper bounds has to become inductive."""

MIN_CHANGE = 1e-14
"""Relative change below which bounds cannot improve: rounding is as large."""
