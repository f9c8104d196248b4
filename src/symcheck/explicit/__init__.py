"""Explicit exploration: expressions compiled for a register machine, packed states, sparse
matrices; no diagrams.
"""
