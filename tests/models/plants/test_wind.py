"""Wind: the discrete filters against the continuous spectra, and the force."""

from __future__ import annotations

import math

import numpy as np
import pytest

from attitude_fmu.models.plants.wind import (
    Wind,
    WindState,
    dryden_scale,
    wind_after,
    wind_coefficients,
    wind_now,
)

WIND = Wind(speed=7.6, height=1.5)


def test_length_and_rms_at_camera_height() -> None:
    """11.7 m and 1.98 sigma_w at 1.5 m, worked out by hand from MIL-F-8785C."""
    scale = dryden_scale(1.5)
    assert 1.5 / scale**1.2 == pytest.approx(11.7, rel=0.01)
    c = wind_coefficients(WIND, 1e-3, 5.0)
    assert c.rms == pytest.approx(1.98 * WIND.turbulence * WIND.speed, rel=0.01)


@pytest.mark.parametrize("every", [1.0, 5.0, 500.0, 5000.0])
def test_filters_are_stationary_with_the_dryden_correlation(every: float) -> None:
    """R_v(t) = sigma^2 exp(-t/tau) (1 - t/(2 tau)), the correlation of the lateral Dryden spectrum."""
    c = wind_coefficients(WIND, 1e-3, every)
    n11, n21, n22 = c.noise
    A = np.array([[c.memory, 0.0], [c.coupling, c.memory]])
    N = np.array([[n11, 0.0], [n21, n22]])
    P = np.array([[1.0, math.sqrt(0.5)], [math.sqrt(0.5), 1.0]])
    np.testing.assert_allclose(A @ P @ A.T + N @ N.T, P, atol=1e-12)
    read = 0.5 * np.array([math.sqrt(6.0), 1.0 - math.sqrt(3.0)])
    t = every * 1e-3 * 7.6 * dryden_scale(1.5) ** 1.2 / 1.5
    assert read @ P @ read == pytest.approx(1.0)
    assert read @ A @ P @ read == pytest.approx(math.exp(-t) * (1.0 - 0.5 * t), abs=1e-12)
    assert c.memory == pytest.approx(math.exp(-t))


def test_gusts_have_their_rms_from_the_first_tick_on() -> None:
    """Four standard errors; the variance of N draws correlated by rho has 2 (1 + rho^2)/(1 - rho^2)/N."""
    rng, runs = np.random.default_rng(1), 20_000
    c = wind_coefficients(WIND, 1e-3, 5.0)
    firsts = [wind_after(WindState(), c, tuple(rng.standard_normal(5).tolist())) for _ in range(runs)]
    bound = 4.0 * math.sqrt(2.0 / runs)
    for values in (
        [f.next_gust[0] / c.rms for f in firsts],
        [f.next_gust[1] / c.rms for f in firsts],
        [f.next_vortex[0] for f in firsts],
    ):
        assert np.var(values) == pytest.approx(1.0, abs=bound)

    slow = wind_coefficients(WIND, 1e-3, 1000.0)
    state, gusts, vortices = WindState(), [], []
    for normals in rng.standard_normal((runs, 5)).tolist():
        state = wind_after(state, slow, tuple(normals))
        gusts.append(state.next_gust)
        vortices.append(state.next_vortex[0])
    stretched = math.sqrt(2.0 * (1.0 + slow.memory**2) / (1.0 - slow.memory**2) / runs)
    along, across = np.array(gusts).T / slow.rms
    assert np.var(along) == pytest.approx(1.0, abs=4.0 * stretched)
    assert np.var(across) == pytest.approx(1.0, abs=4.0 * stretched)
    assert np.corrcoef(along[1:], along[:-1])[0, 1] == pytest.approx(slow.memory, abs=4.0 / math.sqrt(runs))
    assert abs(np.corrcoef(along, across)[0, 1]) < 4.0 * stretched
    assert np.var(vortices) == pytest.approx(1.0, abs=bound)


def test_vortices_turn_at_strouhals_frequency() -> None:
    c = wind_coefficients(WIND, 1e-3, 5.0)
    turn = math.atan2(c.vortex[1], c.vortex[0])
    assert turn / (2.0 * math.pi * 5e-3) == pytest.approx(0.2 * WIND.speed / WIND.lens_diameter)


def test_drag_blows_downwind_and_vortices_across() -> None:
    wind = Wind(speed=10.0, direction=math.pi / 2.0, drag_area=0.01, density=1.2, shedding=0.1)
    c = wind_coefficients(wind, 1e-3, 5.0)
    force, speed = wind_now(wind, c, WindState(), 0.5)
    assert speed == 10.0
    np.testing.assert_allclose(force, (-0.6, 0.0, 0.0), atol=1e-15)  # from the east
    force, _ = wind_now(wind, c, WindState(last_vortex=1.0, next_vortex=(1.0, 0.0)), 0.5)
    np.testing.assert_allclose(np.abs(force), (0.6, 0.06, 0.0), atol=1e-15)


def test_gusts_are_interpolated() -> None:
    c = wind_coefficients(WIND, 1e-3, 5.0)
    state = WindState(last_gust=(1.0, 0.0), next_gust=(2.0, 0.0))
    assert wind_now(WIND, c, state, 0.25)[1] == pytest.approx(WIND.speed + 1.25)


def test_calm_is_no_force() -> None:
    calm = Wind(speed=0.0)
    c = wind_coefficients(calm, 1e-3, 5.0)
    state = wind_after(WindState(), c, (1.0, 1.0, 1.0, 1.0, 1.0))
    force, speed = wind_now(calm, c, state, 0.5)
    assert max(abs(f) for f in force) < 1e-20
    assert speed < 1e-11
