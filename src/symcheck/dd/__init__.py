"""Decision diagrams: one CUDD manager with BDDs (sets) and MTBDDs (functions to numbers),
saturation, and the numbering of states by offset-labelled diagrams.
"""
