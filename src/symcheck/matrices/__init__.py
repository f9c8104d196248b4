"""Sparse matrices: compressed rows, and block matrices made of the repeated blocks of a matrix
diagram.
"""
