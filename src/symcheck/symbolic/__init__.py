"""From a bound model to diagrams: encoding, relations, search, matrices."""
