"""The symbolic engines: sets as BDDs, the matrix as MTBDDs, blocks or rows."""
