"""The continuous model has the frequency response of the discrete one, in the band that its page gives."""

from __future__ import annotations

import control
import numpy as np
import pytest

from attitude_fmu.cosim.control import LinearisationRefusedError, continuous_ss, model_ss

SENSOR = "AttitudeSensor_ADXRS450_ADXL355"


def ratio(system: control.StateSpace, frequency: float, order: int = 2) -> complex:
    """Continuous over discrete response of the only channel, at a part of the sampling rate."""
    w = 2.0 * np.pi * frequency / system.dt
    return complex(np.squeeze(continuous_ss(system, order)(1j * w) / system(np.exp(1j * w * system.dt))))


def test_a_delay_is_a_pade_approximation_of_each_step() -> None:
    """Gain one everywhere; the phase is short by 2 (w T)^3/12 for order 1, 2 (w T)^5/720 for order 2."""
    two = control.ss(control.tf([1.0], [1.0, 0.0, 0.0], 0.01))
    x = 2.0 * np.pi * 0.05
    for order, short in ((1, x**3 / 12.0), (2, x**5 / 720.0)):
        found = ratio(two, 0.05, order)
        assert abs(found) == pytest.approx(1.0, abs=1e-12)
        assert np.angle(found) == pytest.approx(2.0 * short, rel=0.05)


def test_an_integrator_is_one_with_half_a_step_of_delay() -> None:
    """Right in phase, in gain too large by x/2 over sin(x/2) less 1, x = w T."""
    summed = control.ss([[1.0]], [[1.0]], [[1.0]], [[0.0]], 0.02)
    for frequency in (0.01, 0.05, 0.1):
        x = 2.0 * np.pi * frequency
        found = ratio(summed, frequency, 4)
        assert np.angle(found) == pytest.approx(0.0, abs=1e-6)
        assert abs(found) == pytest.approx(np.sin(x / 2.0) / (x / 2.0), rel=1e-6)


def test_oscillation_and_lag_keep_their_poles() -> None:
    poles = [-0.3 + 5.0j, -0.3 - 5.0j, -2.0]
    sampled = control.c2d(control.ss(control.zpk([], poles, 1.0)), 0.02)
    np.testing.assert_allclose(sorted(continuous_ss(sampled).poles(), key=abs)[:3], sorted(poles, key=abs), atol=1e-6)


@pytest.mark.parametrize(
    ("outputs", "band", "gain", "phase"),
    [("rate_measured[1]", 0.2, 0.02, 1.0), ("euler.pitch", 0.1, 0.02, 1.0)],
)
def test_the_sensors_continuous_model_holds_in_the_band_that_is_said(
    outputs: str, band: float, gain: float, phase: float
) -> None:
    system = model_ss(SENSOR, 0.002, inputs="rate[1]", outputs=outputs)
    for frequency in np.linspace(0.002, band, 12):
        found = ratio(system, float(frequency))
        assert abs(found) == pytest.approx(1.0, abs=gain)
        assert np.degrees(np.angle(found)) == pytest.approx(0.0, abs=phase)


def test_it_is_as_stable_as_the_discrete_one_and_keeps_the_names() -> None:
    system = model_ss(SENSOR, 0.002, inputs="rate", outputs="rate_measured")
    continuous = continuous_ss(system, 3)
    assert max(continuous.poles().real) < 0.0
    assert continuous.isctime(strict=True)
    assert (continuous.input_labels, continuous.output_labels) == (system.input_labels, system.output_labels)


def test_what_has_no_continuous_form_is_refused() -> None:
    ringing = control.ss([[-0.8]], [[1.0]], [[1.0]], [[0.0]], 0.1)
    with pytest.raises(LinearisationRefusedError, match=r"z = -0\.8"):
        continuous_ss(ringing)
    with pytest.raises(LinearisationRefusedError, match="sampling time"):
        continuous_ss(control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]]))
    with pytest.raises(LinearisationRefusedError, match="order = 0"):
        continuous_ss(ringing, 0)
