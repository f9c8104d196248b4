"""Write a file completely or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from symcheck.errors import UsageError

__all__ = ["write_whole"]


def write_whole(target: str | Path, write: Callable[[Path], None]) -> None:
    """Let `write` make a temporary file beside the target, then rename it to the target.

    A device, a pipe or a link is written directly, because it must not be replaced.

    Raises:
        UsageError: the file cannot be written.
    """
    path = Path(target)
    special = path.is_symlink() or (path.exists() and not path.is_file())
    temporary = path if special else path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        write(temporary)
        if not special:
            temporary.replace(path)
    except OSError as error:
        raise UsageError(f"cannot write '{path}': {error.strerror or error}") from None
    finally:
        if not special:
            temporary.unlink(missing_ok=True)
