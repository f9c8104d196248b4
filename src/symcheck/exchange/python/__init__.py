"""Models from Python: a matrix, a graph, a function that gives successors, modules and commands."""
