"""The Cython extension that adds MTBDDs and compiled recursions to the CUDD manager of `dd`."""
