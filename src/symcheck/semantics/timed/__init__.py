"""Timed automata: constraints on clocks, and the digital clocks that count whole time units."""
