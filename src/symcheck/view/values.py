"""Short texts for sets of values and for updates of a variable."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from symcheck.matrices.rows import Int64s

if TYPE_CHECKING:
    from symcheck.symbolic.encoding.variables import EncodedVariable

__all__ = ["moves_text", "values_text"]


def values_text(variable: EncodedVariable, codes: Int64s, parts: int = 5) -> str:
    """Ranges of values, such as '0..3, 5'; at most `parts` of them, then '…'.

    codes: the values as codes, int64[k], ascending and distinct.
    """
    if variable.is_bool:
        return ", ".join(str(bool(c)).lower() for c in codes.tolist())
    cuts = np.flatnonzero(np.diff(codes) != 1) + 1
    ranges = [
        (int(piece[0]) + variable.low, int(piece[-1]) + variable.low)
        for piece in np.split(codes, cuts)
        if len(piece)
    ]
    texts = [
        str(a) if a == b else f"{a}, {b}" if b == a + 1 else f"{a}..{b}" for a, b in ranges[:parts]
    ]
    return ", ".join(texts) + (f", … ({len(codes)} values)" if len(ranges) > parts else "")


def moves_text(variable: EncodedVariable, now: Int64s, after: Int64s, parts: int = 6) -> str:
    """Updates, such as '0 → 1, 2'; 'unchanged' for the identity, '0..5: +1' for a common increment.

    now, after: codes before and after a step, int64[k]. Three or more updates take a line each.
    """
    step = after - now
    if (step == 0).all():
        return (
            f"{values_text(variable, now)} unchanged"
            if len(now) > 1
            else f"{values_text(variable, now)} stays"
        )
    if len(now) > 2 and not variable.is_bool and (step == step[0]).all():
        return f"{values_text(variable, now)}: {'+' if step[0] > 0 else '−'}{abs(int(step[0]))}"
    groups: dict[bytes, list[int]] = {}
    targets: dict[bytes, Int64s] = {}
    for code in np.unique(now).tolist():
        to = np.sort(after[now == code])
        groups.setdefault(to.tobytes(), []).append(code)
        targets[to.tobytes()] = to
    texts = [
        f"{values_text(variable, np.array(codes))} → {values_text(variable, targets[key])}"
        for key, codes in groups.items()
    ]
    shown = texts[:parts] + ([f"… ({len(now)} moves)"] if len(texts) > parts else [])
    return ("; " if len(shown) < 3 else "\n").join(shown)
