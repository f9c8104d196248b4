"""The reachable states, by image computation and saturation."""
