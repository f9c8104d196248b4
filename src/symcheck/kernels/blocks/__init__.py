"""Block matrices: a quad-DAG partitioned into distinct blocks of diagonal runs, and products with them."""
