"""Wind on the camera: mean, gusts along and across, and vortex shedding.

    F = rho/2 CdA |V| (V + s |V| side),   V: mean and gusts as the body feels them

A body of area A feels gusts of frequency f by the admittance 1/(1 + y^(4/3))^2, y = 2 f sqrt(A)/V (applied to the
spectrum of the speed); a lag of the corner y = 1/2 stands for it, within 0.07 of its value at y = 0.
Vortex shedding is a unit vector that turns at f = 0.2 V/D and diffuses, one component of which is the side force.
Every process starts at its first tick in its stationary distribution, and is interpolated linearly between ticks:
between five of them in a turn of the vortices, their side force loses an eighth of its rms.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Enumeration, Item, Real, Vector3
from ..scalar import PI, Scalar, cos, exp, log, maximum, sin, sqrt, where
from .gusts import (
    DavenportCoefficients,
    DrydenCoefficients,
    Vector4,
    davenport_after,
    davenport_coefficients,
    dryden_after,
    dryden_coefficients,
)

_STROUHAL = 0.2
_TICKS_IN_A_TURN = 5.0
"""Of the vortices, at least: the line between values that correlate by r has (2 + r)/3 of their power, 0.77 of it."""

_ADMITTANCE_CORNER = 0.5
_REFERENCE_HEIGHT = 10.0
"""m, of Davenport's wind."""

_CALM = 0.1
"""m/s; below it the filters keep the time constants of this speed."""

_LEAST_AREA = 1e-6
"""m2; keeps the admittance's corner finite."""

_STILL = 1e-24
"""m^2/s^2; keeps the derivative of the speed finite in a calm."""

SPECTRUM = Enumeration(
    "GustSpectrum",
    (
        Item("dryden", "MIL-F-8785C, along and across"),
        Item("davenport", "Davenport 1961 by a rational fit, the same shape along and across"),
    ),
    "spectrum of the gusts",
)


class Wind(NamedTuple):
    """The wind and what it takes hold of."""

    speed: Annotated[float, Real("m/s", "mean speed at the camera; 0 is calm", 0.0, 60.0)] = 7.0  # assumption
    direction: Annotated[float, Real("rad", "where the wind comes from, clockwise from north", -10.0, 10.0, "deg")] = (
        PI / 3.0
    )
    spectrum: Annotated[int, SPECTRUM] = SPECTRUM.value("dryden")
    turbulence: Annotated[
        float, Real("1", "rms of the vertical gusts over mean speed, the Dryden model's sigma_w/V", 0.0, 1.0)
    ] = 0.136  # 0.1 of the wind at 20 ft (MIL-F-8785C), which blows 1.36 times as fast: log profile, roughness 0.03 m
    surface_drag: Annotated[
        float, Real("1", "surface drag coefficient, the Davenport model's kappa", 1e-4, 0.1, None, 0.01)
    ] = 0.005  # open country [Davenport 1961]
    roughness: Annotated[float, Real("m", "of the ground; the log profile's", 1e-5, 0.2, None, 0.01)] = 0.03  # grass
    across: Annotated[float, Real("1", "rms across over rms along, Davenport's gusts only", 0.0, 2.0)] = (
        0.8  # assumption
    )
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
    """The discrete filters."""

    every: Annotated[float, Real("1", "solver steps in a period")]
    dryden: DrydenCoefficients
    davenport: DavenportCoefficients
    admittance: Annotated[Vector3, Real("1", "shares of the gust felt, the last gust and the next in the gust felt")]
    vortex: Annotated[Vector3, Real("1", "cosine and sine of the vortices' turn, shrunk, and its noise")]
    flow: Annotated[tuple[float, float], Real("1", "where the wind blows to: east, north")]


_NO_STATES = (0.0, 0.0, 0.0, 0.0)


class WindState(NamedTuple):
    """Shaping filters, and gusts and vortices at the last and at the next tick."""

    calls: Annotated[float, Real("1", "ticks so far")] = 0.0
    filters: Annotated[tuple[Vector4, Vector4], Real("1", "gust filters along and across")] = (_NO_STATES, _NO_STATES)
    last_gust: Annotated[tuple[float, float], Real("m/s", "along and across, at the last tick")] = (0.0, 0.0)
    next_gust: Annotated[tuple[float, float], Real("m/s", "along and across, at the next tick")] = (0.0, 0.0)
    last_felt: Annotated[tuple[float, float], Real("m/s", "gust as the body feels it, at the last tick")] = (0.0, 0.0)
    next_felt: Annotated[tuple[float, float], Real("m/s", "gust as the body feels it, at the next tick")] = (0.0, 0.0)
    last_vortex: Annotated[float, Real("1", "side force at the last tick, rms 1")] = 0.0
    next_vortex: Annotated[tuple[float, float], Real("1", "turning vector of the vortices at the next tick")] = (
        0.0,
        0.0,
    )


def reference_speed(wind: Wind) -> Scalar:
    """Mean speed (m/s) at 10 m by the log profile."""
    return wind.speed * log(_REFERENCE_HEIGHT / wind.roughness) / log(wind.height / wind.roughness)


def longest_period(wind: Wind) -> Scalar:
    """Period of the gusts' clock (s) at which it still follows the vortices."""
    return wind.lens_diameter / (_STROUHAL * maximum(wind.speed, _CALM)) / _TICKS_IN_A_TURN


def wind_coefficients(wind: Wind, solver_period: Scalar, every: Scalar) -> WindCoefficients:
    """Exact discretisation of all filters over `every` solver steps."""
    period = every * solver_period
    speed = maximum(wind.speed, _CALM)
    lag = _ADMITTANCE_CORNER * PI * speed / sqrt(maximum(wind.drag_area, _LEAST_AREA)) * period
    kept = exp(-lag)
    share = 1.0 - (1.0 - kept) / lag
    turn = 2.0 * PI * _STROUHAL * speed / wind.lens_diameter * period
    shrink = exp(-wind.shedding_damping * turn)
    over_calm = wind.speed / speed
    davenport = davenport_coefficients(
        reference_speed(wind._replace(speed=speed)), wind.surface_drag, wind.across, period
    )
    along, across = davenport.rms
    return WindCoefficients(
        every=every,
        dryden=dryden_coefficients(speed, wind.height, wind.turbulence * wind.speed, period),
        davenport=davenport._replace(rms=(over_calm * along, over_calm * across)),
        admittance=(kept, 1.0 - kept - share, share),
        vortex=(shrink * cos(turn), shrink * sin(turn), sqrt(1.0 - shrink * shrink)),
        flow=(-sin(wind.direction), -cos(wind.direction)),
    )


def _after(
    state: WindState,
    c: WindCoefficients,
    filters: tuple[Vector4, Vector4],
    gust: tuple[Scalar, Scalar],
    normals: tuple[Scalar, ...],
) -> WindState:
    """The next tick's vortices, and the gusts as the body feels them."""
    n0, n1 = normals
    first = state.calls < 0.5
    kept, last, new = c.admittance
    along, across = [
        where(first, g1, kept * felt + last * g0 + new * g1)
        for felt, g0, g1 in zip(state.next_felt, state.next_gust, gust, strict=True)
    ]
    cosine, sine, diffusion = c.vortex
    a, b = state.next_vortex
    return WindState(
        calls=state.calls + 1.0,
        filters=filters,
        last_gust=state.next_gust,
        next_gust=gust,
        last_felt=state.next_felt,
        next_felt=(along, across),
        last_vortex=a,
        next_vortex=(
            where(first, n0, cosine * a - sine * b + diffusion * n0),
            where(first, n1, sine * a + cosine * b + diffusion * n1),
        ),
    )


def dryden_wind_after(state: WindState, c: WindCoefficients, normals: tuple[Scalar, ...]) -> WindState:
    """The next tick's disturbances from five standard normals."""
    filters, gust = dryden_after(state.filters, state.calls < 0.5, c.dryden, normals[0:3])
    return _after(state, c, filters, gust, normals[3:5])


def davenport_wind_after(state: WindState, c: WindCoefficients, normals: tuple[Scalar, ...]) -> WindState:
    """The next tick's disturbances from ten standard normals."""
    filters, gust = davenport_after(state.filters, state.calls < 0.5, c.davenport, normals[0:8])
    return _after(state, c, filters, gust, normals[8:10])


def _between(last: tuple[Scalar, Scalar], following: tuple[Scalar, Scalar], share: Scalar) -> tuple[Scalar, Scalar]:
    return last[0] + share * (following[0] - last[0]), last[1] + share * (following[1] - last[1])


def _speed(along: Scalar, across: Scalar) -> Scalar:
    return sqrt(maximum(along * along + across * across, _STILL))


def wind_speed(wind: Wind, state: WindState, share: Scalar) -> Scalar:
    """Speed of the free wind (m/s), `share` of the way from the last tick to the next."""
    along, across = _between(state.last_gust, state.next_gust, share)
    return _speed(wind.speed + along, across)


def wind_force(wind: Wind, c: WindCoefficients, state: WindState, share: Scalar) -> Vector3:
    """Force on the camera in n (N), `share` of the way from the last tick to the next."""
    gust, across = _between(state.last_felt, state.next_felt, share)
    along = wind.speed + gust
    vortex = wind.shedding * (state.last_vortex + share * (state.next_vortex[0] - state.last_vortex))
    pressure = 0.5 * wind.density * wind.drag_area * _speed(along, across)
    east, north = c.flow
    drag, side = pressure * (along - vortex * across), pressure * (across + vortex * along)
    return drag * east - side * north, drag * north + side * east, 0.0
