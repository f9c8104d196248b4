"""Messages between the parts of a model, about states that are ghosts elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from symcheck.distributed import tuning
from symcheck.distributed.exploration import PartRows
from symcheck.matrices.rows import Bools, Floats, Int32s

__all__ = ["Boundary", "Message"]

Message = tuple[Int32s | None, NDArray[np.generic]]
"""Places in the list of the ghosts of a part (None: all of them), and their values."""


class Boundary:
    """What a part sends to the others, and receives from them: a message for each part.

    Attributes:
        sent: for each part, the own states that are its ghosts: int32.
    """

    def __init__(self, rows: PartRows) -> None:
        self._starts, self.sent = rows.starts, rows.sent

    def all(self, values: NDArray[np.generic]) -> list[Message]:
        """All values."""
        return [(None, values[s]) for s in self.sent]

    def of_new(
        self, holds: Bools, told: Sequence[Bools], values: NDArray[np.generic] | None = None
    ) -> list[Message]:
        """The states for which something holds now, with their values.

        told: for each part, whether it knows that; updated here.
        """
        messages: list[Message] = []
        for sent, known in zip(self.sent, told, strict=True):
            places = np.flatnonzero(holds[sent] & ~known).astype(np.int32)
            known[places] = True
            with_values = np.empty(0, np.bool_) if values is None else values[sent[places]]
            messages.append((places, with_values))
        return messages

    def of_changes(
        self, values: Floats, known: Sequence[Floats], threshold: float
    ) -> list[Message]:
        """The values that differ relatively by more than a threshold from those that the others
        know, which are updated here.
        """
        messages: list[Message] = []
        for sent, told in zip(self.sent, known, strict=True):
            new = values[sent]
            changed = new != told
            if threshold:
                with np.errstate(invalid="ignore"):
                    changed &= np.abs(new - told) > threshold * new
            count = np.count_nonzero(changed)
            if count > tuning.DENSE_SHARE * len(new):
                told[:] = new
                messages.append((None, new))
                continue
            places = np.flatnonzero(changed).astype(np.int32)
            told[places] = new[places]
            messages.append((places, new[places]))
        return messages

    def ghosts(self, incoming: Sequence[Message]) -> Int32s:
        """The ghosts that messages are about."""
        found = [np.empty(0, np.int32)]
        for part, (places, _) in enumerate(incoming):
            first, last = self._starts[part], self._starts[part + 1]
            ghosts = np.arange(first, last) if places is None else first + places
            found.append(ghosts.astype(np.int32))
        return np.concatenate(found)

    def receive(self, values: NDArray[np.generic], incoming: Sequence[Message]) -> None:
        """Write values of ghosts."""
        for part, (places, new) in enumerate(incoming):
            of_part = values[self._starts[part] : self._starts[part + 1]]
            of_part[slice(None) if places is None else places] = new
