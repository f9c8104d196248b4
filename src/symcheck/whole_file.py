"""Read and write whole files, compressed if their names end in .gz or .xz.

A file is written completely or not at all.
"""

from __future__ import annotations

import errno
import io
import os
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO

from symcheck.errors import OutputError, UsageError

__all__ = [
    "COMPRESSED",
    "extension_of",
    "is_output_fault",
    "open_for_text",
    "output_fault",
    "read_whole",
    "remove_unfinished",
    "uncompressed_name",
    "write_whole",
]

COMPRESSED = (".gz", ".xz")
"""The endings of compressed files."""

_UNFINISHED: set[Path] = set()
"""The temporary files of this process."""

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EPIPE)
"""What is wrong with a medium, and not with the name of a file."""


def uncompressed_name(path: str | Path) -> tuple[str, str]:
    """The name of a file without `.gz` or `.xz`, and that ending ("" if there is none)."""
    name = str(path)
    suffix = name[-3:] if name.endswith(COMPRESSED) else ""
    return name.removesuffix(suffix), suffix


def extension_of(path: str | Path, known: Collection[str], meaning: str) -> str:
    """The extension of a file that is to be written. Raises UsageError if it is not a known one.

    meaning: what it says, for the message.
    """
    extension = Path(path).suffix.lower()
    if extension not in known:
        raise UsageError(
            f"'{path}': the extension says {meaning}, and it is none of {', '.join(known)}"
        )
    return extension


def read_whole(path: str | Path) -> bytes:
    """The bytes of a file, uncompressed. Raises UsageError if it cannot be read."""
    if not str(path):
        raise UsageError("the name of a file is empty")
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise UsageError(f"cannot read {path}: {error.strerror or error}") from error
    suffix = uncompressed_name(path)[1]
    return _uncompressed(data, suffix, path) if suffix else data


def _uncompressed(data: bytes, suffix: str, path: str | Path) -> bytes:
    import gzip
    import lzma
    import zlib

    try:
        return gzip.decompress(data) if suffix == ".gz" else lzma.decompress(data)
    except (EOFError, zlib.error, lzma.LZMAError, gzip.BadGzipFile):
        raise UsageError(f"cannot read {path}: not a whole {suffix} file") from None


@contextmanager
def open_for_text(path: Path, name: str | Path) -> Iterator[TextIO]:
    """Open a file for writing text, compressed as a name asks for."""
    match uncompressed_name(name)[1]:
        case ".gz":
            import gzip

            # Without a time and a name, the same text gives the same file.
            with (
                path.open("wb") as whole,
                gzip.GzipFile("", "wb", fileobj=whole, mtime=0) as packed,
                io.TextIOWrapper(packed, encoding="utf-8", newline="\n") as file,
            ):
                yield file
        case ".xz":
            import lzma

            with lzma.open(path, "wt", encoding="utf-8", newline="\n") as file:
                yield file
        case _:
            with path.open("w", encoding="utf-8", newline="\n") as file:
                yield file


def write_whole(target: str | Path, write: Callable[[Path], object], suffix: str = ".part") -> None:
    """Let `write` make a temporary file beside the target, then rename it to the target.

    A device, a pipe or a link is written directly, because it must not be replaced.

    Args:
        target: the file.
        write: writes the file that it is given.
        suffix: that of the name of the temporary file.

    Raises:
        UsageError: the file cannot be written.
        OutputError: the disk is full, or the reader has closed the pipe.
    """
    path = Path(target)
    special = path.is_symlink() or (path.exists() and not path.is_file())
    beside = path.with_name(f".{path.name}.{os.getpid()}{suffix}").absolute()
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


def is_output_fault(error: OSError) -> bool:
    """Whether the medium is full, or its reader gone."""
    return error.errno in _FULL


def output_fault(what: str, error: OSError) -> OutputError | UsageError:
    """The error for something that cannot be written."""
    kind = OutputError if is_output_fault(error) else UsageError
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
