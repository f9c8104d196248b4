"""Symbolic model construction: from a bound model to diagrams of its transition relation, state
space and matrices.
"""
