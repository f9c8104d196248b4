"""Sizes up to which rational arithmetic takes over where doubles do not decide.

What it costs depends on what is done: it eliminates a dense component in cubic time, adds rewards
in linear time, and explores a model again by the interpreter, some ten thousand states a second.
"""

__all__ = [
    "COMPONENT_STATES",
    "CONDITIONAL_STATES",
    "END_COMPONENT_STATES",
    "EXTREME_STATES",
    "REWARD_STATES",
    "STATES",
]

COMPONENT_STATES = 50
"""States of a strong component that is solved in rationals where all methods in doubles fail."""
END_COMPONENT_STATES = 100
"""States of an end component whose policies are evaluated in rationals where rounding hides which
is best."""
CONDITIONAL_STATES = 1_000
"""The most states of a model whose conditional probabilities are computed in rationals if doubles
lose the digits of a condition that is improbable."""
EXTREME_STATES = 1_000
"""States of models in which argmin and argmax compare values as rationals that are equal up to
rounding; values that underflow, in more."""
STATES = 20_000
"""The most states of a model that is explored again in rational arithmetic for a threshold, or at
which expressions of properties are evaluated in it."""
REWARD_STATES = 200_000
"""States in which rewards are added in rational arithmetic, some thousands a second."""
