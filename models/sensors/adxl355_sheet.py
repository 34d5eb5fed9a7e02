"""The three-axis accelerometer ADXL355 at its three ranges as data.

Sheets: ADXL354/ADXL355 Rev. D (6/2025) and Rev. 0 (9/2016). Table 2 holds at 25 degC, 3.3 V, 500 Hz.
"""

from __future__ import annotations

from .datasheet import Choice, Datum, Part, Tolerance, not_given

DELAYS = tuple(
    Datum(value, "ms", "Rev. D p. 26, delay by output data rate, 4000 Hz first")
    for value in (0.63, 1.00, 1.78, 3.26, 6.27, 12.34, 24.18, 47.59, 96.25, 189.58, 384.31)
)
HIGH_PASS_CORNERS = tuple(
    Datum(value, "1", "Rev. D p. 27, corner over output data rate, codes 001 to 110")
    for value in (24.7e-4, 6.2084e-4, 1.5545e-4, 0.3862e-4, 0.0954e-4, 0.0238e-4)
)
_SELF_TEST_XY = Datum(0.3, "g", "Rev. D Table 2, X and Y, typical and limits", limits=(0.1, 0.6))
_SELF_TEST_Z = Datum(1.5, "g", "Rev. D Table 2, Z, typical and limits", limits=(0.5, 3.0))
_OVERLOAD_8G = Datum(8.0, "g", "Rev. D p. 24, +-25 %", limits=(6.0, 10.0))
_OVERLOAD_16G = Datum(16.0, "g", "Rev. D p. 24, +-25 % as at +-2 g", limits=(12.0, 20.0))

ADXL355_2G = Part(
    "ADXL355 +-2 g",
    {
        "filter": Choice("decimator", "Rev. D p. 25"),
        "range": Datum(2.048, "g", "20-bit code at 256000 LSB/g", "calculated"),
        "resolution": Datum(256_000.0, "LSB/g", "Rev. D Table 2"),
        "code_limit": Datum(20, "bit", "Rev. D Table 2"),
        "noise_density": Datum(22.5, "ug/rtHz", "Rev. D Table 2, one-sided"),
        "bias_instability": Datum(3.5, "ug RAV minimum", "Rev. 0 Figure 56, Z axis, quoted in public code", "driver"),
        "rate_random_walk": not_given("mg/rts"),
        "turn_on_bias": not_given("mg"),
        "bandwidth": Datum(1500.0, "Hz", "Rev. D pp. 25-27; without effect in the decimator, whose first stage has it"),
        "sampling_frequency": Datum(4000.0, "Hz", "Rev. D p. 25, first decimation"),
        "divider": Datum(1, "1", "without effect in the decimator", "assumption"),
        "output_data_rate": Choice("500_Hz", "Rev. D Table 2, the rate that its numbers are given at"),
        "high_pass": Choice("none", "Rev. D pp. 35-43, reset value of the register Filter"),
        "clock_jitter": not_given("s"),
        "bias_temperature_curve": not_given("mg/degC2"),
        "hysteresis": not_given("mg"),
        "hysteresis_width": Datum(5.0, "K", "without effect while the hysteresis is zero", "assumption"),
        "supply_sensitivity": not_given("mg/V"),
        "scale_temperature_curve": not_given("%/degC2"),
        "nonlinearity": Datum(0.1, "% FS largest", "Rev. D Table 2; largest deviation assumed"),
        "nonorthogonality": not_given("deg", "in the cross-axis sensitivity"),
        "misalignment": not_given("deg", "in the cross-axis sensitivity; how it is soldered is the user's"),
        "rectification": not_given("g/g2", "only a limit is given, 0.4 g at 2.5 g rms, which is overload"),
        "overload": _OVERLOAD_8G,
        "self_test_response": (_SELF_TEST_XY, _SELF_TEST_XY, _SELF_TEST_Z),
        "thermometer.sensitivity": Datum(-9.05, "LSB/degC", "Rev. D Table 2"),
        "thermometer.code_at_25": Datum(1885.0, "LSB", "Rev. D Table 2; Rev. 0 has 1852"),
        "thermometer.lowest_code": Datum(0.0, "LSB", "Rev. D, registers TEMP2 and TEMP1, 12 bits unsigned"),
        "thermometer.highest_code": Datum(4095.0, "LSB", "Rev. D, registers TEMP2 and TEMP1, 12 bits unsigned"),
        "thermal.self_heating": Datum(0.1, "K", "0.66 mW (Rev. D Table 2) through 150 K/W", "assumption"),
        "thermal.warm_up": Datum(60.0, "s", "small board in still air", "assumption"),
    },
    {
        "clock_error": Tolerance(1.4, "%", "limits", "Rev. D p. 25, device to device"),
        "bias": Tolerance(25.0, "mg", "sigma", "Rev. D Table 2, typical; limits +-75 mg", limit=75.0),
        "bias_temperature_slope": Tolerance(
            0.01, "mg/degC", "sigma", "Rev. D Table 2, typical; limits +-0.15 mg/degC", limit=0.15
        ),
        "scale_error": Tolerance(8.0, "%", "three sigma", "Rev. D Table 2, limits by characterisation"),
        "scale_temperature_slope": Tolerance(0.01, "%/degC", "sigma", "Rev. D Table 2, typical"),
        "cross_axis": Tolerance(1.0, "%", "sigma", "Rev. D Table 2, typical"),
        "thermometer.error": Tolerance(5.0, "K", "sigma", "not calibrated (Rev. D), no accuracy given", "assumption"),
    },
)

ADXL355_4G = ADXL355_2G.varied(
    "ADXL355 +-4 g",
    {
        "range": Datum(4.096, "g", "20-bit code at 128000 LSB/g", "calculated"),
        "resolution": Datum(128_000.0, "LSB/g", "Rev. D Table 2"),
        "noise_density": Datum(25.0, "ug/rtHz", "not given at +-4 g; Rev. D Table 2 at +-8 g", "assumption"),
        "nonlinearity": Datum(0.4, "% FS largest", "not given; between 0.1 at +-2 g and 1.6 at +-8 g", "assumption"),
        "overload": _OVERLOAD_16G,
    },
)
ADXL355_8G = ADXL355_2G.varied(
    "ADXL355 +-8 g",
    {
        "range": Datum(8.192, "g", "20-bit code at 64000 LSB/g", "calculated"),
        "resolution": Datum(64_000.0, "LSB/g", "Rev. D Table 2"),
        "noise_density": Datum(25.0, "ug/rtHz", "Rev. D Table 2, +-8 g, one-sided"),
        "nonlinearity": Datum(1.6, "% FS largest", "Rev. D Table 2, +-8 g; largest deviation assumed"),
        "overload": _OVERLOAD_16G,
    },
)
