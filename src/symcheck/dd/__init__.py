"""Decision diagrams: BDDs and MTBDDs in one manager, and the numbering of states by them."""
