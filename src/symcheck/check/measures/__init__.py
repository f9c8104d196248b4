"""Measures: which equations each quantity of a model leads to."""
