"""Multi-objective queries, `multi(...)`."""
