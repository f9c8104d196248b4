"""The exact engine: the explicit engine over rational numbers."""
