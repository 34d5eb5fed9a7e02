"""Wind: force, admittance, vortices and the gusts' clock; the gusts' spectra are in test_gusts."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from attitude_fmu.models.plants.wind import (
    SPECTRUM,
    Wind,
    WindState,
    davenport_wind_after,
    dryden_wind_after,
    longest_period,
    reference_speed,
    wind_coefficients,
    wind_force,
    wind_speed,
)

WIND = Wind(speed=7.6, height=1.5)
AFTER: dict[str, tuple[Callable[..., WindState], int]] = {
    "dryden": (dryden_wind_after, 5),
    "davenport": (davenport_wind_after, 10),
}


def test_every_spectrum_has_its_step() -> None:
    assert {item.name for item in SPECTRUM.items} == set(AFTER)


@pytest.mark.parametrize("spectrum", AFTER)
def test_gusts_and_vortices_have_their_rms_from_the_first_tick_on(spectrum: str) -> None:
    """Four standard errors of a variance from independent starts."""
    after, count = AFTER[spectrum]
    rng, runs = np.random.default_rng(1), 20_000
    c = wind_coefficients(WIND, 1e-3, 5.0)
    along, across = (c.dryden.rms, c.dryden.rms) if spectrum == "dryden" else c.davenport.rms
    firsts = [after(WindState(), c, tuple(normals)) for normals in rng.standard_normal((runs, count)).tolist()]
    bound = 4.0 * math.sqrt(2.0 / runs)
    for values in (
        [f.next_gust[0] / along for f in firsts],
        [f.next_gust[1] / across for f in firsts],
        [f.next_felt[0] / along for f in firsts],
        [f.next_vortex[0] for f in firsts],
        [f.next_vortex[1] for f in firsts],
    ):
        assert np.var(values) == pytest.approx(1.0, abs=bound)


def test_both_spectra_blow_alike_over_grass() -> None:
    """Two sources, one wind: rms along of 0.27 V by MIL-F-8785C, 0.26 V by Davenport."""
    c = wind_coefficients(WIND, 1e-3, 5.0)
    assert c.dryden.rms == pytest.approx(0.27 * 7.6, rel=0.01)
    assert c.davenport.rms[0] == pytest.approx(0.257 * 7.6, rel=0.01)


def test_the_wind_grows_with_height_by_the_log_profile() -> None:
    assert reference_speed(WIND) == pytest.approx(7.6 * math.log(10.0 / 0.03) / math.log(1.5 / 0.03))
    assert reference_speed(WIND._replace(height=10.0)) == pytest.approx(7.6)


def test_vortices_turn_at_strouhals_frequency() -> None:
    c = wind_coefficients(WIND, 1e-3, 5.0)
    turn = math.atan2(c.vortex[1], c.vortex[0])
    assert turn / (2.0 * math.pi * 5e-3) == pytest.approx(0.2 * WIND.speed / WIND.lens_diameter)


def test_the_longest_period_leaves_the_vortices_their_rms() -> None:
    """Linear interpolation at evenly spread times keeps (2 + r)/3 of the power, r of a tick to the next: above 0.85^2.

    The wind blows from the east, the vortices push north and south. Of 40 000 ticks, correlated over
    1/(0.07 * 2 pi/5) = 11, the power is known within 4 sqrt(2 * 11/40 000) = 0.09.
    """
    rng, ticks = np.random.default_rng(3), 40_000
    wind = WIND._replace(direction=math.pi / 2.0)
    c = wind_coefficients(wind, longest_period(wind), 1.0)
    assert math.atan2(c.vortex[1], c.vortex[0]) == pytest.approx(2.0 * math.pi / 5.0)
    unit = 0.5 * wind.density * wind.drag_area * wind.speed**2 * wind.shedding
    state, power = WindState(), 0.0
    for normals, share in zip(rng.standard_normal((ticks, 5)).tolist(), rng.uniform(size=ticks), strict=True):
        state = dryden_wind_after(state, c, tuple(normals))
        side = state._replace(last_felt=(0.0, 0.0), next_felt=(0.0, 0.0))
        power += (wind_force(wind, c, side, share)[1] / unit) ** 2 / ticks
    assert power == pytest.approx((2.0 + c.vortex[0]) / 3.0, abs=0.09)
    assert (2.0 + c.vortex[0]) / 3.0 > 0.85**2


def test_vortices_are_a_narrow_band() -> None:
    """Periodogram of the side force: centre 0.2 V/D, half-power half width zeta f.

    A record of 400 s holds 400 * 2 pi zeta f independent widths; 10 % is four standard errors of the width's power.
    """
    c, rng, n = wind_coefficients(WIND, 1e-3, 5.0), np.random.default_rng(2), 80_000
    state, side = WindState(), []
    for normals in rng.standard_normal((n, 5)).tolist():
        state = dryden_wind_after(state, c, tuple(normals))
        side.append(state.next_vortex[0])
    power, frequency = np.abs(np.fft.rfft(side)) ** 2, np.fft.rfftfreq(n, 5e-3)
    centre = 0.2 * WIND.speed / WIND.lens_diameter
    half = WIND.shedding_damping * centre
    assert np.sum(power * frequency) / np.sum(power) == pytest.approx(centre, rel=0.1)
    inside = np.abs(frequency - centre) < half
    assert power[inside].sum() / power.sum() == pytest.approx(0.5, rel=0.1)  # of a Lorentzian's area


def test_a_body_does_not_feel_gusts_smaller_than_itself() -> None:
    """Response of the felt gust to a sinusoid, its power against 1/(1 + y^(4/3))^2, y = 2 f sqrt(A)/V."""
    c = wind_coefficients(WIND, 1e-3, 1.0)
    kept, last, following = c.admittance
    assert kept + last + following == pytest.approx(1.0)
    for f in (0.1, 3.0, 10.0, 50.0):
        z = np.exp(2j * np.pi * f * 1e-3)
        y = 2.0 * f * math.sqrt(WIND.drag_area) / WIND.speed
        power = abs((last + following * z) / (z - kept)) ** 2
        assert power == pytest.approx(1.0 / (1.0 + y ** (4.0 / 3.0)) ** 2, abs=0.07)


def test_drag_blows_downwind_and_vortices_across() -> None:
    wind = Wind(speed=10.0, direction=math.pi / 2.0, drag_area=0.01, density=1.2, shedding=0.1)
    c = wind_coefficients(wind, 1e-3, 5.0)
    np.testing.assert_allclose(wind_force(wind, c, WindState(), 0.5), (-0.6, 0.0, 0.0), atol=1e-15)  # from the east
    force = wind_force(wind, c, WindState(last_vortex=1.0, next_vortex=(1.0, 0.0)), 0.5)
    np.testing.assert_allclose(np.abs(force), (0.6, 0.06, 0.0), atol=1e-15)
    assert wind_speed(wind, WindState(), 0.5) == 10.0


def test_drag_is_quadratic_in_the_gust_felt() -> None:
    wind = Wind(speed=10.0, direction=math.pi / 2.0, drag_area=0.01, density=1.2)
    c = wind_coefficients(wind, 1e-3, 5.0)
    force = wind_force(wind, c, WindState(last_felt=(5.0, 0.0), next_felt=(5.0, 0.0), next_gust=(9.0, 0.0)), 0.5)
    assert force[0] == pytest.approx(-0.6 * 2.25)


def test_gusts_are_interpolated() -> None:
    state = WindState(last_gust=(1.0, 0.0), next_gust=(2.0, 0.0))
    assert wind_speed(WIND, state, 0.25) == pytest.approx(WIND.speed + 1.25)


@pytest.mark.parametrize("spectrum", AFTER)
def test_calm_is_no_force(spectrum: str) -> None:
    after, count = AFTER[spectrum]
    calm = Wind(speed=0.0)
    c = wind_coefficients(calm, 1e-3, 5.0)
    state = after(WindState(), c, (1.0,) * count)
    assert max(abs(f) for f in wind_force(calm, c, state, 0.5)) < 1e-20
    assert wind_speed(calm, state, 0.5) < 1e-11
