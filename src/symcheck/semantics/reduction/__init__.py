"""Reductions of bound models that preserve properties: dead variables, symmetry, early stops."""
