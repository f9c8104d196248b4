from __future__ import annotations

import numpy as np
import pytest

from symbolic.oracle import bound
from symcheck.errors import UnsupportedError
from symcheck.symbolic.encoding.variables import encode

MODEL = bound(
    "dtmc global g : bool; module m x : [-2..3]; y : [7..7]; z : [0..8]; [] true -> true; endmodule"
)


def test_bits_are_interleaved_and_most_significant_first():
    encoding = encode(MODEL)
    assert encoding.rows == ("g.0", "x.2", "x.1", "x.0", "z.3", "z.2", "z.1", "z.0")
    assert encoding.bits[:4] == ("g.0", "g.0'", "x.2", "x.2'")
    assert encoding.by_name["y"].width == 0
    assert encoding.in_declaration_order
    assert "x: -2..3 as x.2 x.1 x.0" in repr(encoding)


def test_codes_count_from_the_lowest_value():
    x = encode(MODEL).by_name["x"]
    assert [x.code(v) for v in range(-2, 4)] == list(range(6))
    assert [x.value(c) for c in range(6)] == list(range(-2, 4))
    assert x.column().tolist() == [-2, -1, 0, 1, 2, 3, 3, 3]
    assert x.column(padded=False).tolist() == [-2, -1, 0, 1, 2, 3]
    assert encode(MODEL).by_name["g"].column().dtype == np.bool_
    with pytest.raises(ValueError, match=r"x=4 is not within -2\.\.3"):
        x.code(4)


def test_an_order_may_name_some_variables():
    encoding = encode(MODEL, ["z", "x"])
    assert [v.name for v in encoding.ordered] == ["z", "x", "g", "y"]
    assert [v.name for v in encoding.sorted(["g", "x", "z"])] == ["z", "x", "g"]
    assert not encoding.in_declaration_order
    with pytest.raises(KeyError):
        encode(MODEL, ["nothing"])


def test_bits_turn_back_into_values():
    encoding = encode(MODEL, ["z"])
    rows = np.array([[0, 1, 0, 1, 1, 0, 0, 1]], dtype=np.uint8)  # z = 5, g = true, x = code 1
    assert [c.tolist() for c in encoding.decode(rows)] == [[True], [-1], [7], [5]]


def test_what_diagrams_cannot_hold_is_refused():
    with pytest.raises(UnsupportedError, match=r"x has no bounds.*explicit"):
        encode(bound("dtmc module m x : int; [] true -> true; endmodule"))
    with pytest.raises(UnsupportedError, match="64 bits"):
        encode(
            bound(
                "dtmc module m x : [-4611686018427387904..4611686018427387904]; [] true -> true; endmodule"
            )
        )
