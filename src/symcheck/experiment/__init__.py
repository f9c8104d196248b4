"""Sweeps over values of constants, and tables of their results."""
