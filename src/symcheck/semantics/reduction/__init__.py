"""Reductions of bound models that preserve properties: dead variables and stutter steps."""
