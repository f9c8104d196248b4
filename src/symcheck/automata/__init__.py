"""Linear time: formulas, and the deterministic automata that accept their words."""
