"""LTL formulas and their translation to deterministic ω-automata; the HOA format."""
