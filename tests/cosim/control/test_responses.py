"""Frequency responses, densities and the jitter in exposures, held against python-control, sums and definitions."""

from __future__ import annotations

import control
import numpy as np
import pytest

from attitude_fmu.cosim.control.responses import density, exposure_share, jitter_of, response

DT = 0.002


def test_response_is_that_of_python_control() -> None:
    random = np.random.default_rng(2)
    A = random.standard_normal((7, 7))
    A *= 0.95 / np.abs(np.linalg.eigvals(A)).max()
    # states of very different size
    size = 10.0 ** np.arange(-6, 8, 2)
    A, B = A * size[:, None] / size, random.standard_normal((7, 2)) * size[:, None]
    C, D = random.standard_normal((3, 7)) / size, random.standard_normal((3, 2))
    f = np.geomspace(0.01, 249.0, 60)
    wanted = np.moveaxis(control.ss(A, B, C, D, DT)(np.exp(2j * np.pi * f * DT), squeeze=False), 2, 0)
    # python-control does not balance: its own rounding, a few digits of 16
    assert np.allclose(response(A, B, C, D, f, DT), wanted, rtol=1e-8, atol=1e-8)


def test_density_of_a_markov_process_adds_up_to_its_variance() -> None:
    a, q = 0.9, 3.0
    f = np.linspace(0.0, 0.5 / DT, 20001)
    H = response(np.array([[a]]), np.eye(1), np.eye(1), 0.0, f, DT)
    # the trapezoidal sum of a smooth periodic function is exact
    assert np.trapezoid(density(H, np.array([[q]]), DT)[:, 0], f) == pytest.approx(q / (1.0 - a * a), rel=1e-9)


def test_density_of_correlated_noise_is_that_of_its_root() -> None:
    random = np.random.default_rng(1)
    H = random.standard_normal((4, 2, 3)) + 1j * random.standard_normal((4, 2, 3))
    root = random.standard_normal((3, 3))
    assert np.allclose(density(H, root @ root.T, DT), density(H @ root, np.eye(3), DT))


@pytest.mark.parametrize("f", [0.01, 0.3, 0.5, 1.0, 1.7, 6.2, 40.0, 249.0])
def test_share_of_an_exposure_is_what_is_left_of_a_sine_about_its_mean(f: float) -> None:
    exposure = 1.0
    turning = np.exp(2j * np.pi * f * DT * np.arange(round(exposure / DT)))
    left = np.mean(np.abs(turning - turning.mean()) ** 2)
    # of a slow sine little is left of much: as many digits go
    assert exposure_share(np.array([f]), exposure, DT)[0] == pytest.approx(left, rel=1e-9, abs=1e-12)


def test_share_is_none_at_rest_and_that_of_a_sinc_where_sampling_is_fine() -> None:
    f = np.array([0.0, 0.2, 0.9, 3.3])
    # sin(x)/x of the sampling itself is off by (pi f dt)^2/6 < 2e-6
    assert np.allclose(exposure_share(f, 1.0, 1e-4), 1.0 - np.sinc(f) ** 2, atol=2e-6)
    assert exposure_share(f, 1.0, DT)[0] == 0.0


def test_jitter_of_white_noise_is_its_deviation_less_one_degree_of_freedom() -> None:
    deviation, exposure = 3.0, 0.05
    samples = round(exposure / DT)
    f = np.linspace(0.0, 0.5 / DT, 20001)
    flat = np.full((len(f), 2), 2.0 * DT * deviation**2) * np.array([1.0, 4.0])
    wanted = deviation * np.sqrt(1.0 - 1.0 / samples)
    assert np.allclose(jitter_of(flat, f, exposure, DT), [wanted, 2.0 * wanted], rtol=1e-9)
