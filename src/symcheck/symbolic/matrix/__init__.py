"""Transition matrices and rewards as MTBDDs or rows; choice classes of MDPs."""
