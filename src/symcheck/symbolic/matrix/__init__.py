"""Transition matrices and rewards as MTBDDs or rows, and the choice classes of MDPs."""
