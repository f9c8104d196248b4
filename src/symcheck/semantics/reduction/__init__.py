"""Reductions of bound models: live variables and stutter steps."""
