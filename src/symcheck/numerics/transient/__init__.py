"""Transient analysis of CTMCs: uniformisation, rational Krylov subspaces, truncation."""
