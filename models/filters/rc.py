"""First-order RC filter: y <- y + (x - y)/num (Jing & Gao 2021, eq. 19)."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Real
from ..scalar import Scalar, wrap


class RcParameters(NamedTuple):
    """The filter's one number."""

    num: Annotated[
        float, Real("1", "samples over which the filter follows; large is smooth and slow", min=1.0, tunable=True)
    ] = 100.0


def rc_filtered(y: Scalar, angle: Scalar, num: Scalar) -> Scalar:
    """y + (x - y)/num on the circle, in -pi..pi."""
    return wrap(y + wrap(angle - y) / num)
