"""Temperatures: die, enclosure with a thermostat, and what the parts' own thermometers read."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Boolean, Integer, Real
from ..scalar import Scalar, absolute, clip, exp, where
from .words import nearest_code


class ThermalParameters(NamedTuple):
    """A die that warms itself above its surroundings."""

    self_heating: Annotated[float, Real("K", "rise of the die above ambient once warm", min=0.0, max=60.0)]
    warm_up: Annotated[float, Real("s", "time constant of warming up", min=1e-3)]
    warmed_up: Annotated[bool, Boolean("switched on long ago")] = True


class ThermometerParameters(NamedTuple):
    """A part's thermometer: code = code_at_25 + sensitivity (T + error - 25 degC), as far as its register goes."""

    sensitivity: Annotated[float, Real("1/K", "LSB per kelvin", min=-1000.0, max=1000.0)]
    code_at_25: Annotated[float, Real("1", "code at 25 degC", min=-65536.0, max=65536.0)]
    lowest_code: Annotated[float, Integer("smallest code that the register holds", min=-65536, max=65536)]
    highest_code: Annotated[float, Integer("largest code that the register holds", min=-65536, max=65536)]
    error: Annotated[float, Real("K", "what the thermometer reads too much", min=-50.0, max=50.0)] = 0.0


class HeaterParameters(NamedTuple):
    """A thermostat around the sensor, as the 2021 paper suggests: a heated enclosure, PI-controlled.

    All numbers are assumptions: a small insulated box at 45 degC that full power brings to there from 0 degC.
    """

    enabled: Annotated[bool, Boolean("the heater is fitted and on")] = False
    setpoint: Annotated[
        float, Real("K", "temperature that the enclosure is held at", min=250.0, max=400.0, display="degC")
    ] = 318.15
    largest_rise: Annotated[float, Real("K", "rise above ambient at full power", min=1.0, max=200.0)] = 45.0
    time_constant: Annotated[float, Real("s", "of the enclosure", min=1.0)] = 120.0
    gain: Annotated[float, Real("1/K", "share of full power per kelvin too cold", min=0.0)] = 0.5
    reset_time: Annotated[float, Real("s", "of the controller's integral", min=1.0)] = 60.0


class HeaterState(NamedTuple):
    """The enclosure and its controller."""

    temperature: Annotated[float, Real("K", "temperature in the enclosure", display="degC")]
    integral: Annotated[float, Real("1", "integral's share of full power")]


def initial_heater(ambient: Scalar) -> HeaterState:
    """Switched on now, at ambient temperature."""
    return HeaterState(ambient, 0.0)


def heated(state: HeaterState, p: HeaterParameters, ambient: Scalar, period: Scalar) -> HeaterState:
    """tau dT/dt = T_ambient + P R - T with P = clip(gain e + integral, 0, 1), one period on; without heater ambient."""
    error = p.setpoint - state.temperature
    wanted = p.gain * error + state.integral
    power = clip(wanted, 0.0, 1.0)
    target = ambient + power * p.largest_rise
    temperature = target + (state.temperature - target) * exp(-period / p.time_constant)
    # the integral waits while the power is at its limit
    integral = state.integral + where(power == wanted, p.gain * error * (period / p.reset_time), 0.0)
    on = p.enabled > 0.5
    return HeaterState(where(on, temperature, ambient), where(on, integral, 0.0))


def initial_die_temperature(thermal: ThermalParameters, ambient: Scalar) -> Scalar:
    """Ambient for a part just switched on, ambient and self-heating for one switched on long ago."""
    return ambient + where(thermal.warmed_up > 0.5, thermal.self_heating, 0.0)


def die_temperature(thermal: ThermalParameters, die: Scalar, ambient: Scalar, period: Scalar) -> Scalar:
    """tau dT/dt = T_ambient + dT_self - T, `period` s later, ambient held."""
    target = ambient + thermal.self_heating
    return target + (die - target) * exp(-period / thermal.warm_up)


def thermometer_code(thermometer: ThermometerParameters, temperature: Scalar) -> Scalar:
    """The thermometer's register at the die temperature T (K)."""
    warmer = temperature + thermometer.error - 298.15
    wanted = thermometer.code_at_25 + thermometer.sensitivity * warmer
    return nearest_code(wanted, thermometer.lowest_code, thermometer.highest_code)


def thermometer_reading(thermometer: ThermometerParameters, code: Scalar) -> Scalar:
    """The temperature (K) that a processor makes of the code; 25 degC where the thermometer has no sensitivity."""
    fitted = absolute(thermometer.sensitivity) > 1e-9
    return 298.15 + where(fitted, (code - thermometer.code_at_25) / where(fitted, thermometer.sensitivity, 1.0), 0.0)
