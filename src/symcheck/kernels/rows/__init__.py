"""Compressed rows: construction, submatrices, products."""
