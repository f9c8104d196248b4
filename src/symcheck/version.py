"""The version of symcheck: a file that any other may import."""

__all__ = ["__version__"]

__version__ = "0.2.0"
