"""Partition refinement for strong bisimulation, on diagrams and on rows."""
