"""Decision diagrams as arrays: ODDs, the quad-DAG of a matrix, conversions to vectors."""
