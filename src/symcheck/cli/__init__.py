"""The command line."""

from __future__ import annotations

__all__ = ["main"]


def main(words: list[str] | None = None) -> int:
    """Run the command line; gives the exit status (see `symcheck --help`)."""
    from symcheck.cli.entry import run_safely

    return run_safely(words)
