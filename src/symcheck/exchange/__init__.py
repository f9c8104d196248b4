"""Models and strategies in and out, in the formats of other tools."""
