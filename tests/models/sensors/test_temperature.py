"""Thermometers, the thermostat around the sensor, and the processor's compensation."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from faultless_parts import ADIS, GYRO, STILL, faultless, only_slow, run_of

from attitude_fmu.models.attitude_sensor import MODEL, SLOW_PERIOD
from attitude_fmu.models.errors import ValueRefusedError
from attitude_fmu.models.sensors import adis16354_words, adxl355_registers, adxrs450_frame, thermal, words
from attitude_fmu.models.system import Run


def adxrs450_code(kelvin: float) -> float:
    """The code in the part's TEM register."""
    return words.signed(words.field(adxrs450_frame.temperature_word(kelvin), 6, 10), 10)


def at_celsius(temperature: float) -> Any:
    return STILL._replace(temperature=temperature + 273.15)


@pytest.mark.parametrize(("temperature", "code"), [(0.0, -225.0), (25.0, -100.0), (45.0, 0.0), (85.0, 200.0)])
def test_the_adxrs450_shows_the_sheets_temperature_codes(temperature: float, code: float) -> None:
    run = run_of(faultless(), at_celsius(temperature), 0.0)
    assert run.outputs().register.gyro_temperature == code
    word = adxrs450_frame.temperature_word(temperature + 273.15)
    assert word == (int(code) & 0x3FF) << 6


@pytest.mark.parametrize("temperature", [-40.0, 0.0, 25.0, 61.7, 85.0])
def test_thermometers_agree_with_the_registers_of_their_parts(temperature: float) -> None:
    kelvin = temperature + 273.15
    shown = run_of(faultless(), at_celsius(temperature), 0.0).outputs().register
    assert shown.accelerometer_temperature == adxl355_registers.temperature_code(kelvin)
    shown = run_of(faultless(ADIS), at_celsius(temperature), 0.0).outputs().register
    assert shown.gyro_temperature == adis16354_words.temperature_code(kelvin)
    assert shown.accelerometer_temperature == shown.gyro_temperature


def test_a_thermometers_error_shifts_its_code_and_self_heating_too() -> None:
    p = faultless(gyro__thermometer__error=2.0, gyro__thermal__self_heating=4.0)
    assert run_of(p, at_celsius(25.0), 0.0).outputs().register.gyro_temperature == -100.0 + 5.0 * 6.0
    assert run_of(p, at_celsius(25.0), 0.0).outputs().die_temperature.gyro == pytest.approx(302.15)


@pytest.mark.parametrize(
    ("part", "code", "ends"),
    [
        (faultless().gyro, adxrs450_code, (-512.0, 511.0)),
        (faultless().accelerometer, adxl355_registers.temperature_code, (0.0, 4095.0)),
        (faultless(ADIS).gyro, adis16354_words.temperature_code, (-2048.0, 2047.0)),
        (faultless(ADIS).accelerometer, adis16354_words.temperature_code, (-2048.0, 2047.0)),
    ],
)
def test_a_thermometers_code_ends_with_its_word(part: Any, code: Callable[[float], float], ends: Any) -> None:
    found = [thermal.thermometer_code(part.thermometer, kelvin) for kelvin in np.arange(-200.0, 800.0, 7.0)]
    assert (min(found), max(found)) == ends
    assert found == [code(kelvin) for kelvin in np.arange(-200.0, 800.0, 7.0)]


def test_a_thermometer_whose_lowest_code_lies_above_its_highest_is_refused() -> None:
    with pytest.raises(ValueRefusedError, match=r"sensor.gyro.thermometer.lowest_code = 600: above the highest code"):
        Run(MODEL, faultless(gyro__thermometer__lowest_code=600), STILL, name="sensor")


def test_a_reading_is_the_temperature_to_half_a_step() -> None:
    for p in (faultless(), faultless(ADIS)):
        for meter in (p.gyro.thermometer, p.accelerometer.thermometer):
            for kelvin in np.linspace(233.0, 378.0, 50):
                read = thermal.thermometer_reading(meter, thermal.thermometer_code(meter, kelvin))
                assert abs(read - kelvin) <= 0.5 / abs(meter.sensitivity) + 1e-9
    blind = thermal.ThermometerParameters(0.0, 7.0, -512, 511)
    assert thermal.thermometer_reading(blind, thermal.thermometer_code(blind, 350.0)) == 298.15


# --- thermostat ------------------------------------------------------------------------------------------------------


class Enclosure:
    """An enclosure with a thermostat, switched on at an ambient temperature in degC."""

    def __init__(self, ambient: float) -> None:
        self.parameters = thermal.HeaterParameters(enabled=True)
        self.state = thermal.initial_heater(ambient + 273.15)

    def after(self, seconds: float, ambient: float) -> float:
        """Temperature in degC so much later."""
        for _ in range(round(seconds / SLOW_PERIOD)):
            self.state = thermal.heated(self.state, self.parameters, ambient + 273.15, SLOW_PERIOD)
        return self.state.temperature - 273.15


@pytest.mark.parametrize("ambient", [5.0, 20.0, 40.0])
def test_the_thermostat_holds_its_setpoint(ambient: float) -> None:
    enclosure = Enclosure(ambient)
    # the loop 7200 s^2 + 60 (1 + 22.5) s + 22.5 has time constants of 5.6 s and 57 s. From 5 degC full power ends, 2 K
    # short, after 232 s; of these 2 K 368 s later 2 exp(-368/57) = 3 mK are left at most, of 2 K/45 K of power 7e-5,
    # and 22.5 times as much while the integral makes good for them
    assert enclosure.after(600.0, ambient) == pytest.approx(45.0, abs=3e-3)
    power = (45.0 - ambient) / enclosure.parameters.largest_rise
    assert enclosure.state.integral == pytest.approx(power, abs=22.5 * 7e-5)


def test_the_thermostat_cannot_do_more_than_full_power_nor_cool() -> None:
    enclosure = Enclosure(-20.0)  # first order: full power gives 45 K (1 - exp(-t/120 s))
    assert enclosure.after(120.0, -20.0) == pytest.approx(-20.0 + 45.0 * (1 - math.exp(-1.0)))
    # 1620 s are 13.5 time constants: 45 exp(-13.5) = 6e-5 K are left
    assert enclosure.after(1500.0, -20.0) == pytest.approx(25.0, abs=1e-4)
    assert Enclosure(60.0).after(600.0, 60.0) == pytest.approx(60.0)


def test_the_thermostats_integral_does_not_wind_up() -> None:
    enclosure = Enclosure(-20.0)
    enclosure.after(1500.0, -20.0)  # full power for 25 minutes
    assert 0.0 <= enclosure.state.integral <= 1.0
    course = [enclosure.after(10.0, 20.0) for _ in range(90)]
    # both time constants are real: without wind-up nothing overshoots but rounding
    assert max(course) < 45.0 + 1e-6
    # 2 K exp(-(900 - 150)/57): 4e-6 K
    assert course[-1] == pytest.approx(45.0, abs=1e-5)


def test_a_thermostat_takes_nearly_all_of_a_slow_change_away() -> None:
    held, waves = Enclosure(20.0), [20.0 + 8.0 * math.sin(0.1 * minute) for minute in range(70)]
    held.after(900.0, 20.0)
    # |60 i w/(22.5 + 60 (1 + 22.5) i w - 7200 w^2)| at w = 0.1/60 s: 0.0044
    assert np.ptp([held.after(60.0, ambient) for ambient in waves]) < 0.0045 * np.ptp(waves)


def test_the_whole_sensor_lies_in_the_enclosure() -> None:
    p = only_slow(heater__enabled=True, gyro__bias_temperature_slope=(1e-4, 0.0, 0.0), gyro__thermal__warm_up=5.0)
    run, alone = Run(MODEL, p, at_celsius(20.0)), Enclosure(20.0)
    for minute in range(1, 4):
        run.advance(at_celsius(20.0), 60.0 * minute)
        alone.after(60.0, 20.0)
        assert run.state.slow.heater == alone.state
    # the die follows 5 s late; full power ended after 86 s, 2 K short, since when 2 exp(-94/57)/57 K/s are left
    assert run.outputs().die_temperature.gyro == pytest.approx(alone.state.temperature, abs=5.0 * 6.8e-3)
    warmer = run.outputs().die_temperature.gyro - 298.15
    assert run.state.slow.gyro_offset[0] == pytest.approx(1e-4 * warmer)


def test_without_heater_the_sensor_lies_at_ambient_temperature() -> None:
    run = run_of(only_slow(), at_celsius(30.0), 1.0)
    assert run.state.slow.heater == (pytest.approx(303.15), 0.0)


# --- compensation ----------------------------------------------------------------------------------------------------

ERRORS: dict[str, Any] = {
    "bias": (0.01, -0.02, 0.03),
    "bias_temperature_slope": (1e-4, 2e-4, -3e-4),
    "bias_temperature_curve": (1e-6, -2e-6, 4e-6),
    "scale_temperature_slope": (1e-4, -3e-4, 2e-4),
}
MATRIX = ((1.01, 0.02, -0.01), (0.0, 0.98, 0.03), (0.01, 0.0, 1.02))


@pytest.mark.parametrize("device", [GYRO, ADIS])
def test_compensation_takes_out_exactly_what_it_is_given(device: str) -> None:
    # a matrix S = I + diag(scale) + cross, biases and scale by temperature, g-sensitivity: M = S^-1, b, k, G
    scale_error = tuple(MATRIX[i][i] - 1.0 for i in range(3))
    cross = tuple(tuple(0.0 if i == j else MATRIX[i][j] for j in range(3)) for i in range(3))
    push = ((1e-3, 2e-3, -1e-3), (0.0, 3e-3, 1e-3), (-2e-3, 0.0, 1e-3))
    inverse = tuple(map(tuple, np.linalg.inv(np.array(MATRIX)).tolist()))
    errors = {
        f"{part}__{name}": value
        for part in ("gyro", "accelerometer")
        for name, value in {**ERRORS, "scale_error": scale_error, "cross_axis": cross}.items()
    }
    given = {
        f"compensation__{part}_{name}": value
        for part in ("gyro", "accelerometer")
        for name, value in {**ERRORS, "matrix": inverse}.items()
    }
    rate, force = (0.5, -0.6, 0.7), (3.0, 4.0, -5.0)
    moving = at_celsius(65.0)._replace(rate=rate, specific_force=force)
    p = faultless(device, True, gyro__g_sensitivity=push, **errors)
    raw = run_of(p, moving, 0.05).outputs()
    assert max(abs(a - b) for a, b in zip(raw.rate_measured, rate, strict=True)) > 0.01
    wide = {"sensitivity": 1000.0, "lowest_code": -65536, "highest_code": 65536}
    fine = {f"{part}__thermometer__{name}": end for part in ("gyro", "accelerometer") for name, end in wide.items()}
    compensated = faultless(
        device, True, gyro__g_sensitivity=push, compensation__g_sensitivity=push, **errors, **given, **fine
    )
    shown = run_of(compensated, moving, 0.05).outputs()
    # what is left: the thermometers' half step of 1/2000 K
    assert shown.rate_measured == pytest.approx(rate, abs=5e-7)
    assert shown.specific_force_measured == pytest.approx(force, abs=5e-7)


@pytest.mark.parametrize("part", ["gyro", "accelerometer"])
def test_compensation_straightens_a_bent_line(part: str) -> None:
    """Of (1 - c1) v + c3 v^3 the cubic is c3/(1 - c1)^3, and the matrix takes 1 - c1 out."""
    p = faultless(fine=True, **{f"{part}__nonlinearity": 0.01})
    linear, cubic = getattr(MODEL.coefficients(p), part).cubic[:2]
    c, m = cubic / (1.0 - linear) ** 3, 1.0 / (1.0 - linear)
    given = {
        f"compensation__{part}_cubic": (c, c, c),
        f"compensation__{part}_matrix": ((m, 0.0, 0.0), (0.0, m, 0.0), (0.0, 0.0, m)),
    }
    rate, force = (0.5, -1.0, 2.0), (3.0, 6.0, -9.0)
    moving = STILL._replace(rate=rate, specific_force=force)
    read, true = ("rate_measured", rate) if part == "gyro" else ("specific_force_measured", force)
    raw = getattr(run_of(p, moving, 0.05).outputs(), read)
    assert np.min(np.abs(np.array(raw) - true) / np.abs(true)) > 0.01
    straight = faultless(fine=True, **{f"{part}__nonlinearity": 0.01}, **given)
    shown = np.array(getattr(run_of(straight, moving, 0.05).outputs(), read))
    # a Newton step leaves 3 (c y^2)^3 of a reading
    left = 3.0 * (c * np.square(true)) ** 3
    assert np.all(np.abs(shown - true) < (1.5 * left + 1e-8) * np.abs(true))


def test_compensation_is_only_as_good_as_the_thermometer() -> None:
    p = faultless(
        fine=True,
        gyro__bias_temperature_slope=(1e-3, 0.0, 0.0),
        compensation__gyro_bias_temperature_slope=(1e-3, 0.0, 0.0),
        gyro__thermometer__error=2.0,
    )
    shown = run_of(p, at_celsius(45.0), 0.05).outputs()
    assert shown.rate_measured[0] == pytest.approx(-2e-3, abs=1e-8)
