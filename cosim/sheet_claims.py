"""What the datasheets print as codes and as random walks, beside the numbers that the model is made of.

The codes are the sheets' worked examples, or whole multiples of what they print for one LSB, written down as numbers:
nothing here is calculated as the model calculates it.
"""

from __future__ import annotations

from typing import NamedTuple

from attitude_fmu.models.sensors.devices import device_called

from .characteristics import Part


class Example(NamedTuple):
    """A code of the register at an input in the sheet's unit: deg/s, g, degC."""

    given: float
    code: int


class RandomWalk(NamedTuple):
    """Angle or velocity random walk as printed, deg/rt h or mm/s/rt h, and why it is not the model's."""

    printed: str
    why: str
    source: str
    confidence: str


class SheetClaims(NamedTuple):
    """Codes of the data registers and of the thermometer, with their sources; the random walk if one is printed."""

    codes: tuple[Example, ...]
    codes_source: str
    thermometer: tuple[Example, ...]
    thermometer_source: str
    random_walk: RandomWalk | None


def sheet_claims(device: str) -> dict[Part, SheetClaims]:
    """The claims for both parts of a device.

    Raises `UnknownDeviceError` for a device that is not known.
    """
    found = device_called(device)
    return {"gyro": _CLAIMS[found.gyro.name], "accelerometer": _CLAIMS[found.accelerometer.name]}


def _examples(*pairs: tuple[float, int]) -> tuple[Example, ...]:
    return tuple(Example(*pair) for pair in pairs)


_ADXRS450 = SheetClaims(
    _examples((300.0, 24_000), (-300.0, -24_000), (1.0, 80), (-1.0, -80), (0.0125, 1), (-0.0125, -1), (0.0, 0)),
    "ADXRS450 Rev. 0, rate data format",
    _examples((85.0, 200), (45.0, 0), (0.0, -225)),
    "ADXRS450 Rev. 0, temperature register, worked examples",
    None,
)


def _adxl355(one_g: int, range_g: int, printed: str) -> SheetClaims:
    return SheetClaims(
        _examples(
            (1.0, one_g),
            (-1.0, -one_g),
            (float(range_g), range_g * one_g),
            (-float(range_g), -range_g * one_g),
            (1.25 * range_g, 524_287),
            (-1.25 * range_g, -524_288),
            (0.0, 0),
        ),
        f"ADXL355 Rev. D Table 2, {one_g} LSB/g, 20 bits in two's complement",
        _examples((25.0, 1885), (5.0, 2066), (45.0, 1704), (125.0, 980)),
        "ADXL355 Rev. D Table 2, 1885 LSB at 25 °C, -9.05 LSB/°C",
        RandomWalk(
            printed,
            "below what the density gives (D/√2 · 60)",
            "ADXL355 Rev. D Table 2, velocity random walk",
            "datasheet",
        ),
    )


_SISTER_THERMOMETER = _examples((25.0, 0), (35.0, 69), (85.0, 413), (-40.0, -447))
"""6.88 LSB/degC from 25 degC on, to whole codes."""


def _adis16354_gyros(thousand_lsb: float) -> SheetClaims:
    return SheetClaims(
        _examples(
            (thousand_lsb, 1000),
            (-thousand_lsb, -1000),
            (0.1 * thousand_lsb, 100),
            (4.0 * thousand_lsb, 4000),
            (-4.0 * thousand_lsb, -4000),
            (0.0, 0),
        ),
        "ADIS16350/55 Rev. B Table 1, weight of an LSB",
        _SISTER_THERMOMETER,
        "ADIS16350/55 Rev. B Table 1, 0 LSB at 25 °C, 6.88 LSB/°C",
        RandomWalk(
            "4.2",
            "twice what the density gives: unfiltered noise read at some 100 Hz",
            "ADIS16350/55 Rev. B Table 1, angular random walk",
            "sister",
        ),
    )


_CLAIMS = {
    "ADXRS450": _ADXRS450,
    "ADXRS453": _ADXRS450,
    "ADXL355 +-2 g": _adxl355(256_000, 2, "5.3 XY, 7.7 Z"),
    "ADXL355 +-4 g": _adxl355(128_000, 4, "5.3 XY, 7.7 Z"),
    "ADXL355 +-8 g": _adxl355(64_000, 8, "5.3 XY, 7.7 Z"),
    "ADIS16354 gyros, +-300 deg/s": _adis16354_gyros(73.26),
    "ADIS16354 gyros, +-150 deg/s": _adis16354_gyros(36.63),
    "ADIS16354 gyros, +-75 deg/s": _adis16354_gyros(18.315),
    "ADIS16354 accelerometers": SheetClaims(
        _examples((0.4672, 1000), (-0.4672, -1000), (0.04672, 100), (1.6352, 3500), (-1.6352, -3500), (0.0, 0)),
        "ADIS16354A.h, 0.4672 mg a LSB",
        _SISTER_THERMOMETER,
        "ADIS16350/55 Rev. B Table 1, 0 LSB at 25 °C, 6.88 LSB/°C",
        RandomWalk("135", "the density without the 1/√2 of an Allan N", "the part's sheet, not seen", "recalled"),
    ),
}
