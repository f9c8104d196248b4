"""Reads models and properties in the JANI format as syntax trees of the PRISM language."""
