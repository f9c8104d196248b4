"""Strategies of an MDP that attain the value of a property."""
