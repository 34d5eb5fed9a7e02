"""Die temperature: tau dT/dt = T_ambient + dT_self - T."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Boolean, Real
from ..scalar import Scalar, exp, where


class ThermalParameters(NamedTuple):
    """A die that warms itself above its surroundings."""

    self_heating: Annotated[float, Real("K", "rise of the die above ambient once warm", min=0.0, max=60.0)]
    warm_up: Annotated[float, Real("s", "time constant of warming up", min=1e-3)]
    warmed_up: Annotated[bool, Boolean("switched on long ago")] = True


def initial_die_temperature(thermal: ThermalParameters, ambient: Scalar) -> Scalar:
    """Ambient for a part just switched on, ambient and self-heating for one switched on long ago."""
    return ambient + where(thermal.warmed_up > 0.5, thermal.self_heating, 0.0)


def die_temperature(thermal: ThermalParameters, die: Scalar, ambient: Scalar, period: Scalar) -> Scalar:
    """Die temperature `period` s later, ambient held."""
    target = ambient + thermal.self_heating
    return target + (die - target) * exp(-period / thermal.warm_up)
