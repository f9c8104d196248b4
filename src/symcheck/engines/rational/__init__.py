"""Exploration in rational arithmetic; its result is the model of the exact engine."""
