"""Strategies as files, read and written, and the Markov chain that a strategy induces."""
