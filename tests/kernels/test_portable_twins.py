"""The twins in portable.h, which other compilers and systems use, are compiled here and compared with exact arithmetic."""

from __future__ import annotations

import ctypes
import math
import random
import shutil
import subprocess
from fractions import Fraction
from pathlib import Path

import pytest

HEADERS = Path(__file__).resolve().parents[2] / "src" / "symcheck" / "kernels"
COMPILER = shutil.which("cc")
WRAPPERS = """
#include "portable.h"
int add(long long x, long long y, long long* r) { return add_overflows(x, y, r); }
int subtract(long long x, long long y, long long* r) { return subtract_overflows(x, y, r); }
int multiply(long long x, long long y, long long* r) { return multiply_overflows(x, y, r); }
int zeros(unsigned bits) { return trailing_zeros(bits); }
static Wide wide(uint64_t low, uint64_t high) { return wide_sum(wide_of(low), wide_left(wide_of(high), 64)); }
static void split(Wide a, uint64_t* out) { out[0] = wide_low(a); out[1] = wide_high(a); }
void sum(uint64_t a, uint64_t b, uint64_t c, uint64_t d, uint64_t* out) { split(wide_sum(wide(a, b), wide(c, d)), out); }
void left(uint64_t a, uint64_t b, int shift, uint64_t* out) { split(wide_left(wide(a, b), shift), out); }
void right(uint64_t a, uint64_t b, int shift, uint64_t* out) { split(wide_right(wide(a, b), shift), out); }
double nearest(uint64_t a, uint64_t b) { return wide_double(wide(a, b)); }
double total(const double* x, int n) {
    Sum s = sum_of(x[0]);
    for (int i = 1; i < n; i++) s = add_term(s, x[i]);
    return rounded(s);
}
double seconds(void) { return monotonic_seconds(); }
"""
EDGES = [
    0,
    1,
    -1,
    2,
    -2,
    3037000499,
    -3037000500,
    2**62,
    -(2**62),
    2**63 - 1,
    -(2**63 - 1),
    -(2**63),
]

pytestmark = pytest.mark.skipif(COMPILER is None, reason="needs a C compiler")


@pytest.fixture(scope="module")
def twins(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder = tmp_path_factory.mktemp("twins")
    source, library = folder / "twins.c", folder / "twins.so"
    source.write_text(WRAPPERS, encoding="utf-8")
    options = [
        "-std=c11",
        "-D_POSIX_C_SOURCE=199309L",
        "-Werror",
        "-DSYMCHECK_PORTABLE",
        "-O2",
        "-fPIC",
        "-shared",
        "-ffp-contract=off",
    ]
    subprocess.run(
        [COMPILER, *options, f"-I{HEADERS}", str(source), "-o", str(library), "-lm"], check=True
    )
    out = ctypes.CDLL(str(library))
    for name in ("add", "subtract", "multiply"):
        getattr(out, name).argtypes = [ctypes.c_longlong] * 2 + [ctypes.c_void_p]
    words = [ctypes.c_uint64] * 2
    out.sum.argtypes = [*words, *words, ctypes.c_void_p]
    out.left.argtypes = out.right.argtypes = [*words, ctypes.c_int, ctypes.c_void_p]
    out.nearest.argtypes = words
    out.nearest.restype = out.total.restype = out.seconds.restype = ctypes.c_double
    return out


def halves(x: int) -> tuple[int, int]:
    return x & (2**64 - 1), x >> 64


def test_an_operation_overflows_where_its_result_is_no_int64(twins: ctypes.CDLL) -> None:
    draw = random.Random(1)
    numbers = EDGES + [
        draw.getrandbits(draw.randrange(1, 64)) * draw.choice([1, -1]) for _ in range(40)
    ]
    result = ctypes.c_longlong()
    for x in numbers:
        for y in numbers:
            for name, exact in (("add", x + y), ("subtract", x - y), ("multiply", x * y)):
                overflows = getattr(twins, name)(x, y, ctypes.byref(result))
                assert bool(overflows) == (not -(2**63) <= exact < 2**63), (name, x, y)
                assert overflows or result.value == exact, (name, x, y)


def test_the_lowest_bit_of_each_byte_is_found(twins: ctypes.CDLL) -> None:
    assert [twins.zeros(bits) for bits in range(1, 256)] == [
        (b & -b).bit_length() - 1 for b in range(1, 256)
    ]


def test_integers_of_128_bits(twins: ctypes.CDLL) -> None:
    draw = random.Random(2)
    out = (ctypes.c_uint64 * 2)()
    for _ in range(2000):
        a, b = (draw.getrandbits(draw.randrange(1, 127)) for _ in "ab")
        twins.sum(*halves(a), *halves(b), out)
        assert out[0] + (out[1] << 64) == a + b
        shift = draw.randrange(128)
        twins.right(*halves(a), shift, out)
        assert out[0] + (out[1] << 64) == a >> shift
        twins.left(*halves(a), shift, out)
        assert out[0] + (out[1] << 64) == (a << shift) % 2**128
        assert twins.nearest(*halves(a)) == float(a)
    half = (2**53 + 1) << 60  # halfway between two doubles, and just above
    assert twins.nearest(*halves(half)) == float(half)
    assert twins.nearest(*halves(half + 1)) == float(half + 1) > float(half)


def test_a_sum_of_many_terms_has_at_most_two_roundings(twins: ctypes.CDLL) -> None:
    """A plain sum of these would be off by hundreds of roundings."""
    draw = random.Random(3)
    for count in (2, 10, 5000):
        for _ in range(20):
            terms = [draw.random() * 2.0 ** draw.randrange(-40, 4) for _ in range(count)]
            exact = sum(map(Fraction, terms))
            got = twins.total((ctypes.c_double * count)(*terms), count)
            assert abs(Fraction(got) - exact) <= exact * Fraction(2, 2**53)
    assert twins.total((ctypes.c_double * 3)(1.7e308, 1.7e308, 1.0), 3) == math.inf


def test_the_clock_advances(twins: ctypes.CDLL) -> None:
    assert 0 < twins.seconds() <= twins.seconds()
