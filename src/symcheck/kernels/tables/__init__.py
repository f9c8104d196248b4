"""Hash tables and unique tables: packed states, pairs, memoised results, sparse vectors."""
