"""Beliefs of partially observed models: what is known of the state after observations."""
