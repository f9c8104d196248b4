"""Methods, graph algorithms and bounds on plain arrays."""
