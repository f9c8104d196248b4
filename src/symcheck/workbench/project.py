"""The files of a workbench: plain files of one folder, which others may change too."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

from symcheck.errors import SymcheckError, UsageError
from symcheck.lsp.answers import MODELS
from symcheck.whole_file import read_whole, uncompressed_name, write_whole

__all__ = ["PROPERTIES", "File", "NewerFileError", "Project"]

PROPERTIES = (".pctl", ".csl", ".props", ".prctl", ".ltl", ".properties")
"""The endings of the names of properties files that are listed."""

_NAME = re.compile(r"[^/\\:\0]+")
_LARGEST = 5_000_000
"""Bytes of a file that an editor opens."""


class NewerFileError(SymcheckError):
    """A file has changed since it was read; it is not overwritten."""


class File(NamedTuple):
    """A text, and the version of the file that has it: "" if there is none."""

    text: str
    version: str


@dataclass(frozen=True)
class Project:
    """The files of a folder: those with a known ending, and those of the command line."""

    folder: Path
    given: Sequence[str] = ()

    def names(self) -> dict[str, list[str]]:
        """The names of the models, and of the properties."""
        found = sorted(p.name for p in self.folder.iterdir() if p.is_file())
        return {
            "model": [n for n in found if n.lower().endswith(MODELS)],
            "properties": [n for n in found if n.lower().endswith(PROPERTIES)],
        }

    def path(self, name: str) -> Path:
        """A file of the folder. Raises UsageError for another name."""
        known_ending = name.lower().endswith((*MODELS, *PROPERTIES))
        if name not in self.given and not (_NAME.fullmatch(name) and known_ending):
            known = ", ".join((*MODELS, *PROPERTIES))
            raise UsageError(f"'{name}' is no name of a model or of properties", hint=known)
        return self.folder / name

    def read(self, name: str) -> File:
        """A file; an empty one if there is none.

        Raises UsageError if it cannot be read, is too large or is no text.
        """
        path = self.path(name)
        if not path.exists():
            return File("", "")
        if path.stat().st_size > _LARGEST:
            raise UsageError(f"'{name}' has more than {_LARGEST:,} bytes")
        data = read_whole(path)
        try:
            text = data.decode("utf-8")
        except UnicodeDecodeError:
            raise UsageError(f"'{name}' is no text in UTF-8") from None
        return File(text.replace("\r\n", "\n"), _version(data))

    def write(self, name: str, text: str, version: str) -> str:
        """Write a file, whole or not at all, with the line ends that it has.

        Args:
            name: the file.
            text: its new text.
            version: that of the file which the text replaces; "" for a new one.

        Returns:
            The new version.

        Raises:
            NewerFileError: the file has another version.
            UsageError: it cannot be read or written.
        """
        before = self.read(name)
        if before.version != version:
            raise NewerFileError(f"'{name}' has changed on disk since it was read")
        path = self.path(name)
        if before.version and b"\r\n" in path.read_bytes():
            text = text.replace("\n", "\r\n")
        data = text.encode("utf-8")
        mode = path.stat().st_mode if path.exists() else None

        def written(temporary: Path) -> None:
            temporary.write_bytes(data)
            if mode is not None:
                temporary.chmod(mode)

        write_whole(path, written)
        return _version(data)

    def rename(self, name: str, new: str) -> None:
        """Give a file another name, which no file has.

        Raises UsageError: there is no such file, the new name is taken or no name of a file, or
        the system refuses.
        """
        path, target = self._existing(name), self.path(new)
        if (kept := uncompressed_name(name)[1]) != uncompressed_name(new)[1]:
            raise UsageError(
                f"'{name}' is not compressed as '{new}' says",
                hint=f"end with {kept}" if kept else None,
            )
        try:
            target.touch(exist_ok=False)  # nobody else takes the name meanwhile
        except FileExistsError:
            raise UsageError(f"'{new}' exists already") from None
        except OSError as error:
            raise UsageError(f"cannot rename '{name}': {error.strerror}") from None
        try:
            path.replace(target)
        except OSError as error:
            target.unlink()
            raise UsageError(f"cannot rename '{name}': {error.strerror}") from None

    def delete(self, name: str, version: str) -> None:
        """Delete a file.

        Raises:
            NewerFileError: the file has another version.
            UsageError: there is no such file, or the system refuses.
        """
        path = self._existing(name)
        if self.read(name).version != version:
            raise NewerFileError(f"'{name}' has changed on disk since it was read")
        try:
            path.unlink()
        except OSError as error:
            raise UsageError(f"cannot delete '{name}': {error.strerror}") from None

    def _existing(self, name: str) -> Path:
        path = self.path(name)
        if not path.is_file():
            raise UsageError(f"there is no file '{name}'")
        return path


def _version(data: bytes) -> str:
    return sha256(data).hexdigest()
