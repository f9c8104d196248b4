"""Checking on the quotient by strong bisimulation."""
