"""The limits of doubles."""

__all__ = ["LARGEST_WHOLE", "LEAST", "LEAST_NORMAL"]

LARGEST_WHOLE = 2**53
"""Up to this number, every int is a double."""
LEAST_NORMAL = 2.0**-1022
"""The least number whose relative error is that of larger ones."""
LEAST = 5e-324
"""The least positive double. A result below normal numbers is wrong by at most half of it."""
