"""The switches of the command line, and those of PRISM."""
