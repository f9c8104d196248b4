"""Large arrays in files of a folder: an explicit model may then exceed the memory."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from symcheck.errors import UsageError

__all__ = ["arrays_in"]


@contextmanager
def arrays_in(folder: str | None) -> Iterator[None]:
    """A context in which new arrays of 16 MB or more are files in a folder.

    The files have no names, and the system deletes them with the arrays. The system keeps in memory
    what is used often and writes the rest to the disk. A full disk is a MemoryError.

    Args:
        folder: an existing folder; None: arrays are in memory.

    Raises:
        UsageError: the folder does not exist, or no files can be opened there.
    """
    if folder is None:
        yield
        return
    from symcheck.kernels.file_memory import use_folder, use_for_arrays

    if not os.path.isdir(folder):
        raise UsageError(f"there is no folder '{folder}' for the files of large arrays")
    try:
        folder_before = use_folder(os.fsencode(folder))
    except OSError:
        raise UsageError(
            f"the folder '{folder}' cannot hold files of large arrays: it is not writable, or the "
            "system is not Linux"
        ) from None
    handler_before = use_for_arrays()
    try:
        yield
    finally:
        use_for_arrays(handler_before)
        use_folder(folder_before)
