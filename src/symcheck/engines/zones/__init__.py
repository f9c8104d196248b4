"""Zones: sets of clock values, and the exact decision process that backwards reachability finds."""
