"""Measures in rational arithmetic."""
