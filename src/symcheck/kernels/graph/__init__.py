"""Graph algorithms over compressed rows: components, MDP precomputation, products with automata."""
