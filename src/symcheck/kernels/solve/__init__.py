"""Linear systems x = A x + b: sweeps, extrapolation, component-wise bounds and their certificates."""
