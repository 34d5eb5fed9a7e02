"""Kalman filter on a raw channel whose noise is a first-order autoregressive process (the 2010 paper's filter).

A channel reads z_k = s_k + n_k, true signal and noise::

    n_k = a n_(k-1) + e_k,  var e = E       AR(1): coefficient a, driving variance E, own variance E/(1 - a^2)
    s_k = s_(k-1) + u_k,    var u = Q       the signal may go anywhere, by sqrt(Q) a reading

The paper names the noise model and "a Kalman filter" on the readings, ahead of the attitude solution, and no more: how
the signal passes is ours. A random walk as signal gives a filter that passes what stays at gain one. In z_k - a z_(k-1)
nothing is left of the noise but e_k, so that a scalar filter does it, P being the variance of the estimate y::

    innovation  v = z_k - a z_(k-1) - (1 - a) y
    S = (1 - a)^2 P + Q + E                  K = ((1 - a) P + Q)/S
    y <- y + K v                             P <- (E (P + Q) + a^2 P Q)/S

For a = 0 it is the scalar Kalman filter of the 2021 paper with R = E. Differencing after Bryson & Henrikson, 1968.

What it costs: settled, the filter has a pole at 1 - K (1 - a), a zero at a, lags a ramp by (1 - K)/(K (1 - a))
readings, and leaves of the noise's variance the part K (1 + a)/(2 - K (1 - a)). More Q: quicker and noisier.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple, TypeVar

from ..record import Real, Vector3
from ..scalar import Scalar, sqrt
from ..vectors import each_axis


class Channel(NamedTuple):
    """One channel's estimate of the true signal, its variance, and the reading before."""

    estimate: Scalar
    variance: Scalar
    reading: Scalar


def noise_variance(a: Scalar, driving: Scalar) -> Scalar:
    """E/(1 - a^2): variance of AR(1) noise."""
    return driving / (1.0 - a * a)


def initial_channel(reading: Scalar, a: Scalar, driving: Scalar) -> Channel:
    """The filter after its first reading: the estimate is that, its variance the noise's."""
    return Channel(reading, noise_variance(a, driving), reading)


def innovation(channel: Channel, reading: Scalar, a: Scalar) -> Scalar:
    """z_k - a z_(k-1) - (1 - a) y: what the reading brings that was not expected; white where the model is right."""
    return reading - a * channel.reading - (1.0 - a) * channel.estimate


def ar1_kalman_filtered(channel: Channel, reading: Scalar, a: Scalar, driving: Scalar, signal: Scalar) -> Channel:
    """The channel after one more reading; `driving` is E, `signal` is Q, variances a reading."""
    before, left = channel.variance, 1.0 - a
    total = left * left * before + signal + driving
    gain = (left * before + signal) / total
    variance = (driving * (before + signal) + a * a * before * signal) / total
    return Channel(channel.estimate + gain * innovation(channel, reading, a), variance, reading)


# --- the settled filter ----------------------------------------------------------------------------------------------


def settled_variance(a: Scalar, driving: Scalar, signal: Scalar) -> Scalar:
    """P = (sqrt((1 + a)^2 Q^2 + 4 Q E) - (1 + a) Q) / (2 (1 - a)): the positive root of the Riccati equation.

    Written with the root in the denominator, which keeps its digits when Q is large; wants Q > 0.
    """
    spread = (1.0 + a) * signal
    root = sqrt(spread * spread + 4.0 * signal * driving)
    return 2.0 * signal * driving / ((1.0 - a) * (root + spread))


def settled_gain(a: Scalar, driving: Scalar, signal: Scalar) -> Scalar:
    """K of the settled filter."""
    left, variance = 1.0 - a, settled_variance(a, driving, signal)
    return (left * variance + signal) / (left * left * variance + signal + driving)


def signal_variance_for(gain: Scalar, a: Scalar, driving: Scalar) -> Scalar:
    """Q = E K^2 / ((1 - K) (1 + a K)): what `signal_variance` must be for the settled filter to have the gain K < 1."""
    return driving * gain * gain / ((1.0 - gain) * (1.0 + a * gain))


# --- six channels ----------------------------------------------------------------------------------------------------

SETTLED_GAIN = 0.2
"""Gain of the default parameters: 0.42 of an AR(1) noise on the rates is left, 28 ms of lag at 500 Hz; 0.37 and 11 ms
on the specific forces."""
# identification.fit_ar1 of the default device at rest, 200 s read at 500 Hz, mean of seeds 1 to 10; each gyro's clock
# beats with the processor's in its own way, the accelerometer's three axes have one
_RATE_COEFFICIENT, _RATE_DRIVING = (0.716, 0.725, 0.712), (2.86e-6, 2.74e-6, 2.91e-6)
_FORCE_COEFFICIENT, _FORCE_DRIVING = (0.243, 0.243, 0.243), (7.74e-6, 7.74e-6, 7.74e-6)


def _signal_variances(coefficients: Vector3, driving: Vector3) -> Vector3:
    return each_axis(lambda i: signal_variance_for(SETTLED_GAIN, coefficients[i], driving[i]))


class RateNoiseParameters(NamedTuple):
    """AR(1) model of each rate channel; start values fitted to the default parts at rest, read at 500 Hz."""

    coefficient: Annotated[
        Vector3, Real("1", "a, noise kept from one reading to the next", min=-0.999, max=0.999, tunable=True)
    ] = _RATE_COEFFICIENT
    driving_variance: Annotated[
        Vector3, Real("rad2/s2", "E, variance of the fresh noise of a reading", min=1e-30, tunable=True)
    ] = _RATE_DRIVING
    signal_variance: Annotated[
        Vector3, Real("rad2/s2", "Q, variance of the true rate's change in a reading", min=0.0, tunable=True)
    ] = _signal_variances(_RATE_COEFFICIENT, _RATE_DRIVING)


class SpecificForceNoiseParameters(NamedTuple):
    """AR(1) model of each specific force channel; start values fitted to the default parts at rest, read at 500 Hz."""

    coefficient: Annotated[
        Vector3, Real("1", "a, noise kept from one reading to the next", min=-0.999, max=0.999, tunable=True)
    ] = _FORCE_COEFFICIENT
    driving_variance: Annotated[
        Vector3, Real("m2/s4", "E, variance of the fresh noise of a reading", min=1e-30, tunable=True)
    ] = _FORCE_DRIVING
    signal_variance: Annotated[
        Vector3, Real("m2/s4", "Q, variance of the true specific force's change in a reading", min=0.0, tunable=True)
    ] = _signal_variances(_FORCE_COEFFICIENT, _FORCE_DRIVING)


class Ar1KalmanParameters(NamedTuple):
    """The filters on the six raw channels."""

    rate: RateNoiseParameters = RateNoiseParameters()
    specific_force: SpecificForceNoiseParameters = SpecificForceNoiseParameters()


class RateFilterState(NamedTuple):
    """The filters on the rates."""

    estimate: Annotated[Vector3, Real("rad/s", "rate as filtered", display="deg/s")]
    variance: Annotated[Vector3, Real("rad2/s2", "variance of the filtered rate")]
    reading: Annotated[Vector3, Real("rad/s", "rate as read last", display="deg/s")]


class SpecificForceFilterState(NamedTuple):
    """The filters on the specific forces."""

    estimate: Annotated[Vector3, Real("m/s2", "specific force as filtered")]
    variance: Annotated[Vector3, Real("m2/s4", "variance of the filtered specific force")]
    reading: Annotated[Vector3, Real("m/s2", "specific force as read last")]


class Ar1KalmanState(NamedTuple):
    """The filters on the six raw channels."""

    rate: RateFilterState
    specific_force: SpecificForceFilterState


_Noise = RateNoiseParameters | SpecificForceNoiseParameters
_Triad = TypeVar("_Triad", RateFilterState, SpecificForceFilterState)


def _initial(kind: type[_Triad], reading: Vector3, p: _Noise) -> _Triad:
    start = each_axis(lambda i: initial_channel(reading[i], p.coefficient[i], p.driving_variance[i]))
    return kind(*zip(*start, strict=True))


def _filtered(triad: _Triad, reading: Vector3, p: _Noise) -> _Triad:
    channels = each_axis(lambda i: Channel(triad.estimate[i], triad.variance[i], triad.reading[i]))
    after = each_axis(
        lambda i: ar1_kalman_filtered(
            channels[i], reading[i], p.coefficient[i], p.driving_variance[i], p.signal_variance[i]
        )
    )
    return type(triad)(*zip(*after, strict=True))


def initial_ar1_kalman(rate: Vector3, specific_force: Vector3, p: Ar1KalmanParameters) -> Ar1KalmanState:
    """The six filters after their first reading (rad/s, m/s^2)."""
    return Ar1KalmanState(
        _initial(RateFilterState, rate, p.rate),
        _initial(SpecificForceFilterState, specific_force, p.specific_force),
    )


def ar1_kalman_step(
    state: Ar1KalmanState, rate: Vector3, specific_force: Vector3, p: Ar1KalmanParameters
) -> Ar1KalmanState:
    """The six filters after one more reading (rad/s, m/s^2); `.rate.estimate` and `.specific_force.estimate` go on."""
    return Ar1KalmanState(
        _filtered(state.rate, rate, p.rate), _filtered(state.specific_force, specific_force, p.specific_force)
    )
