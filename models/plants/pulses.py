"""Short loads: the shutter's blades and mirror, a finger on the button, knocks against the tripod.

Each pulse is given by the momentum that it has handed over so far. A solver step applies the mean over the step, the
difference of momenta over the step's length: the impulse delivered is then exact, even for a pulse shorter than the
step.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Real, Vector3
from ..scalar import PI, Scalar, clip, cos, floor, maximum, sin, where
from .gimbal import Axes


class Shutter(NamedTuple):
    """One exposure: mirror up, first curtain, second curtain, mirror down. Each mass is flung and then stopped.

    A focal-plane blade pack of 0.5 to 2 g (assumption) at 10 m/s [S regex.info 2008-09-04] carries 5 to 20 mN.s at an
    arm of 10 to 20 mm (assumption): 50 to 400 uN.m.s. Its torque is in pitch, none in yaw [S falklumo 2010, K-7].
    The camera takes the impulse when a mass is flung and the opposite when it stops.
    """

    impulse: Annotated[Axes, Real("N.m.s", "angular momentum of a curtain", -0.1, 0.1, None, 1e-4)] = Axes(
        0.0, 1e-4, 0.0
    )
    mirror_impulse: Annotated[
        Axes, Real("N.m.s", "angular momentum of the mirror; 0: a mirrorless camera", -0.1, 0.1, None, 1e-4)
    ] = Axes(0.0, 0.0, 0.0)
    start: Annotated[float, Real("s", "first release, after the start of the run", 0.0, 1e6)] = 5.0
    period: Annotated[float, Real("s", "time between releases; 0: one only", 0.0, 1e6)] = 5.0
    exposure: Annotated[float, Real("s", "from first to second curtain", 0.0, 1e3)] = 0.01  # 1/100 s: the worst case
    lag: Annotated[float, Real("s", "from mirror up to first curtain, second curtain to mirror down", 0.0, 1.0)] = 0.05
    travel: Annotated[float, Real("s", "from fling to stop", 1e-4, 0.1)] = 3e-3  # Nikon D3 [S regex.info]
    width: Annotated[float, Real("s", "of one half sine", 1e-4, 0.1)] = 2e-3  # 2 to 5 ms, engineering judgement


class Knock(NamedTuple):
    """A blow against the tripod's head."""

    impulse: Annotated[Axes, Real("N.m.s", "angular impulse about the apex", -10.0, 10.0, None, 0.01)] = Axes(
        0.0, 0.0, 0.0
    )
    start: Annotated[float, Real("s", "first blow, after the start of the run", 0.0, 1e6)] = 10.0
    period: Annotated[float, Real("s", "time between blows; 0: one only", 0.0, 1e6)] = 0.0
    width: Annotated[float, Real("s", "of the half sine", 1e-4, 1.0)] = 5e-3  # assumption


class Press(NamedTuple):
    """A finger that presses the camera's button and lets go: F (1 - cos(2 pi t/T))/2 downward.

    Hand-borne vibration from a press lies at 2 Hz [S JJE 31(6) 399]: T = 0.5 s.
    """

    force: Annotated[float, Real("N", "largest; 0: a remote release", 0.0, 100.0)] = 0.0  # a button gives way at 2 to 4
    # N, half of which the holding fingers take (assumption)
    position: Annotated[Vector3, Real("m", "of the button, from O in camera axes", -1.0, 1.0, None, 0.01)] = (
        0.05,
        0.0,
        0.035,
    )  # top right of a body, assumption
    start: Annotated[float, Real("s", "first press, after the start of the run", 0.0, 1e6)] = 4.8
    period: Annotated[float, Real("s", "time between presses; 0: one only", 0.0, 1e6)] = 5.0
    duration: Annotated[float, Real("s", "from touch to letting go", 1e-3, 100.0)] = 0.5


def half_sine_share(since: Scalar, width: Scalar) -> Scalar:
    """Share of a half sine's area that has passed: (1 - cos(pi t/width))/2, 0 before and 1 after."""
    return 0.5 - 0.5 * cos(PI * clip(since / width, 0.0, 1.0))


def _cycles(since: Scalar, period: Scalar) -> Scalar:
    """Whole periods that have passed, 0 if there is no period."""
    return where(period > 0.0, maximum(floor(since / maximum(period, 1e-9)), 0.0), 0.0)


def knock_share(knock: Knock, time: Scalar) -> Scalar:
    """Number of blows that the tripod has taken by `time` (s), the running one in part."""
    since = time - knock.start
    cycles = _cycles(since, knock.period)
    return cycles + half_sine_share(since - cycles * knock.period, knock.width)


def press_share(press: Press, time: Scalar) -> Scalar:
    """Number of presses that the camera has taken by `time` (s), each of the impulse F T/2; the running one in part."""
    since = time - press.start
    cycles = _cycles(since, press.period)
    done = clip((since - cycles * press.period) / press.duration, 0.0, 1.0)
    return cycles + done - sin(2.0 * PI * done) / (2.0 * PI)


def _flung(since: Scalar, travel: Scalar, width: Scalar) -> Scalar:
    return half_sine_share(since, width) - half_sine_share(since - travel, width)


def shutter_shares(shutter: Shutter, time: Scalar) -> tuple[Scalar, Scalar]:
    """Momentum that curtains and mirror hold at `time` (s), as shares of their impulses."""
    since = time - shutter.start
    since = since - _cycles(since, shutter.period) * shutter.period
    travel, width = shutter.travel, shutter.width
    opening = since - shutter.lag
    closing = opening - shutter.exposure
    curtains = _flung(opening, travel, width) + _flung(closing, travel, width)
    mirror = _flung(since, travel, width) - _flung(closing - shutter.lag, travel, width)
    return curtains, mirror


def shutter_length(shutter: Shutter) -> Scalar:
    """From release to rest, s."""
    return 2.0 * shutter.lag + shutter.exposure + shutter.travel + shutter.width
