"""The single-axis gyros ADXRS450 and ADXRS453 as data.

Sheets: ADXRS450 Rev. 0 (1/2011), whole; ADXRS453 Rev. B, front page only. Table 1 holds over -40..105 degC at 5 V.
"""

from __future__ import annotations

from .adis16354_sheet import SAMPLING_FREQUENCY
from .datasheet import Choice, Datum, Part, Tolerance, not_given

NULL_ACCURACY = Datum(3.0, "deg/s", "Rev. 0 Table 1, typical column, over temperature")
CONTINUOUS_SELF_TEST = Datum(2559.0, "LSB", "Rev. 0 Table 1, in the register LOCST")
SUPPLY = (Datum(3.15, "V", "Rev. 0 Table 1, lowest supply"), Datum(5.25, "V", "Rev. 0 Table 1, highest supply"))
THERMOMETER_ZERO = Datum(45.0, "degC", "Rev. 0 Table 1, temperature of 0 LSB")

_THREE_SIGMA = "printed as typical, but that of the sensitivity is three sigma of its histogram"

ADXRS450 = Part(
    "ADXRS450",
    {
        "filter": Choice("cic", "Rev. 0 p. 11: sinc^2 over 128/f0"),
        "range": Datum(300.0, "deg/s", "Rev. 0 Table 1, guaranteed full scale"),
        "resolution": Datum(80.0, "LSB/(deg/s)", "Rev. 0 Table 1"),
        "code_limit": Datum(16, "bit", "Rev. 0 Table 9"),
        "noise_density": Datum(0.015, "deg/s/rtHz", "Rev. 0 Table 1, one-sided, 25 degC"),
        "bias_instability": Datum(25.0, "deg/h RAV minimum", "Rev. 0 p. 1, null offset stability"),
        "rate_random_walk": not_given("deg/s/rts"),
        "turn_on_bias": not_given("deg/s"),
        "bandwidth": Datum(10.6e3, "Hz", "Rev. 0 p. 11, three blocks below 5 us each", "calculated"),
        "resonator_frequency": Datum(16e3, "Hz", "Rev. 0 p. 11"),
        "sampling_frequency": SAMPLING_FREQUENCY,  # without effect: the CIC's rates follow from f0
        "divider": Datum(1, "1", "without effect: the CIC's rates follow from f0", "assumption"),
        "clock_jitter": not_given("s"),
        "bias_temperature_curve": not_given("deg/s/degC2"),
        "hysteresis": not_given("deg/s"),
        "hysteresis_width": Datum(5.0, "K", "without effect while the hysteresis is zero", "assumption"),
        "supply_sensitivity": not_given("deg/s/V"),
        "scale_temperature_curve": not_given("%/degC2"),
        "nonlinearity": Datum(0.05, "% FS rms", "Rev. 0 Table 1, typical; 0.25 at most"),
        "nonorthogonality": not_given("deg", "in the cross-axis sensitivity"),
        "misalignment": not_given("deg", "in the cross-axis sensitivity; how it is soldered is the user's"),
        "rectification": Datum(0.003, "deg/s/g2", "Rev. 0 Table 1; the sign is assumed"),
        "autonull": Choice("none", "the part has none"),
        "null_resolution": Datum(80.0, "LSB/(deg/s)", "Rev. 0, register DNC"),
        "self_test_response": not_given("deg/s", "the self-test shows in LOCST, not in the rate"),
        "thermometer.sensitivity": Datum(5.0, "LSB/degC", "Rev. 0 Table 1"),
        "thermometer.code_at_25": Datum(-100.0, "LSB", "Rev. 0 Table 1: 0 LSB at 45 degC, 5 LSB/degC", "calculated"),
        "thermometer.lowest_code": Datum(-512.0, "LSB", "Rev. 0, register TEM, 10 bits in two's complement"),
        "thermometer.highest_code": Datum(511.0, "LSB", "Rev. 0, register TEM, 10 bits in two's complement"),
        "thermal.self_heating": Datum(4.5, "K", "30 mW (Rev. 0 Table 1) through 150 K/W", "assumption"),
        "thermal.warm_up": Datum(60.0, "s", "small board in still air", "assumption"),
    },
    {
        "clock_error": Tolerance(18.75, "%", "limits", "Rev. 0 Table 10, f0 of 13 to 19 kHz"),
        "bias": Tolerance(0.42, "deg/s", "sigma", "Rev. 0 pp. 7-8 histogram, SOIC, 25 degC", "figure", mean=0.33),
        "bias_temperature_slope": Tolerance(
            0.003, "deg/s/degC", "sigma", "Rev. 0 Figure 14 and the histogram's 0.45 deg/s over 145 degC", "figure"
        ),
        "scale_error": Tolerance(0.42, "%", "sigma", "Rev. 0 pp. 7-8 histogram, SOIC, 25 degC", "figure", mean=0.35),
        "scale_temperature_slope": Tolerance(
            0.0059, "%/degC", "sigma", "Rev. 0 pp. 7-8 histogram, 0.85 % over 145 degC", "figure"
        ),
        "cross_axis": Tolerance(3.0, "%", "three sigma", f"Rev. 0 Table 1; {_THREE_SIGMA}"),
        "g_sensitivity": Tolerance(0.03, "deg/s/g", "sigma", "Rev. 0 Table 1, typical, along each axis"),
        "thermometer.error": Tolerance(2.0, "K", "sigma", "the sheet gives no accuracy", "assumption"),
    },
)

ADXRS453 = ADXRS450.as_sister("ADXRS453").varied(
    "ADXRS453",
    {
        "range": Datum(300.0, "deg/s", "Rev. B p. 1"),
        "resolution": Datum(80.0, "LSB/(deg/s)", "no-OS adxrs453.c", "driver"),
        "bias_instability": Datum(16.0, "deg/h RAV minimum", "Rev. B p. 1, null bias stability"),
        "rectification": Datum(0.0002, "deg/s/g2", "the sheet's Table 1, not seen", "recalled"),
    },
    {
        "bias": Tolerance(0.4, "deg/s", "sigma", "the sheet's Table 1 at 25 degC, not seen", "recalled"),
        "g_sensitivity": Tolerance(0.01, "deg/s/g", "sigma", "Rev. B p. 1, typical, along each axis"),
    },
)
