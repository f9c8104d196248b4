"""Variable orders: declared, given, FORCE, sifting."""
