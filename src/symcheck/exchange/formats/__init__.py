"""One file format of other tools per module."""
