"""Gusts: the discrete filters against the continuous spectra."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import welch

from attitude_fmu.models.plants.gusts import (
    davenport_after,
    davenport_coefficients,
    dryden_after,
    dryden_coefficients,
    dryden_scale,
    lower_root,
)

SPEED, KAPPA = 10.0, 0.005
HEIGHT, VERTICAL = 1.5, 1.0
STILL = ((0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))
Floats = NDArray[np.float64]


def davenport(f: Floats) -> Floats:
    """One-sided S(f), m2/s."""
    x = 1200.0 * f / SPEED
    density: Floats = 4.0 * KAPPA * SPEED**2 * x**2 / (1.0 + x**2) ** (4.0 / 3.0) / f
    return density


def dryden(f: Floats, direction: int) -> Floats:
    """One-sided Phi(f), m2/s, of MIL-F-8785C: sigma^2 4 tau/(1 + t^2) along, 2 tau (1 + 3 t^2)/(1 + t^2)^2 across."""
    scale = dryden_scale(HEIGHT)
    tau, sigma = HEIGHT / scale**1.2 / SPEED, VERTICAL / scale**0.4
    t2 = (2.0 * np.pi * f * tau) ** 2
    density: Floats = sigma**2 * (4.0 * tau / (1.0 + t2), 2.0 * tau * (1.0 + 3.0 * t2) / (1.0 + t2) ** 2)[direction]
    return density


def record(period: float, count: int, spectrum: str) -> Floats:
    """Gusts along and across."""
    rng = np.random.default_rng(3)
    after: Callable[..., Any]
    if spectrum == "dryden":
        c, after, draws = dryden_coefficients(SPEED, HEIGHT, VERTICAL, period), dryden_after, 3
    else:
        c, after, draws = davenport_coefficients(SPEED, KAPPA, 0.8, period), davenport_after, 8  # type: ignore[assignment]
    filters, gusts = STILL, []
    for i, normals in enumerate(rng.standard_normal((count, draws)).tolist()):
        filters, gust = after(filters, i == 0, c, tuple(normals))
        gusts.append(gust)
    return np.array(gusts).T


def test_length_and_rms_at_camera_height() -> None:
    """11.7 m and 1.98 sigma_w at 1.5 m, worked out by hand from MIL-F-8785C."""
    assert HEIGHT / dryden_scale(HEIGHT) ** 1.2 == pytest.approx(11.7, rel=0.01)
    assert dryden_coefficients(SPEED, HEIGHT, VERTICAL, 5e-3).rms == pytest.approx(1.98, rel=0.01)


@pytest.mark.parametrize("period", [1e-3, 5e-3, 0.5, 5.0])
def test_dryden_filters_are_stationary_with_their_correlation(period: float) -> None:
    """R_v(t) = sigma^2 exp(-t/tau) (1 - t/(2 tau)), the correlation of the lateral Dryden spectrum."""
    c = dryden_coefficients(SPEED, HEIGHT, VERTICAL, period)
    n11, n21, n22 = c.noise
    A = np.array([[c.memory, 0.0], [c.coupling, c.memory]])
    N = np.array([[n11, 0.0], [n21, n22]])
    P = np.array([[1.0, math.sqrt(0.5)], [math.sqrt(0.5), 1.0]])
    np.testing.assert_allclose(A @ P @ A.T + N @ N.T, P, atol=1e-12)
    read = 0.5 * np.array([math.sqrt(6.0), 1.0 - math.sqrt(3.0)])
    t = period * SPEED * dryden_scale(HEIGHT) ** 1.2 / HEIGHT
    assert read @ P @ read == pytest.approx(1.0)
    assert read @ A @ P @ read == pytest.approx(math.exp(-t) * (1.0 - 0.5 * t), abs=1e-12)
    assert c.memory == pytest.approx(math.exp(-t))


@pytest.mark.parametrize("period", [1e-4, 5e-3, 0.5, 50.0, 5000.0])
def test_davenports_filter_is_stationary(period: float) -> None:
    """A P A' + N N' = P, whatever the period; what the root leaves out as rounding is below 1e-9."""
    c = davenport_coefficients(SPEED, KAPPA, 0.8, period)
    A, N, start = np.diag(c.memory), np.array(c.noise), np.array(c.start)
    P = start @ start.T
    np.testing.assert_allclose(A @ P @ A.T + N @ N.T, P, rtol=1e-9)


def test_davenports_filter_has_his_spectrum_within_nine_percent() -> None:
    """The discrete filter's own spectrum at 50 Hz, far above the band, against the formula from x = 0.05 to 1000.

    Sampling folds the tail back: at 8 Hz of 200 Hz by less than 1 %.
    """
    period = 5e-3
    c = davenport_coefficients(SPEED, KAPPA, 0.8, period)
    f = np.geomspace(0.05, 1000.0, 200) * SPEED / 1200.0
    response = []
    for z in np.exp(2j * np.pi * f * period):
        # gusts are linear in the normals: the response to a noise column is that to its share in each state
        states = np.array(c.noise) / (z - np.array(c.memory))[:, None]
        units = [davenport_after(_unit(i), False, _frozen(c), (0.0,) * 8)[1][0] for i in range(4)]
        response.append(np.sum(np.abs(units @ states) ** 2))
    found = 2.0 * period * np.array(response)
    ratio = found / davenport(f)
    assert ratio.max() < 1.10
    assert ratio.min() > 0.93


def _unit(i: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    return tuple(1.0 if j == i else 0.0 for j in range(4)), STILL[1]


def _frozen(c: Any) -> Any:
    return c._replace(memory=(1.0, 1.0, 1.0, 1.0))


def test_davenports_rms_is_the_formulas() -> None:
    """sqrt(6 kappa) U10, the integral of the spectrum."""
    f = np.geomspace(1e-7, 1e3, 200_001)
    integral = np.trapezoid(davenport(f), f)
    assert davenport_coefficients(SPEED, KAPPA, 0.8, 5e-3).rms[0] ** 2 == pytest.approx(integral, rel=1e-3)


@pytest.mark.parametrize(("spectrum", "period"), [("dryden", 0.05), ("davenport", 0.05), ("davenport", 2.0)])
@pytest.mark.parametrize("direction", [0, 1])
def test_records_have_their_spectra(spectrum: str, period: float, direction: int) -> None:
    """Welch's mean over bands of five bins and 77 half-overlapping Hann segments.

    A band's relative standard error is 1/sqrt(77 * 0.95 * 5/1.9) = 7 %; four of them, the fit's 9 % and what sampling
    folds back below 0.4 of half the rate, 10 %, make the bound.
    """
    gusts = record(period, 40_000, spectrum)[direction]
    f, density = welch(gusts, 1.0 / period, nperseg=1024, detrend=False)
    bands = slice(8, 208)
    f, density = f[bands].reshape(-1, 5).mean(axis=1), density[bands].reshape(-1, 5).mean(axis=1)
    expected = dryden(f, direction) if spectrum == "dryden" else davenport(f) * (1.0, 0.8**2)[direction]
    assert np.abs(density / expected - 1.0).max() < 0.45
    assert np.mean(density / expected) == pytest.approx(1.0, abs=0.15)


def test_the_root_of_a_singular_covariance_is_its_root() -> None:
    column = np.array([1.0, 2.0, -0.5, 3.0])
    singular = np.outer(column, column)
    root = np.array(lower_root(tuple(map(tuple, singular.tolist()))))
    np.testing.assert_allclose(root @ root.T, singular, atol=1e-12)
    rng = np.random.default_rng(1)
    full = rng.standard_normal((4, 4))
    np.testing.assert_allclose(
        lower_root(tuple(map(tuple, (full @ full.T).tolist()))), np.linalg.cholesky(full @ full.T), atol=1e-12
    )
