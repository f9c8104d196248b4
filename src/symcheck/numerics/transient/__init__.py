"""Transient analysis of CTMCs: uniformisation, Poisson weights, rational Krylov spaces, truncation."""
