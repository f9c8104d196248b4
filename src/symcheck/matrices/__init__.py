"""Sparse matrices as compressed rows, and block matrices."""
