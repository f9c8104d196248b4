"""State-space exploration: the register machine for expressions, successors, breadth-first search."""
