"""The explicit engine: states in a table, transitions in compressed rows, sets as bool arrays."""
