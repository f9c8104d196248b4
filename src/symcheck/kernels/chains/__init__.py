"""Chains: GTH elimination, Gauss-Seidel and SSOR sweeps, uniformisation."""
