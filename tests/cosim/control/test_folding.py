"""What is cut from a fold never changes its response."""

from __future__ import annotations

import control
import numpy as np
import pytest

from attitude_fmu.cosim.control import LinearisationRefusedError, model_ss, operating_point
from attitude_fmu.cosim.control.folding import SAME, Slim, difference, reduced, without_sums

ADIS = "AttitudeSensor_ADIS16354_150"
WORD = 1.0 / 819.2


@pytest.mark.parametrize("samples", [1, 15, 16, 17, 24, 31, 33, 100])
def test_a_delay_line_is_kept_whole_however_long(samples: int) -> None:
    A, B, C = np.eye(samples, k=-1), np.eye(samples)[:, :1], np.eye(samples)[-1:]
    cut = reduced(A, B, C, np.zeros(1))
    np.testing.assert_array_equal(cut.states, np.arange(samples))
    np.testing.assert_array_equal(cut.outputs, [0])


def test_a_share_below_rounding_is_cut_and_one_above_it_is_not() -> None:
    A, C = np.diag([0.5, 0.6]), np.ones((1, 2))
    for share, kept in ((1e-15, [0]), (1e-11, [0, 1])):
        np.testing.assert_array_equal(reduced(A, np.array([[1.0], [share]]), C, np.zeros(1)).states, kept)


def test_a_mode_that_grows_slowly_counts_by_what_it_grows_to() -> None:
    """A speed of 1e-15 a step is a way of 8e-12 after 8192 of them, beside a lag of 1."""
    A = np.array([[0.5, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    B, C = np.array([[1.0], [0.0], [1e-15]]), np.array([[1.0, 1.0, 0.0]])
    np.testing.assert_array_equal(reduced(A, B, C, np.zeros(1)).states, [0, 1, 2])


def test_the_guard_sees_a_state_too_few() -> None:
    A, B, C = np.eye(3, k=-1), np.eye(3)[:, :1], np.array([[0.0, 1.0, 1e-4]])
    assert difference(A, B, C, without_sums(A, B, C)) < SAME
    less = Slim(np.arange(2), A[:2, :2], B[:2], C[:, :2])
    assert difference(A, B, C, less) == pytest.approx(1e-4, rel=0.2)


def rate_path(taps: int) -> control.StateSpace:
    filters = {f"{part}.filter": f"bartlett_{taps}" for part in ("gyro", "accelerometer")}
    parameters = {"processor.period": WORD, "gyro.range": np.radians(300.0), **filters}
    point = operating_point(ADIS, WORD, parameters, settle=0.5)
    return model_ss(ADIS, WORD, operating_point=point, inputs="rate[1]", outputs="rate_measured[1]")


@pytest.fixture(scope="module")
def without_taps() -> control.StateSpace:
    return rate_path(1)


@pytest.mark.parametrize("taps", [2, 4, 8, 16, 32, 64])
def test_every_bartlett_setting_is_two_moving_averages_in_a_row(taps: int, without_taps: control.StateSpace) -> None:
    """((1 + z^-1 + ... + z^-(n-1))/n)^2 times the response without one, to rounding."""
    system = rate_path(taps)
    for frequency in (0.5, 5.0, 40.0, 150.0):
        z = np.exp(2j * np.pi * frequency * WORD)
        average = np.mean(z ** -np.arange(taps))
        np.testing.assert_allclose(system(z), average**2 * without_taps(z), rtol=1e-9, atol=1e-11)


def test_a_cut_that_changes_the_response_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("attitude_fmu.cosim.control.linear.SAME", -1.0)
    with pytest.raises(LinearisationRefusedError, match="leaving out idle states changes"):
        model_ss("GimbalController", 0.001, inputs="rate", outputs="motor_torque")
