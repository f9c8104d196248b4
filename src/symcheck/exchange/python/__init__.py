"""Models from values in Python: a matrix, or a function that gives the successors of a state."""
