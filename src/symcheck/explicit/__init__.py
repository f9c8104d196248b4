"""Explicit search: states as packed rows of bits, matrices as compressed rows."""
