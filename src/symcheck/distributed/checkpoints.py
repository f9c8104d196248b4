"""Checkpoints of parts in a folder that all workers and the client share.

states-I.bin: the states of part I that are known, packed, one after the other. rows-I.npz: the
part, once it is explored; the file `explored` says that all of them are. F-I-K.npz: the values of
checkpoint K of an iteration for the formula with the hash F; F.json names the last K for which all
parts have written theirs.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from symcheck.distributed.exploration import PartRows
from symcheck.distributed.partition import Partition
from symcheck.errors import OutputError, UsageError
from symcheck.explicit.states import Rows
from symcheck.matrices.rows import Floats, SparseMatrix

__all__ = ["Folder", "PartFiles"]

_EXPLORED = "explored"


@dataclass(frozen=True)
class PartFiles:
    """The files of a part."""

    folder: Path
    number: int

    @property
    def _states(self) -> Path:
        return self.folder / f"states-{self.number}.bin"

    @property
    def _rows(self) -> Path:
        return self.folder / f"rows-{self.number}.npz"

    def append_states(self, states: Rows) -> None:
        """Add states (uint64[n, words]) to those that are known."""
        with open(self._states, "ab") as file:
            file.write(np.ascontiguousarray(states).tobytes())

    def load_states(self, words: int) -> Rows | None:
        """The states that are known: uint64[n, words]; None if there are none.

        A last one that is not complete is cut off.
        """
        if not self._states.exists():
            return None
        size = self._states.stat().st_size // (8 * words) * 8 * words
        os.truncate(self._states, size)
        return np.fromfile(self._states, np.uint64).reshape(-1, words)

    def save_rows(self, rows: PartRows) -> None:
        """Write the explored part."""
        matrix = rows.matrix
        arrays: dict[str, Any] = {
            "states": rows.states,
            "indptr": matrix.indptr,
            "indices": matrix.indices,
            "data": matrix.data,
            "starts": rows.starts,
            "deadlocks": rows.deadlocks,
            "initial": rows.initial,
            **{f"sent{i}": a for i, a in enumerate(rows.sent)},
            **{f"reward{i}": a for i, a in enumerate(rows.rewards)},
        }
        if matrix.groups is not None:
            arrays["groups"] = matrix.groups
        _write(self._rows, lambda file: np.savez(file, **arrays))

    def load_rows(self) -> PartRows | None:
        """The explored part; None while the exploration is not complete."""
        if not (self.folder / _EXPLORED).exists():
            return None
        with np.load(self._rows) as a:
            starts = a["starts"]
            groups = a.get("groups")
            matrix = SparseMatrix(a["indptr"], a["indices"], a["data"], int(starts[-1]), groups)
            return PartRows(
                a["states"],
                matrix,
                starts,
                [a[n] for n in a.files if n.startswith("sent")],
                a["deadlocks"],
                a["initial"],
                [a[n] for n in a.files if n.startswith("reward")],
            )

    def _values(self, formula: str, number: int) -> Path:
        return self.folder / f"{_hash(formula)}-{self.number}-{number}.npz"

    def save_values(self, formula: str, number: int, arrays: Mapping[str, Floats]) -> None:
        """Write the values of an iteration, by name, as a checkpoint with a number."""
        named: dict[str, Any] = dict(arrays)
        _write(self._values(formula, number), lambda file: np.savez(file, **named))

    def load_values(self, formula: str, number: int) -> Mapping[str, Floats]:
        """The values of a checkpoint by name."""
        with np.load(self._values(formula, number)) as a:
            return dict(a)


@dataclass(frozen=True)
class Folder:
    """A folder of checkpoints, as the client sees it."""

    path: Path

    @staticmethod
    def open(path: Path, model: str, partition: Partition) -> tuple[Folder, Partition]:
        """A folder for this model: a new one, or that of an earlier run with as many parts.

        Args:
            path: the folder.
            model: names the model and its constants.
            partition: for a new folder.

        Returns:
            The folder, and its partition.

        Raises:
            UsageError: it holds checkpoints of another model, or of another number of parts.
            OutputError: it cannot be written.
        """
        folder, run = Folder(path), path / "run.json"
        try:
            path.mkdir(parents=True, exist_ok=True)
            if not run.exists():
                content = {"model": _hash(model), "parts": partition.parts}
                content |= {"mask": list(partition.mask), "seed": partition.seed}
                _write(run, lambda file: file.write(json.dumps(content).encode()))
                return folder, partition
            known = json.loads(run.read_text())
        except OSError as error:
            raise OutputError(f"no checkpoints in {path}: {error.strerror or error}") from None
        if known["model"] != _hash(model):
            raise UsageError(
                f"{path} has checkpoints of another model, or of other constants",
                hint="remove the folder, or name another one",
            )
        if known["parts"] != partition.parts:
            raise UsageError(
                f"{path} has checkpoints of {known['parts']} parts, and the cluster has "
                f"{partition.parts} workers",
                hint="start as many workers, or name another folder",
            )
        return folder, Partition(known["parts"], tuple(known["mask"]), known["seed"])

    def files(self, number: int) -> PartFiles:
        """The files of a part."""
        return PartFiles(self.path, number)

    def complete_exploration(self) -> None:
        """Record that all parts are explored and written; the lists of states are removed."""
        _write(self.path / _EXPLORED, lambda file: file.write(b""))
        for old in self.path.glob("states-*.bin"):
            old.unlink(missing_ok=True)

    def last(self, formula: str) -> int | None:
        """The last complete checkpoint of the values for a formula."""
        record = self.path / f"{_hash(formula)}.json"
        return int(json.loads(record.read_text())["last"]) if record.exists() else None

    def complete(self, formula: str, number: int) -> None:
        """Record that all parts have written the checkpoint with this number."""
        record = self.path / f"{_hash(formula)}.json"
        _write(record, lambda file: file.write(json.dumps({"last": number}).encode()))
        for old in self.path.glob(f"{_hash(formula)}-*.npz"):
            if not old.stem.endswith(f"-{number}"):
                old.unlink(missing_ok=True)

    def forget(self, formula: str) -> None:
        """Remove the values for a formula."""
        for old in self.path.glob(f"{_hash(formula)}*"):
            old.unlink(missing_ok=True)


def _hash(text: str) -> str:
    return sha256(text.encode()).hexdigest()[:16]


def _write(path: Path, write: Callable[[BinaryIO], object]) -> None:
    """Write a file completely or not at all. Raises OutputError."""
    unfinished = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    try:
        with open(unfinished, "wb") as file:
            write(file)
        os.replace(unfinished, path)
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from None
