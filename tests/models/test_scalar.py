"""Scalar operations on floats."""

from __future__ import annotations

import math

import numpy as np
import pytest

from attitude_fmu.models import scalar


@pytest.mark.parametrize("angle", [0.0, 3.0, -math.pi, 3.2, -3.2, 100.0, -100.0])
def test_wrap_gives_the_same_direction_from_minus_pi_up_to_pi(angle: float) -> None:
    wrapped = scalar.wrap(angle)
    assert -math.pi <= wrapped < math.pi
    assert math.remainder(wrapped - angle, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-13)
    if -math.pi <= angle < math.pi:
        assert wrapped == angle


def test_where_and_limits_give_no_negative_zero() -> None:
    for value in (
        scalar.where(True, -0.0, 1.0),
        scalar.minimum(-0.0, 0.0),
        scalar.maximum(-0.0, 0.0),
        scalar.clip(-0.0, -0.0, 0.0),
    ):
        assert math.copysign(1.0, value) == 1.0


def test_rounding_is_half_up_on_both_sides() -> None:
    assert [scalar.round_half_up(x) for x in (-1.5, -0.5, 0.49, 0.5, 2.5)] == [-1.0, 0.0, 0.0, 1.0, 3.0]


def test_numpy_scalars_are_floats_too() -> None:
    x = np.float64(0.25)
    assert scalar.where(x > 0.0, x, 0.0) == 0.25
    assert scalar.both(x > 0.0, x < 1.0)
    assert scalar.either(x < 0.0, x < 1.0)
    assert scalar.sqrt(x) == 0.5


def test_select_takes_an_item_and_is_nothing_outside() -> None:
    assert [scalar.select(index, (3.0, -0.0, 5.0)) for index in (-1.0, 0.0, 1.0, 2.0, 3.0)] == [0.0, 3.0, 0.0, 5.0, 0.0]
    assert math.copysign(1.0, scalar.select(1.0, (3.0, -0.0))) == 1.0
