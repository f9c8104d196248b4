"""Linear systems x = A x + b: sweeps, extrapolation, bounds by component, certificates."""
