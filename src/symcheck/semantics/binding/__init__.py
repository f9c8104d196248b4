"""From a program to a bound model, and from properties to formulas of that model."""
