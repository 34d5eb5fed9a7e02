"""The papers' angle filters."""

from __future__ import annotations

import math

import numpy as np
import pytest

from attitude_fmu.models.filters.kalman import KalmanParameters, kalman_filtered
from attitude_fmu.models.filters.rc import rc_filtered


def test_rc_leaves_white_noise_of_the_papers_size() -> None:
    # y += (x - y)/num leaves sigma sqrt(1/(2 num - 1)): 1.36 deg through num = 100 gives 0.096 deg
    noise, y, kept = np.random.default_rng(1).normal(size=200_000) * math.radians(1.36), 0.0, []
    for x in noise.tolist():
        y = rc_filtered(y, x, 100.0)
        kept.append(y)
    # 200 samples of correlation: 1000 independent ones, variance known to sqrt(2/1000) = 4.5 %, 4 sigma of the rms 9 %
    assert math.degrees(np.std(kept[1000:])) == pytest.approx(1.36 / math.sqrt(199.0), rel=0.09)


def test_kalman_is_the_best_average_while_nothing_changes() -> None:
    # Q = 0: after n measurements the estimate is their mean and its variance R/(n + 1)
    p = KalmanParameters()
    y, variance = 0.2, p.R
    samples = np.random.default_rng(2).normal(size=50) * 0.01
    for x in samples.tolist():
        y, variance = kalman_filtered(y, variance, x, 0.0, p.R)
    assert y == pytest.approx((0.2 + samples.sum()) / 51.0, rel=1e-12)
    assert variance == pytest.approx(p.R / 51.0, rel=1e-12)


@pytest.mark.parametrize("start", [3.1, -3.1])
def test_both_go_the_short_way_round(start: float) -> None:
    for y in (rc_filtered(start, -start, 2.0), kalman_filtered(start, 1.0, -start, 1.0, 1.0)[0]):
        assert abs(y) >= 3.1
        assert -math.pi <= y < math.pi
