"""Binding of programs to models, and of properties to formulas over a bound model."""
