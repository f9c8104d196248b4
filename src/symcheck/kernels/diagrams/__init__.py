"""Decision diagrams as arrays: offset-labelled diagrams (ODDs), the quad-DAG of a matrix, conversions to vectors."""
