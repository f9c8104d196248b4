"""Other model checkers, run on the same model and properties to compare their answers."""
