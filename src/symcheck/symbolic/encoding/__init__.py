"""Encoding: variables as bits, expressions as BDDs and MTBDDs."""
