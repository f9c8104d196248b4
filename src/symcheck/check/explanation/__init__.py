"""Counterexamples and witnesses of bounds on probabilities: likeliest paths, and few commands."""
