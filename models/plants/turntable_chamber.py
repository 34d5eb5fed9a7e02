"""The air in a temperature chamber around the table.

s' = clip(target - s, -ramp, ramp) as far as a tick reaches,   tau T' = s - T
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Boolean, Real
from ..scalar import Scalar, absolute, clip, either, exp


class Chamber(NamedTuple):
    """The chamber and its controller. Defaults: a bench-top chamber, assumption."""

    initial_temperature: Annotated[float, Real("K", "of the air at the start", 200.0, 450.0, "degC", 300.0)] = 293.15
    ramp_limit: Annotated[float, Real("K/s", "fastest change of the setpoint", 1e-4, 10.0, None, 0.1)] = 0.05
    time_constant: Annotated[float, Real("s", "of the air behind the setpoint", 0.01, 1e5, None, 100.0)] = 60.0
    tolerance: Annotated[float, Real("K", "what counts as reached", 1e-3, 50.0)] = 0.5
    wait: Annotated[bool, Boolean("rests and turns begin when the temperature is reached")] = True


class Air(NamedTuple):
    """Temperatures of now."""

    setpoint: Annotated[float, Real("K", "where the controller wants the air", display="degC")]
    temperature: Annotated[float, Real("K", "of the air", display="degC")]


def aired(chamber: Chamber, air: Air, target: Scalar, period: Scalar) -> Air:
    """One period toward `target` (K): exact for the setpoint joined by a straight line."""
    reach = chamber.ramp_limit * period
    setpoint = air.setpoint + clip(target - air.setpoint, -reach, reach)
    behind = (setpoint - air.setpoint) / period * chamber.time_constant
    left = exp(-period / chamber.time_constant)
    return Air(setpoint, setpoint - behind + (air.temperature - air.setpoint + behind) * left)


def is_at(chamber: Chamber, air: Air, target: Scalar) -> Scalar:
    """Whether rows need not wait for the air."""
    return either(chamber.wait < 0.5, absolute(air.temperature - target) < chamber.tolerance)
