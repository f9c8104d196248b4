"""Many values of constants: which there are, and tables of results."""
