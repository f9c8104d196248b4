"""Types, evaluation and simplification of expressions."""
