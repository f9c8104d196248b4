"""Formulas, measures, filters and thresholds: what is asked of an engine, and results."""
