"""Reward-bounded reachability: one system of equations per epoch."""
