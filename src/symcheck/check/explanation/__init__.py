"""Counterexamples and witnesses of bounds on probabilities and rewards: paths and commands."""
