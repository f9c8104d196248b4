"""Random paths, and estimates from them."""
