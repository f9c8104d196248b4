"""Simulation: random paths, and estimates of properties from sampled paths (statistical model
checking).
"""
