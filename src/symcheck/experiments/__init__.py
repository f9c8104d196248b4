"""Experiments: a model is checked for many values of its constants, in several processes."""
