"""State-space exploration: the register machine, successors, breadth-first search."""
