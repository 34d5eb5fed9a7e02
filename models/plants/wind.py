"""Wind on the camera: mean, turbulence along and across (Dryden), and vortex shedding.

Turbulence: white noise through the shaping filters of MIL-F-8785C, tau = L/V::

    H_u(s) = sigma_u sqrt(2 tau/pi) / (1 + tau s)
    H_v(s) = sigma_v sqrt(tau/pi) (1 + sqrt(3) tau s) / (1 + tau s)^2

both discretised exactly, so that rms and correlation do not depend on the period. The formulas hold from 10 ft up;
their use at a camera's height is an extrapolation.
Vortex shedding is a unit vector that turns at f = 0.2 V/D and diffuses, one component of which is the side force.
Every process starts at its first tick in its stationary distribution, and is interpolated linearly between ticks.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Real, Vector3
from ..scalar import PI, Scalar, cos, exp, log, maximum, sin, sqrt, where

_FOOT = 0.3048
_SQRT_HALF = 0.5 * sqrt(2.0)
_SQRT_3 = sqrt(3.0)
_SQRT_6 = sqrt(6.0)
_STROUHAL = 0.2
_CALM = 0.1
"""m/s; below it the filters keep the time constants of this speed."""


_STILL = 1e-24
"""m^2/s^2; keeps the derivative of the speed finite in a calm."""


class Wind(NamedTuple):
    """The wind and what it takes hold of."""

    speed: Annotated[float, Real("m/s", "mean speed at the camera; 0 is calm", 0.0, 60.0)] = 7.0  # assumption
    direction: Annotated[float, Real("rad", "where the wind comes from, clockwise from north", -10.0, 10.0, "deg")] = (
        PI / 3.0
    )
    turbulence: Annotated[
        float, Real("1", "rms of the vertical gusts over mean speed, the Dryden model's sigma_w/V", 0.0, 1.0)
    ] = 0.136  # 0.1 of the wind at 20 ft (MIL-F-8785C), which blows 1.36 times as fast: log profile, roughness 0.03 m
    height: Annotated[float, Real("m", "above ground", 0.3, 100.0)] = 1.5
    density: Annotated[float, Real("kg/m3", "of the air", 0.0, 2.0)] = 1.2
    drag_area: Annotated[float, Real("m2", "drag coefficient times area of the camera", 0.0, 1.0, None, 0.01)] = 0.02
    center_of_pressure: Annotated[
        Vector3, Real("m", "where the force acts, from O in camera axes", -1.0, 1.0, None, 0.01)
    ] = (
        0.0,
        0.03,
        0.005,
    )  # a lens reaches forward. Cd 1 agrees with the torque measured on a 250 mm lens [S thecentercolumn
    # 2019/05/11]: 0.022 m2 times 0.12 m there; area and arm of this lighter one are assumptions
    lens_diameter: Annotated[float, Real("m", "sheds vortices at 0.2 V/D", 0.01, 1.0)] = 0.09
    shedding: Annotated[float, Real("1", "rms of the side force over the drag", 0.0, 1.0)] = 0.07  # judgement: 5..10 %
    shedding_damping: Annotated[float, Real("1", "half band width over frequency", 0.001, 1.0)] = 0.07  # judgement
    period: Annotated[float, Real("s", "of the gusts' clock, rounded to whole solver steps", 1e-4, 1.0)] = 0.005


class WindCoefficients(NamedTuple):
    """The discrete shaping filters."""

    every: Annotated[float, Real("1", "solver steps in a period")]
    rms: Annotated[float, Real("m/s", "rms gust along and across")]
    memory: Annotated[float, Real("1", "exp(-T V/L)")]
    coupling: Annotated[float, Real("1", "of the across filter's second state to its first")]
    noise: Annotated[Vector3, Real("1", "lower triangle of the noise's root: 11, 21, 22")]
    vortex: Annotated[Vector3, Real("1", "cosine and sine of the vortices' turn, shrunk, and its noise")]
    flow: Annotated[tuple[float, float], Real("1", "where the wind blows to: east, north")]


class WindState(NamedTuple):
    """Shaping filters, and gusts and vortices at the last and at the next tick."""

    calls: Annotated[float, Real("1", "ticks so far")] = 0.0
    across_filter: Annotated[tuple[float, float], Real("1", "filter of the gust across")] = (0.0, 0.0)
    last_gust: Annotated[tuple[float, float], Real("m/s", "along and across, at the last tick")] = (0.0, 0.0)
    next_gust: Annotated[tuple[float, float], Real("m/s", "along and across, at the next tick")] = (0.0, 0.0)
    last_vortex: Annotated[float, Real("1", "side force at the last tick, rms 1")] = 0.0
    next_vortex: Annotated[tuple[float, float], Real("1", "turning vector of the vortices at the next tick")] = (
        0.0,
        0.0,
    )


def dryden_scale(height: Scalar) -> Scalar:
    """0.177 + 0.000823 h with h in feet: L_u = h / it^1.2, sigma_u = sigma_w / it^0.4 (MIL-F-8785C)."""
    return 0.177 + 0.000823 * height / _FOOT


def wind_coefficients(wind: Wind, solver_period: Scalar, every: Scalar) -> WindCoefficients:
    """Exact discretisation over `every` solver steps (Van Loan 1978, in closed form)."""
    period = every * solver_period
    stretch = log(dryden_scale(wind.height))
    length = wind.height * exp(-1.2 * stretch)
    rms = wind.turbulence * wind.speed * exp(-0.4 * stretch)
    p = maximum(wind.speed, _CALM) * period / length
    memory = exp(-p)
    # of the chain x1' = -x1/tau + n, x2' = -x2/tau + x1, scaled to unit variances (their correlation is sqrt(1/2))
    lost = memory * memory
    q11 = 1.0 - lost
    q21 = _SQRT_HALF * (1.0 - lost * (1.0 + 2.0 * p))
    q22 = 1.0 - lost * (1.0 + 2.0 * p + 2.0 * p * p)
    n11 = sqrt(q11)
    n21 = q21 / n11
    turn = 2.0 * PI * _STROUHAL * maximum(wind.speed, _CALM) / wind.lens_diameter * period
    shrink = exp(-wind.shedding_damping * turn)
    return WindCoefficients(
        every=every,
        rms=rms,
        memory=memory,
        coupling=2.0 * _SQRT_HALF * p * memory,
        noise=(n11, n21, sqrt(maximum(q22 - n21 * n21, 0.0))),
        vortex=(shrink * cos(turn), shrink * sin(turn), sqrt(1.0 - shrink * shrink)),
        flow=(-sin(wind.direction), -cos(wind.direction)),
    )


def wind_after(state: WindState, c: WindCoefficients, normals: tuple[Scalar, ...]) -> WindState:
    """The next tick's disturbances from five standard normals; the first tick draws the stationary distribution."""
    n0, n1, n2, n3, n4 = normals
    first = state.calls < 0.5
    n11, n21, n22 = c.noise
    along = where(first, c.rms * n0, c.memory * state.next_gust[0] + c.rms * n11 * n0)
    x1, x2 = state.across_filter
    y1 = where(first, n1, c.memory * x1 + n11 * n1)
    y2 = where(first, _SQRT_HALF * (n1 + n2), c.memory * x2 + c.coupling * x1 + n21 * n1 + n22 * n2)
    across = 0.5 * c.rms * (_SQRT_6 * y1 + (1.0 - _SQRT_3) * y2)
    cosine, sine, diffusion = c.vortex
    a, b = state.next_vortex
    turned_a = where(first, n3, cosine * a - sine * b + diffusion * n3)
    turned_b = where(first, n4, sine * a + cosine * b + diffusion * n4)
    return WindState(state.calls + 1.0, (y1, y2), state.next_gust, (along, across), a, (turned_a, turned_b))


def wind_now(wind: Wind, c: WindCoefficients, state: WindState, share: Scalar) -> tuple[Vector3, Scalar]:
    """Force on the camera in n (N) and wind speed (m/s), `share` of the way from the last tick to the next.

    F = rho/2 CdA V (v + s |V| side): drag along the wind, the vortices' force across it.
    """
    (u0, v0), (u1, v1) = state.last_gust, state.next_gust
    along = wind.speed + u0 + share * (u1 - u0)
    across = v0 + share * (v1 - v0)
    vortex = wind.shedding * (state.last_vortex + share * (state.next_vortex[0] - state.last_vortex))
    speed = sqrt(maximum(along * along + across * across, _STILL))
    pressure = 0.5 * wind.density * wind.drag_area * speed
    east, north = c.flow
    drag, side = pressure * (along - vortex * across), pressure * (across + vortex * along)
    return (drag * east - side * north, drag * north + side * east, 0.0), speed
