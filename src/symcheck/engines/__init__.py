"""Engines: how sets, values and matrices are stored, behind one set of protocols."""
