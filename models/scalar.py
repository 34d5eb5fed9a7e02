"""Scalar operations that serve floats and CasADi symbols alike, equal to the last bit.

A model function calls these instead of `math`, so that one source runs as Python and is traced to C.
Arithmetic operators and comparisons need no help; a choice that depends on a signal is `where`, never ``if``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

Scalar = Any  # float, or casadi.SX while tracing

PI = math.pi
_NUMBER = (float, int)
_LARGEST_EXPONENT = 709.782712893384
"""Beyond it exp leaves the range of doubles."""


def _symbols() -> Any:
    import casadi  # only ever reached with symbols in hand

    return casadi


def _is_symbol(x: Any) -> bool:
    return hasattr(x, "is_symbolic")


def where(condition: Scalar, a: Scalar, b: Scalar) -> Scalar:
    """``a if condition else b`` for a comparison; both are evaluated, so make denominators and roots safe before.

    The added zero turns -0.0 into 0.0, as CasADi's sum of two gated terms does.
    """
    if condition is True:
        return a + 0.0
    if condition is False:
        return b + 0.0
    if _is_symbol(condition):
        return _symbols().if_else(condition, a, b)
    return (a if condition else b) + 0.0


def select(index: Scalar, items: Sequence[Scalar]) -> Scalar:
    """``items[index]`` of a whole number, counted from 0; 0 outside."""
    if isinstance(index, _NUMBER):
        return items[int(index)] + 0.0 if 0 <= index < len(items) else 0.0
    casadi = _symbols()
    gated = [casadi.SX.binary(casadi.OP_IF_ELSE_ZERO, index == i, item) for i, item in enumerate(items)]
    return sum(gated, 0.0)


def both(a: Scalar, b: Scalar) -> Scalar:
    """Logical and of two conditions."""
    if a is False or b is False:
        return False
    if a is True:
        return b
    if _is_symbol(a) or _is_symbol(b):
        return _symbols().logic_and(a, b)
    return bool(a) and bool(b)


def either(a: Scalar, b: Scalar) -> Scalar:
    """Logical or of two conditions."""
    if _is_symbol(a) or _is_symbol(b):
        return _symbols().logic_or(a, b)
    return bool(a) or bool(b)


def sqrt(x: Scalar) -> Scalar:
    """Square root; outside their domains this and the next four give what C gives, where `math` would raise."""
    if isinstance(x, _NUMBER):
        return math.sqrt(x) if x >= 0.0 else math.nan
    return x.sqrt()


def sin(x: Scalar) -> Scalar:
    if isinstance(x, _NUMBER):
        return math.sin(x) if abs(x) < math.inf else math.nan
    return x.sin()


def cos(x: Scalar) -> Scalar:
    if isinstance(x, _NUMBER):
        return math.cos(x) if abs(x) < math.inf else math.nan
    return x.cos()


def exp(x: Scalar) -> Scalar:
    if isinstance(x, _NUMBER):
        return math.exp(x) if x <= _LARGEST_EXPONENT else x * math.inf
    return x.exp()


def log(x: Scalar) -> Scalar:
    if isinstance(x, _NUMBER):
        return math.log(x) if x > 0.0 else -math.inf if x == 0.0 else math.nan
    return x.log()


def atan2(y: Scalar, x: Scalar) -> Scalar:
    if isinstance(y, _NUMBER) and isinstance(x, _NUMBER):
        return math.atan2(y, x)
    return _symbols().atan2(y, x)


def floor(x: Scalar) -> Scalar:
    if isinstance(x, _NUMBER):
        return x // 1.0 if abs(x) < math.inf else x  # C's floor leaves an infinity what it is, // makes it NaN
    return x.floor()


def absolute(x: Scalar) -> Scalar:
    return abs(x) if isinstance(x, _NUMBER) else x.fabs()


def hypot(x: Scalar, y: Scalar) -> Scalar:
    """sqrt(x^2 + y^2), written out: libm's hypot rounds differently from platform to platform."""
    return sqrt(x * x + y * y)


def minimum(a: Scalar, b: Scalar) -> Scalar:
    """The smaller; zeros come out positive, which of two signed zeros is smaller being up to the platform."""
    if isinstance(a, _NUMBER) and isinstance(b, _NUMBER):
        return (a if a < b else b) + 0.0
    return _symbols().fmin(a, b) + 0.0


def maximum(a: Scalar, b: Scalar) -> Scalar:
    """The larger; zeros come out positive."""
    if isinstance(a, _NUMBER) and isinstance(b, _NUMBER):
        return (a if a > b else b) + 0.0
    return _symbols().fmax(a, b) + 0.0


def clip(x: Scalar, low: Scalar, high: Scalar) -> Scalar:
    """x limited to low..high."""
    return minimum(maximum(x, low), high)


_rounded: ContextVar[Callable[[Scalar], Scalar] | None] = ContextVar("rounding of symbols", default=None)


@contextmanager
def rounding_of_symbols(rounded: Callable[[Scalar], Scalar]) -> Iterator[None]:
    """Within it `round_half_up` of a symbol is ``rounded(x)``: a linear model lets signals pass there."""
    token = _rounded.set(rounded)
    try:
        yield
    finally:
        _rounded.reset(token)


def round_half_up(x: Scalar) -> Scalar:
    """Nearest whole number, halves upwards: floor(x + 1/2)."""
    if not isinstance(x, _NUMBER) and (rounded := _rounded.get()) is not None:
        return rounded(x)
    return floor(x + 0.5)


def wrap(angle: Scalar) -> Scalar:
    """Angle brought to -pi (included) .. pi (not), exact where it already lies there."""
    turns = floor((angle + PI) / (2.0 * PI))
    return angle - 2.0 * PI * turns
