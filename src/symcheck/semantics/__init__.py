"""Binding of syntax trees to models: names, types, constants, composition, reductions."""
