"""Compiled loops over plain arrays; they know neither the modelling language nor CUDD.

tables: hash tables. graph: graph algorithms. rows: compressed rows. diagrams: ODDs and the
quad-DAG. blocks: block matrices. partition: refinement. explore: state-space exploration. solve:
linear systems. chains: elimination and sweeps for chains. rounding.pxd: outward rounding.
tuning.pxd: tuning constants.
"""
