"""Block matrices: distinct blocks of diagonal runs, and products with them."""
