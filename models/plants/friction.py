"""LuGre friction of a joint: an elastic bristle that slips.

    z' = w - sigma0 |w| / g(w) z,   g = Tc + (Ts - Tc) exp(-(w/ws)^2),   T = sigma0 z + sigma1 z' + sigma2 w

Source: Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40 (1995) 419.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Real
from ..scalar import Scalar, absolute, exp, maximum, sqrt, where

_LEAST_LEVEL = 1e-12
"""N.m; keeps the division by g defined when there is no friction."""


class Friction(NamedTuple):
    """Friction of one joint. Defaults: a small camera gimbal, 1 to 5 mN.m, 0.1 to 1 mrad (assumption)."""

    coulomb: Annotated[float, Real("N.m", "torque of steady sliding; 0 leaves viscous friction only", 0.0, 10.0)] = 2e-3
    static_ratio: Annotated[float, Real("1", "break-away torque over sliding torque", 1.0, 5.0)] = 1.3
    stribeck_rate: Annotated[float, Real("rad/s", "rate at which break-away fades", 1e-6, 10.0, "deg/s")] = 0.02
    presliding: Annotated[
        float, Real("rad", "elastic angle before sliding, sliding torque over stiffness", 1e-7, 0.1, "deg", 1e-4)
    ] = 5e-4
    damping_ratio: Annotated[float, Real("1", "of the camera's motion on the bristle", 0.0, 10.0)] = 0.5
    viscous: Annotated[float, Real("N.m.s/rad", "torque per rate", 0.0, 10.0, None, 1e-4)] = 3e-4


class LuGre(NamedTuple):
    """The constants of the equations above."""

    stiffness: Annotated[float, Real("N.m/rad", "sigma0")]
    damping: Annotated[float, Real("N.m.s/rad", "sigma1")]
    viscous: Annotated[float, Real("N.m.s/rad", "sigma2")]
    coulomb: Annotated[float, Real("N.m", "Tc")]
    extra: Annotated[float, Real("N.m", "Ts - Tc")]
    sharpness: Annotated[float, Real("s2/rad2", "1/ws^2")]


def lugre(friction: Friction, inertia: Scalar) -> LuGre:
    """sigma0 = Tc / z_s, sigma1 = 2 zeta sqrt(sigma0 J) for a joint that turns the inertia J (kg.m2)."""
    stiffness = friction.coulomb / friction.presliding
    product = stiffness * inertia
    # the root's slope at zero is infinite: without friction there is nothing to differentiate
    root = where(product > 0.0, sqrt(where(product > 0.0, product, 1.0)), 0.0)
    return LuGre(
        stiffness=stiffness,
        damping=2.0 * friction.damping_ratio * root,
        viscous=friction.viscous,
        coulomb=friction.coulomb,
        extra=(friction.static_ratio - 1.0) * friction.coulomb,
        sharpness=1.0 / (friction.stribeck_rate * friction.stribeck_rate),
    )


def _decay(constants: LuGre, rate: Scalar) -> Scalar:
    """sigma0 |w| / g(w), 1/s."""
    stiffness, _, _, coulomb, extra, sharpness = constants
    level = maximum(coulomb + extra * exp(-rate * rate * sharpness), _LEAST_LEVEL)
    return stiffness * absolute(rate) / level


def bristle_after(constants: LuGre, bristle: Scalar, rate: Scalar, duration: Scalar) -> Scalar:
    """The bristle (rad) after `duration` (s) at a constant rate: exact, hence stable at any rate.

    z exp(-x) + w t (1 - exp(-x)) / x,  x = sigma0 |w| t / g(w)
    """
    x = _decay(constants, rate) * duration
    left = exp(-x)
    mean = where(x > 1e-6, (1.0 - left) / maximum(x, 1e-6), 1.0 - 0.5 * x)
    return bristle * left + rate * duration * mean


def friction_torque(constants: LuGre, bristle: Scalar, rate: Scalar) -> Scalar:
    """T = sigma0 z + sigma1 z' + sigma2 w, N.m against the motion."""
    slip = rate - _decay(constants, rate) * bristle
    return constants.stiffness * bristle + constants.damping * slip + constants.viscous * rate
