"""Write a file completely or not at all."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from symcheck.errors import OutputError, SymcheckError, UsageError

__all__ = ["output_fault", "remove_unfinished", "write_whole"]

_UNFINISHED: set[Path] = set()
"""The temporary files of this process."""

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EPIPE)
"""What is wrong with a medium, and not with the name of a file."""


def write_whole(target: str | Path, write: Callable[[Path], object], ending: str = ".part") -> None:
    """Let `write` make a temporary file beside the target, then rename it to the target.

    A device, a pipe or a link is written directly, because it must not be replaced.

    Args:
        target: the file.
        write: writes the file that it is given.
        ending: that of the name of the temporary file.

    Raises:
        UsageError: the file cannot be written.
        OutputError: the disk is full, or the reader has closed the pipe.
    """
    path = Path(target)
    special = path.is_symlink() or (path.exists() and not path.is_file())
    beside = path.with_name(f".{path.name}.{os.getpid()}{ending}").absolute()
    temporary = path if special else beside
    try:
        if not special:
            _UNFINISHED.add(temporary)
        write(temporary)
        if not special:
            temporary.replace(path)
    except OSError as error:
        raise output_fault(f"'{path}'", error) from None
    finally:
        if not special:
            temporary.unlink(missing_ok=True)
            _UNFINISHED.discard(temporary)


def output_fault(what: str, error: OSError) -> SymcheckError:
    """The error for something that cannot be written."""
    kind = OutputError if error.errno in _FULL else UsageError
    reason = (
        "its reader has closed the pipe"
        if error.errno == errno.EPIPE
        else error.strerror or str(error)
    )
    return kind(f"cannot write {what}: {reason}")


def remove_unfinished() -> None:
    """Remove the temporary files before the process ends at once."""
    for temporary in list(_UNFINISHED):
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
