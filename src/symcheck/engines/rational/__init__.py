"""Exploration in rational arithmetic: the explicit engine over what it gives is the exact engine."""
