"""Multi-objective queries as linear programs, in floating point and in rationals."""
