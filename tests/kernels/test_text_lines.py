"""Lines that compiled code writes are those that Python formats."""

from __future__ import annotations

import numpy as np

from symcheck.kernels.tables.text_lines import join_lines


def test_numbers_and_texts_are_separated_by_spaces() -> None:
    numbers = np.array([0, -5, 2**63 - 1, -(2**63)])
    texts, codes = ["1/3", "Infinity", ""], np.array([1, 0, 0, 2], np.int32)
    expected = "".join(f"{n} {texts[c]}\n" for n, c in zip(numbers, codes, strict=True))
    assert join_lines([numbers, (texts, codes)], 4) == expected


def test_no_lines_are_an_empty_text() -> None:
    assert join_lines([np.empty(0, np.int64)], 0) == ""
