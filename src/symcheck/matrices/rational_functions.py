"""Rational functions of parameters, as weights of transitions: elements of a field.

A function is a polynomial over Q divided by a product of known factors. Sums multiply by missing
factors only, and a numerator is divided by a factor again where that is exact, so that there are
few greatest common divisors (Jansen et al., 2014, 'Accelerating parametric probabilistic
verification').

Functions have no order, and algorithms that compare them (policy iteration, signs of rewards) are
executed symbolically: a comparison is decided at a sample point, and the sign that was found is
noted as a condition. A result holds wherever all conditions do.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from math import gcd, inf, isfinite, isnan, lcm
from typing import Any

from symcheck.direction import Direction
from symcheck.errors import UnsupportedError, UsageError

__all__ = ["FunctionField", "Polynomial", "RationalFunction", "point_of", "to_fraction"]

Polynomial = Any
"""A flint.fmpq_mpoly (FLINT has no types)."""

Denominator = tuple[tuple[int, int], ...]
"""Numbers of factors, in order, and their exponents."""

_LARGEST_FACTORED = 40
"""Denominators up to this degree are factored completely; beyond, that may take seconds."""


class FunctionField:
    """The rational functions of some parameters, and what is known about the region of interest.

    Attributes:
        names: the parameters.
        factors: the polynomials that divide.
        conditions: products of polynomials that were compared with 0, and the signs that they have
            at the sample point (0: the sample lies on a border), by their texts.
        lifting: a box and a direction: then equations are solved for bounds over the box (see
            `symcheck.numerics.linear.lifting`), instead of functions.
    """

    def __init__(self, names: Sequence[str]) -> None:
        import flint

        self.names = tuple(names)
        self.ring = flint.fmpq_mpoly_ctx.get(self.names, "degrevlex")
        self.factors: list[Polynomial] = []
        self.conditions: dict[str, tuple[tuple[Polynomial, ...], int]] = {}
        self._point: tuple[Any, ...] = ()
        self.epoch = 0
        self.lifting: tuple[Mapping[str, tuple[Fraction, Fraction]], Direction] | None = None

    def __repr__(self) -> str:
        return f"<FunctionField of {', '.join(self.names)}>"

    def of(self, function: RationalFunction) -> RationalFunction:
        """A function of this field or, of the same parameters, of another one: its factors differ.

        Raises UsageError: it has other parameters.
        """
        other = function.field
        if other is self:
            return function
        if other.names != self.names:
            raise UsageError(
                f"functions of {_listed(self.names)} and {_listed(other.names)} differ"
            )
        below = RationalFunction(self, other.product(function.bottom), ())
        return RationalFunction(self, function.top, ()) / below

    def sample(self, point: Mapping[str, Fraction]) -> None:
        """Choose another sample point, and forget the conditions."""
        import flint

        values = (point[name] for name in self.names)
        self._point = tuple(flint.fmpq(v.numerator, v.denominator) for v in values)
        self.conditions.clear()
        self.epoch += 1

    def constant(self, value: Fraction | int) -> RationalFunction:
        """A number as a function."""
        return RationalFunction(self, self.polynomial(value), ())

    def polynomial(self, value: Fraction | int) -> Polynomial:
        """A number as a polynomial."""
        import flint

        return self.ring.constant(flint.fmpq(value.numerator, value.denominator))

    def parameter(self, name: str) -> RationalFunction:
        """A parameter as a function."""
        return RationalFunction(self, self.ring.gen(self.names.index(name)), ())

    def at_sample(self, polynomial: Polynomial) -> Fraction:
        """The value of a polynomial at the sample point."""
        return to_fraction(polynomial(*self._point))

    def factored(self, polynomial: Polynomial) -> tuple[Any, Denominator]:
        """A polynomial other than 0 as a number times factors."""
        exponents: dict[int, int] = {}
        for i, factor in enumerate(self.factors):
            polynomial, exponent = _divided(polynomial, factor, inf)
            if exponent:
                exponents[i] = exponent
        if polynomial.is_constant():
            return polynomial.leading_coefficient(), tuple(exponents.items())
        if polynomial.total_degree() <= _LARGEST_FACTORED:
            scale, parts = polynomial.factor()
        else:
            scale, parts = 1, [(polynomial, 1)]
        for part, exponent in parts:
            leading = part.leading_coefficient()
            scale *= leading ** int(exponent)
            exponents[len(self.factors)] = int(exponent)
            self.factors.append(part / leading)
        return scale, tuple(exponents.items())

    def product(self, denominator: Iterable[tuple[int, int]]) -> Polynomial:
        """The product of factors."""
        out = self.ring.constant(1)
        for i, exponent in denominator:
            out *= self.factors[i] ** exponent
        return out

    def note(self, parts: Iterable[Polynomial], sign: int) -> None:
        """Take note of the sign of a product of polynomials."""
        kept = []
        for part in parts:
            leading = part.leading_coefficient()
            sign = -sign if leading < 0 else sign
            if not part.is_constant():
                kept.append(part / leading)
        if kept:
            self.conditions[" * ".join(map(str, kept))] = tuple(kept), sign


class RationalFunction:
    """A rational function of parameters: an element of a `FunctionField`, and immutable.

    `f(p=Fraction(1, 3))` evaluates it; `derivative`, `numerator` and `denominator` are polynomials
    or functions, and `to_sympy` gives an expression. `+ - * / **` and `==` are those of the field;
    a float beside a function is the decimal that it is shown as. `<` and `>` compare at the field's
    sample point, and note the condition.
    """

    __slots__ = ("_hash", "_value", "bottom", "field", "top")

    def __init__(self, field: FunctionField, top: Polynomial, bottom: Denominator) -> None:
        self.field = field
        self.top = top
        self.bottom = bottom
        self._value: tuple[int, Fraction] | None = None
        self._hash: int | None = None

    # ------------------------------------------------------------------------------------ the field

    def __bool__(self) -> bool:
        return not self.top.is_zero()

    def _other(self, other: object) -> RationalFunction | None:
        if isinstance(other, RationalFunction):
            return self.field.of(other)
        if isinstance(other, int | Fraction):
            return self.field.constant(other)
        if isinstance(other, float) and isfinite(other):
            return self.field.constant(Fraction(str(other)))
        if type(other).__name__ == "fmpq":
            return self.field.constant(to_fraction(other))
        return None

    def __add__(self, other: object) -> RationalFunction:
        g = self._other(other)
        if g is None:
            return NotImplemented
        if not g.top:
            return self
        if not self.top:
            return g
        if self.bottom == g.bottom:
            return _reduced(self.field, self.top + g.top, self.bottom)
        a, b = dict(self.bottom), dict(g.bottom)
        common = tuple((i, max(a.get(i, 0), b.get(i, 0))) for i in sorted(a.keys() | b.keys()))
        missing = self.field.product([(i, n - a.get(i, 0)) for i, n in common if n > a.get(i, 0)])
        others = self.field.product([(i, n - b.get(i, 0)) for i, n in common if n > b.get(i, 0)])
        return _reduced(self.field, self.top * missing + g.top * others, common)

    __radd__ = __add__

    def __neg__(self) -> RationalFunction:
        return RationalFunction(self.field, -self.top, self.bottom)

    def __sub__(self, other: object) -> RationalFunction:
        g = self._other(other)
        return NotImplemented if g is None else self + -g

    def __rsub__(self, other: object) -> RationalFunction:
        return -self + other

    def __mul__(self, other: object) -> RationalFunction:
        g = self._other(other)
        if g is None:
            return NotImplemented
        if not self.bottom and not g.bottom:
            return RationalFunction(self.field, self.top * g.top, ())
        f = _reduced(self.field, self.top, g.bottom)
        h = _reduced(self.field, g.top, self.bottom)
        exponents = dict(f.bottom)
        for i, n in h.bottom:
            exponents[i] = exponents.get(i, 0) + n
        return RationalFunction(self.field, f.top * h.top, tuple(sorted(exponents.items())))

    __rmul__ = __mul__

    def __truediv__(self, other: object) -> RationalFunction:
        g = self._other(other)
        return NotImplemented if g is None else self * g.inverse()

    def __rtruediv__(self, other: object) -> RationalFunction:
        return self.inverse() * other

    def __pow__(self, exponent: float | Fraction) -> RationalFunction:
        if exponent % 1:
            raise UnsupportedError("only whole powers of parameters are rational functions")
        exponent = int(exponent)
        if exponent < 0:
            return self.inverse() ** -exponent
        bottom = tuple((i, n * exponent) for i, n in self.bottom) if exponent else ()
        return RationalFunction(self.field, self.top**exponent, bottom)

    def inverse(self) -> RationalFunction:
        """One divided by the function. Raises ZeroDivisionError if it is 0."""
        if not self.top:
            raise ZeroDivisionError("division by the function 0")
        scale, factors = self.field.factored(self.top)
        return RationalFunction(
            self.field, self.field.product(self.bottom) / scale, tuple(sorted(factors))
        )

    # ------------------------------------------------------------------------------------ the order

    @property
    def value(self) -> Fraction:
        """The value at the field's sample point."""
        if self._value is None or self._value[0] != self.field.epoch:
            found = self.field.at_sample(self.top)
            for i, n in self.bottom:
                found /= self.field.at_sample(self.field.factors[i]) ** n
            self._value = self.field.epoch, found
        return self._value[1]

    def __eq__(self, other: object) -> bool:
        if isinstance(other, RationalFunction) and other.field.names != self.field.names:
            return False
        g = self._other(other)
        if g is None:
            return False
        return (self.bottom == g.bottom and self.top == g.top) or not (self - g).top

    def __hash__(self) -> int:
        """That of the value at one point, the same in all fields of as many parameters."""
        if self._hash is None:
            try:
                self._hash = hash(
                    self._at(Fraction(997, 1010 + i) for i in range(len(self.field.names)))
                )
            except ZeroDivisionError:
                self._hash = 0
        return self._hash

    @property
    def sign_parts(self) -> tuple[Polynomial, ...]:
        """Polynomials whose product has the sign of the function."""
        return self.top, *(self.field.factors[i] for i, n in self.bottom if n % 2)

    def _sign(self, other: object) -> int:
        """The sign of the difference at the sample point, which becomes a condition."""
        if isinstance(other, float) and not isfinite(other):
            if isnan(other):
                raise UsageError("NaN is neither above nor below a function")
            return -1 if other > 0 else 1
        difference = self - other
        sign = (difference.value > 0) - (difference.value < 0)
        if difference.top:
            self.field.note(difference.sign_parts, sign)
        return sign

    def __lt__(self, other: object) -> bool:
        return self._sign(other) < 0

    def __gt__(self, other: object) -> bool:
        return self._sign(other) > 0

    def __le__(self, other: object) -> bool:
        return self._sign(other) <= 0

    def __ge__(self, other: object) -> bool:
        return self._sign(other) >= 0

    def __float__(self) -> float:
        raise UnsupportedError(
            f"{self!s:.60} is a function of parameters, and no number",
            hint=f"f({', '.join(f'{name}=0.5' for name in self.field.names)}) evaluates it",
        )

    # ------------------------------------------------------------------------------------- analysis

    @property
    def numerator(self) -> Polynomial:
        """The numerator, with integer coefficients without common divisor (a FLINT polynomial)."""
        return self._whole()[0]

    @property
    def denominator(self) -> Polynomial:
        """The denominator, with integer coefficients without common divisor."""
        return self._whole()[1]

    def _whole(self) -> tuple[Polynomial, Polynomial]:
        """Both with integer coefficients; the leading one of the denominator is positive."""
        below = self.field.product(self.bottom)
        parts = [[to_fraction(c) for c in p.coeffs()] for p in (self.top, below)]
        scale = lcm(*(c.denominator for part in parts for c in part))
        divisor = gcd(*(int(c * scale) for part in parts for c in part)) or 1
        factor = Fraction(scale, divisor)
        if parts[1] and parts[1][0] < 0:
            factor = -factor
        unit = self.field.polynomial(factor)
        return self.top * unit, below * unit

    def __call__(self, **values: Fraction | float | str) -> Fraction:
        """The exact value at a point: `f(p=0.25, q="1/3")`; decimals are what they look like.

        Raises:
            ZeroDivisionError: the denominator is 0 there.
            UsageError: a parameter has no value, or a value belongs to none or is no number.
        """
        return self._at(point_of(self.field.names, values).values())

    def _at(self, values: Iterable[Fraction]) -> Fraction:
        """The value at a point, in the order of the parameters."""
        import flint

        point = [flint.fmpq(v.numerator, v.denominator) for v in values]
        out = to_fraction(self.top(*point))
        for i, n in self.bottom:
            out /= to_fraction(self.field.factors[i](*point)) ** n
        return out

    def derivative(self, name: str) -> RationalFunction:
        """The partial derivative by a parameter. Raises UsageError: there is none of this name."""
        field = self.field
        if name not in field.names:
            raise UsageError(f"{name} is no parameter; there are {_listed(field.names)}")
        by = field.names.index(name)
        out = RationalFunction(field, self.top.derivative(by), self.bottom)
        for i, n in self.bottom:
            inner = _reduced(field, field.factors[i].derivative(by) * -n, ((i, 1),))
            out = out + self * inner
        return out

    def to_sympy(self) -> Any:
        """The function as an expression of sympy, which has to be installed."""
        try:
            import sympy
        except ImportError:
            hint = "pip install sympy"
            raise UnsupportedError("this needs sympy, which is not installed", hint=hint) from None
        return sympy.sympify(
            str(self).replace("^", "**"), {n: sympy.Symbol(n) for n in self.field.names}
        )

    def __str__(self) -> str:
        above, below = (str(p).replace(" ", "") for p in self._whole())
        if below == "1":
            return above
        above = f"({above})" if "+" in above or "-" in above[1:] else above
        return f"{above}/{below}" if below.isalnum() else f"{above}/({below})"

    def __repr__(self) -> str:
        return f"<RationalFunction {self}>"


def to_fraction(value: Any) -> Fraction:
    """A rational number of FLINT as a Fraction."""
    return Fraction(int(value.numerator), int(value.denominator))


def point_of(names: Iterable[str], values: Mapping[str, object]) -> dict[str, Fraction]:
    """The values of parameters, in their order, as exact numbers.

    Raises UsageError: a parameter has no value, or a value belongs to none or is no number.
    """
    names = tuple(names)
    if unknown := [name for name in values if name not in names]:
        raise UsageError(f"{_listed(unknown)} is no parameter; there are {_listed(names)}")
    if missing := [name for name in names if name not in values]:
        raise UsageError(f"parameter {_listed(missing)} has no value")
    try:
        return {n: v if isinstance(v := values[n], Fraction) else Fraction(str(v)) for n in names}
    except (ValueError, ZeroDivisionError):
        shown = ", ".join(f"{n}={v!r}" for n, v in values.items())
        raise UsageError(f"a value of {shown} is no finite number") from None


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names)


def _divided(polynomial: Polynomial, factor: Polynomial, most: float) -> tuple[Polynomial, int]:
    """A polynomial other than 0 divided by a factor as often as that is exact, and how often."""
    from flint.utils.flint_exceptions import DomainError

    exponent = 0
    try:
        while exponent < most:
            polynomial = polynomial / factor
            exponent += 1
    except DomainError:
        pass
    return polynomial, exponent


def _reduced(
    field: FunctionField, top: Polynomial, bottom: Iterable[tuple[int, int]]
) -> RationalFunction:
    """A quotient without the factors that both sides have."""
    left = []
    for i, exponent in bottom if top else ():
        top, times = _divided(top, field.factors[i], exponent)
        if times < exponent:
            left.append((i, exponent - times))
    return RationalFunction(field, top, tuple(left))
