"""The continuous model has the frequency response of the discrete one, in the band that its page gives."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import control
import numpy as np
import pytest

from attitude_fmu.cosim.control import LinearisationRefusedError, continuous_ss, model_ss
from attitude_fmu.cosim.control.folding import without_sums

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


POLES = (-0.95, -0.5, 0.05, 0.21, 0.3, 0.45, 0.59, 0.61, 0.75, 0.89, 0.91, 0.99, 1.0)


def chain(poles: Sequence[float]) -> control.StateSpace:
    """Poles in a row, each a group of its own."""
    parts = [control.ss([[pole]], [[1.0]], [[1.0]], [[0.0]], 0.01) for pole in poles]
    return reduce(control.series, parts)


@pytest.mark.parametrize("pole", POLES)
def test_a_pole_is_exact_at_rest_and_in_phase_wherever_it_lies(pole: float) -> None:
    """Gain too small by at most x^2/24 in this direction, phase wrong by third order only: below 0.02 deg."""
    system = chain([pole])
    for frequency in (0.001, 0.01, 0.05, 0.1):
        x = 2.0 * np.pi * frequency
        found = ratio(system, frequency)
        assert -(x**2) / 24.0 - 1e-6 < abs(found) - 1.0 < 2e-4
        assert np.degrees(np.angle(found)) == pytest.approx(0.0, abs=0.02)
    assert np.squeeze(ratio(system, 1e-7)) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("poles", [(0.3, 0.5), (0.59, 0.61), (0.19, 0.21), (0.9, 0.9, 0.9), (1.0, 1.0), (0.4, 0.9)])
def test_poles_in_a_row_are_as_exact_as_each_of_them(poles: Sequence[float]) -> None:
    """As states one after the other; in the one group of a companion form the errors come with the poles' residues.

    A slow pole's gain is wrong by x^2/24, 0.016 at a tenth; 0.9 beside 0.4 has a residue of twice the sum, at 90 deg.
    """
    together = control.ss(control.tf([1.0], np.poly(poles), 0.01))
    for system, phase in ((chain(poles), 0.05), (together, 1.5)):
        for frequency in (0.01, 0.05, 0.1):
            x = 2.0 * np.pi * frequency
            found = ratio(system, frequency)
            assert abs(found) == pytest.approx(1.0, abs=len(poles) * x**2 / 24.0 + 1e-3)
            assert np.degrees(np.angle(found)) == pytest.approx(0.0, abs=phase)


def turned(system: control.StateSpace) -> control.StateSpace:
    """In other coordinates, where nothing shows what its poles are."""
    turn, _ = np.linalg.qr(np.random.default_rng(0).standard_normal(system.A.shape))
    return control.ss(turn @ system.A @ turn.T, turn @ system.B, system.C @ turn.T, system.D, system.dt, name="turned")


@pytest.mark.parametrize("samples", [10, 50, 200])
def test_a_long_delay_stays_one(samples: int) -> None:
    """A Jordan block: its computed poles lie on a circle of radius eps^(1/n), 0.83 for 200 samples."""
    late = control.ss(control.tf([1.0], [1.0] + [0.0] * samples, 0.01))
    for frequency in (0.01, 0.05):
        short = samples * (2.0 * np.pi * frequency) ** 5 / 720.0
        assert ratio(late, frequency) == pytest.approx(np.exp(1j * short), abs=0.05 * short + 1e-9)


def test_what_rounding_hides_is_refused_by_name_and_never_answered_wrongly() -> None:
    late = control.ss(control.tf([1.0], [1.0] + [0.0] * 50, 0.01))
    assert ratio(turned(late), 0.02) == pytest.approx(1.0, abs=1e-3)
    longer = control.ss(control.tf([1.0], [1.0] + [0.0] * 200, 0.01))
    with pytest.raises(LinearisationRefusedError, match=r"turned: .* y\[0\] misses .* 200 states"):
        continuous_ss(turned(longer))


def test_bartlett_filters_of_the_sensor_have_a_continuous_form() -> None:
    """64 taps: the sum of 127 delays, most of which cancel."""
    system = bartlett(64)
    for frequency in (0.002, 0.01, 0.02):
        assert ratio(system, frequency) == pytest.approx(1.0, abs=1e-2)


def bartlett(taps: int) -> control.StateSpace:
    """Two moving sums in a row, each with its running sum beside its samples."""
    one = np.eye(taps, k=-1)
    A = np.block([[np.array([[1.0]]), np.r_[np.zeros(taps - 1), -1.0][None]], [np.zeros((taps, 1)), one]])
    B = np.r_[1.0, 1.0, np.zeros(taps - 1)][:, None]
    C = np.r_[1.0, np.zeros(taps)][None] / taps
    part = without_sums(A, B, C)
    half = control.ss(part.A, part.B, part.C, 0.0, 0.01, remove_useless_states=False)
    return control.series(half, half)


def test_it_is_as_stable_as_the_discrete_one_and_keeps_the_names() -> None:
    system = model_ss(SENSOR, 0.002, inputs="rate", outputs="rate_measured")
    continuous = continuous_ss(system, 3)
    assert max(continuous.poles().real) < 0.0
    assert continuous.isctime(strict=True)
    assert (continuous.input_labels, continuous.output_labels) == (system.input_labels, system.output_labels)


def test_what_has_no_continuous_form_is_refused() -> None:
    ringing = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]], 0.1)
    with pytest.raises(LinearisationRefusedError, match=r"z = -1 .* take an even order"):
        continuous_ss(ringing, 3)
    assert np.abs(continuous_ss(ringing, 2)(0.1j) - ringing(np.exp(0.01j))) < 1e-6
    with pytest.raises(LinearisationRefusedError, match="sampling time"):
        continuous_ss(control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]]))
    with pytest.raises(LinearisationRefusedError, match="order = 0"):
        continuous_ss(ringing, 0)
