"""The six-axis ADIS16354 as data: its gyros at their three ranges, each with its accelerometers.

The ADIS16354's own datasheet was not found. "Sister" is the sheet of the ADIS16350/ADIS16355, Rev. B (9/2009): same
housing, register map and gyros, another accelerometer. Drivers for the ADIS16354 itself: ADIS16354A.h (Chamberlain),
PX4's ADIS16354.cpp.
"""

from __future__ import annotations

from typing import NamedTuple

from .datasheet import Choice, Datum, Part, Tolerance, not_given

SAMPLING_FREQUENCY = Datum(819.2, "Hz", "PX4; sister Table 17, SMPL_PRD 0x0001", "driver")
SUPPLY_WEIGHT = Datum(1.8315, "mV/LSB", "ADIS16354A.h; sister register map", "driver")
AUXILIARY_WEIGHT = Datum(0.6105, "mV/LSB", "ADIS16354A.h; sister register map", "driver")
SUPPLY = (Datum(4.75, "V", "sister Table 1", "sister"), Datum(5.25, "V", "sister Table 1", "sister"))

_ONE_CLOCK = "adis16354.clock_error"
_CLOCK = Tolerance(
    3.0, "%", "limits", "later parts of the family; the sister sheet gives none", "recalled", shared=_ONE_CLOCK
)
_THERMOMETER = {
    "thermometer.sensitivity": Datum(0.1453, "degC/LSB", "ADIS16354A.h; sister Table 1", "driver"),
    "thermometer.code_at_25": Datum(0.0, "LSB", "ADIS16354A.h; sister Table 1", "driver"),
    "thermometer.lowest_code": Datum(
        -2048.0, "LSB", "ADIS16354A.h; sister Table 6, 12 bits in two's complement", "driver"
    ),
    "thermometer.highest_code": Datum(
        2047.0, "LSB", "ADIS16354A.h; sister Table 6, 12 bits in two's complement", "driver"
    ),
}
_THERMAL = {
    "thermal.self_heating": Datum(3.3, "K", "33 mA at 5 V (sister Table 1) through 20 K/W", "assumption"),
    "thermal.warm_up": Datum(290.0, "s", "a module of some 16 g through 20 K/W", "assumption"),
}
_THERMOMETER_ERROR = Tolerance(2.0, "K", "sigma", "sister: no accuracy given", "assumption")

GYROS_300 = Part(
    "ADIS16354 gyros, +-300 deg/s",
    {
        "filter": Choice("bartlett_4", "sister, SENS/AVG 0x0402 at power-up", "sister"),
        "range": Datum(300.0, "deg/s", "ADIS16354A.h and PX4, scale at +-300 deg/s", "driver"),
        "resolution": Datum(0.07326, "deg/s/LSB", "ADIS16354A.h", "driver"),
        "code_limit": Datum(14, "bit", "ADIS16354A.h", "driver"),
        "noise_density": Datum(0.05, "deg/s/rtHz", "sister Table 1, +-300 deg/s, no filtering", "sister"),
        "bias_instability": Datum(0.015, "deg/s RAV minimum", "sister Table 1, in-run bias stability", "sister"),
        "rate_random_walk": not_given("deg/s/rts"),
        "turn_on_bias": not_given("deg/s"),
        "bandwidth": Datum(350.0, "Hz", "sister p. 19: 0.45 ms, one pole", "sister"),
        "resonator_frequency": Datum(14e3, "Hz", "sister Table 1; without effect with a Bartlett filter", "sister"),
        "sampling_frequency": SAMPLING_FREQUENCY,
        "divider": Datum(1, "1", "sister Table 17, SMPL_PRD 0x0001 at power-up", "sister"),
        "clock_jitter": not_given("s"),
        "bias_temperature_curve": not_given("deg/s/degC2"),
        "hysteresis": not_given("deg/s"),
        "hysteresis_width": Datum(5.0, "K", "without effect while the hysteresis is zero", "assumption"),
        "supply_sensitivity": Datum(0.25, "deg/s/V", "sister Table 1; the sign is assumed", "sister"),
        "scale_temperature_curve": not_given("%/degC2"),
        "nonlinearity": Datum(0.1, "% FS largest", "sister Table 1, best fit; largest deviation assumed", "sister"),
        "cross_axis": not_given("%", "in non-orthogonality and misalignment"),
        "rectification": not_given("deg/s/g2"),
        "autonull": Choice("none", "sister Table 15: only on command", "sister"),
        "null_resolution": Datum(0.018315, "deg/s/LSB", "sister register map, xGYRO_OFF", "sister"),
        "self_test_response": Datum(
            52.97, "deg/s", "sister Table 1, 723 LSB at +-300 deg/s, 432 to 1105", "sister", limits=(31.65, 80.95)
        ),
        **_THERMOMETER,
        **_THERMAL,
    },
    {
        "clock_error": _CLOCK,
        "bias": Tolerance(0.25, "deg/s", "sigma", "sister Figure 10, ADIS16355", "sister"),
        "bias_temperature_slope": Tolerance(0.01, "deg/s/degC", "sigma", "as the ADIS16355", "recalled"),
        "scale_error": Tolerance(0.06, "%", "sigma", "sister Figure 16; limits +-1 %", "sister", mean=0.11),
        "scale_temperature_slope": Tolerance(40.0, "ppm/degC", "sigma", "as the ADIS16355", "recalled"),
        "nonorthogonality": Tolerance(0.05, "deg", "sigma", "sister Table 1, typical", "sister"),
        "misalignment": Tolerance(0.5, "deg", "sigma", "sister Table 1, typical, against the base plate", "sister"),
        "g_sensitivity": Tolerance(0.05, "deg/s/g", "sigma", "sister Table 1, along each axis, compensated", "sister"),
        "thermometer.error": _THERMOMETER_ERROR,
    },
)
GYROS_150 = GYROS_300.varied(
    "ADIS16354 gyros, +-150 deg/s",
    {
        "filter": Choice("bartlett_4", "sister, SENS/AVG: the fewest taps of this range", "sister"),
        "range": Datum(150.0, "deg/s", "sister Table 1", "sister"),
        "resolution": Datum(0.03663, "deg/s/LSB", "sister Table 1", "sister"),
    },
)
GYROS_75 = GYROS_300.varied(
    "ADIS16354 gyros, +-75 deg/s",
    {
        "filter": Choice("bartlett_16", "sister, SENS/AVG: the fewest taps of this range", "sister"),
        "range": Datum(75.0, "deg/s", "sister Table 1", "sister"),
        "resolution": Datum(0.018315, "deg/s/LSB", "sister Table 1, 0.01832 printed; a quarter of 0.07326", "sister"),
    },
)


class GyroRange(NamedTuple):
    """A range of the gyros, and the smallest M of the 2^M taps that go with it."""

    range: Datum
    least_exponent: Datum


GYRO_RANGES = (
    GyroRange(GYROS_75.datum("range"), Datum(4, "1", "sister, SENS/AVG", "sister")),
    GyroRange(GYROS_150.datum("range"), Datum(2, "1", "sister, SENS/AVG", "sister")),
    GyroRange(GYROS_300.datum("range"), Datum(0, "1", "sister, SENS/AVG", "sister")),
)
"""All that the part offers, the narrowest first."""

ACCELEROMETERS = Part(
    "ADIS16354 accelerometers",
    {
        "filter": Choice("bartlett_4", "one SENS/AVG for gyros and accelerometers, 0x0402 at power-up", "sister"),
        "range": Datum(1.7, "g", "PX4", "driver"),
        "resolution": Datum(0.4672, "mg/LSB", "ADIS16354A.h; the Linux driver has the sister's", "driver"),
        "code_limit": Datum(14, "bit", "ADIS16354A.h", "driver"),
        "noise_density": Datum(0.225, "mg/rtHz", "the part's sheet, not seen", "recalled"),
        "bias_instability": Datum(0.1, "mg RAV minimum", "the part's sheet, not seen", "recalled"),
        "rate_random_walk": not_given("mg/rts"),
        "turn_on_bias": not_given("mg"),
        "bandwidth": Datum(350.0, "Hz", "sister Table 1; PX4 agrees", "sister"),
        "sampling_frequency": SAMPLING_FREQUENCY,
        "divider": Datum(1, "1", "sister Table 17, SMPL_PRD 0x0001 at power-up", "sister"),
        "output_data_rate": Choice("500_Hz", "without effect with a Bartlett filter", "assumption"),
        "high_pass": Choice("none", "the part has none", "sister"),
        "clock_jitter": not_given("s"),
        "bias_temperature_curve": not_given("mg/degC2"),
        "hysteresis": not_given("mg"),
        "hysteresis_width": Datum(5.0, "K", "without effect while the hysteresis is zero", "assumption"),
        "supply_sensitivity": not_given("mg/V"),
        "scale_temperature_curve": not_given("%/degC2"),
        "nonlinearity": Datum(0.2, "% FS largest", "sister Table 1, +-0.2", "sister"),
        "cross_axis": not_given("%", "in non-orthogonality and misalignment"),
        "rectification": not_given("g/g2"),
        "overload": Datum(2000.0, "g", "sister, shock survival; without effect: the part never falls silent", "sister"),
        "self_test_response": not_given("g", "the sister's is that of another accelerometer"),
        **_THERMOMETER,
        **_THERMAL,
    },
    {
        "clock_error": _CLOCK,
        "bias": Tolerance(12.0, "mg", "sigma", "sister Figure 15 has this for another accelerometer", "assumption"),
        "bias_temperature_slope": Tolerance(0.3, "mg/degC", "sigma", "the part's sheet, not seen", "recalled"),
        "scale_error": Tolerance(2.0, "%", "three sigma", "0.458 to 0.477 mg/LSB, the part's sheet", "recalled"),
        "scale_temperature_slope": Tolerance(40.0, "ppm/degC", "sigma", "as the ADIS16355", "recalled"),
        "nonorthogonality": Tolerance(0.25, "deg", "sigma", "sister Table 1, typical", "sister"),
        "misalignment": Tolerance(0.5, "deg", "sigma", "sister Table 1, typical, against the base plate", "sister"),
        "thermometer.error": _THERMOMETER_ERROR,
    },
)
ACCELEROMETERS_75 = ACCELEROMETERS.varied("ADIS16354 accelerometers", {"filter": GYROS_75.numbers["filter"]})
