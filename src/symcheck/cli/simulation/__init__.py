"""Simulation: random paths, estimates from many, and the step simulator."""
