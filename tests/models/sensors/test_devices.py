"""The parts as data, whole devices, and the pieces drawn from their tolerances.

Numbers come from facts of the datasheets named there: ADXRS450 Rev. 0 Table 1, ADXL355 Rev. D Table 2, ADIS16350/55
Rev. B Table 1.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from attitude_fmu.models.attitude_sensor import MODEL, Inputs, Parameters
from attitude_fmu.models.errors import AttitudeFmuError, ValueRefusedError
from attitude_fmu.models.record import defaults, leaves, refusal, with_defaults
from attitude_fmu.models.sensors import adis16354_sheet, adxl355_sheet, adxrs450_sheet, devices
from attitude_fmu.models.sensors.datasheet import CONFIDENCE, READINGS, UNSURE, Datum, Part, Tolerance, in_si
from attitude_fmu.models.sensors.sensitivity import cubic_gains
from attitude_fmu.models.system import Run, check_rules

DEVICES = tuple(devices.DEVICES)
LEAVES = {leaf.name: leaf for leaf in leaves(Parameters)}
PARTS = [
    part for sheet in (adxrs450_sheet, adxl355_sheet, adis16354_sheet) for part in vars(sheet).values()
    if isinstance(part, Part)
]  # fmt: skip
MODULES = (adxrs450_sheet, adxl355_sheet, adis16354_sheet)
PIECES = 400


def record_of(name: str, number: int = 0, **values: object) -> Parameters:
    """The sensor's parameters of a device."""
    wanted = {**devices.parameters(name, number), **{key.replace("__", "."): value for key, value in values.items()}}
    whole: Parameters = defaults(with_defaults(Parameters, wanted))
    return whole


# the sheets


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.name)
def test_every_number_has_a_source_and_a_known_confidence(part: Part) -> None:
    for name, number in part.numbers.items():
        for datum in number if isinstance(number[0], tuple) else (number,):
            assert datum.source, name
            assert datum.confidence in CONFIDENCE, name
            if isinstance(datum, Datum):
                assert math.isfinite(datum.si), name
    for name, tolerance in part.tolerances.items():
        assert tolerance.source, name
        assert tolerance.confidence in CONFIDENCE, name
        assert tolerance.reading in READINGS, name
        assert tolerance.size > 0.0, name
        assert in_si(1.0, tolerance.unit) > 0.0, name
    assert not set(part.numbers) & set(part.tolerances)


def test_numbers_beside_the_parameters_have_them_too() -> None:
    found = [value for module in MODULES for value in vars(module).values() if isinstance(value, Datum)]
    assert len(found) >= 6
    for datum in found:
        assert datum.source
        assert datum.confidence in CONFIDENCE
        assert math.isfinite(datum.si)


@pytest.mark.parametrize(
    ("part", "name", "expected"),
    [
        (adxrs450_sheet.ADXRS450, "noise_density", math.radians(0.015)),
        (adxrs450_sheet.ADXRS450, "resolution", math.radians(0.0125)),
        (adxrs450_sheet.ADXRS450, "bias_instability", math.radians(25.0 / 3600.0) / 0.664),
        (adxrs450_sheet.ADXRS450, "rectification", math.radians(0.003) / 9.80665**2),
        (adxrs450_sheet.ADXRS450, "code_limit", 32768),
        (adxl355_sheet.ADXL355_2G, "noise_density", 22.5e-6 * 9.80665),
        (adxl355_sheet.ADXL355_2G, "resolution", 3.90625e-6 * 9.80665),
        (adxl355_sheet.ADXL355_8G, "resolution", 15.625e-6 * 9.80665),
        (adis16354_sheet.GYROS_150, "resolution", math.radians(0.03663)),
        (adis16354_sheet.ACCELEROMETERS, "resolution", 0.4672e-3 * 9.80665),
        (adis16354_sheet.GYROS_300, "thermometer.sensitivity", 1.0 / 0.1453),
    ],
)
def test_datasheet_units_become_si(part: Part, name: str, expected: float) -> None:
    assert part.si(name) == pytest.approx(expected, rel=1e-12)


def test_a_largest_deviation_becomes_the_rms_of_the_models_cubic() -> None:
    linear, cubic, _ = cubic_gains(in_si(1.0, "% FS largest"), 2.0)
    bend = [abs(cubic * x**3 - linear * x) for x in np.linspace(-2.0, 2.0, 2001)]
    assert max(bend) == pytest.approx(0.01 * 2.0, rel=1e-3)


def test_the_adxrs453_is_no_surer_than_its_sister_where_its_own_sheet_was_not_seen() -> None:
    own = {"range", "resolution", "bias_instability"}
    for name, number in adxrs450_sheet.ADXRS453.numbers.items():
        assert name in own or number.confidence in UNSURE, name  # type: ignore[union-attr]
    assert adxrs450_sheet.ADXRS453.tolerances["g_sensitivity"].confidence == "datasheet"


# whole devices


@pytest.mark.parametrize("name", DEVICES)
def test_every_entry_is_a_parameter_in_its_range_and_has_its_source(name: str) -> None:
    origins = devices.origins(name)
    for number in (0, 1, 2, 3):
        values = devices.parameters(name, number)
        assert set(values) == set(origins)
        for parameter, value in values.items():
            assert refusal(LEAVES[parameter], value, name) is None
            assert type(value) is type(LEAVES[parameter].start), parameter
        check_rules(MODEL, record_of(name, number), name)


@pytest.mark.parametrize("name", DEVICES)
def test_every_parameter_of_the_parts_is_in_a_device(name: str) -> None:
    of_the_run = {"gyro.self_test", "accelerometer.self_test", "gyro.thermal.warmed_up"}
    of_the_run.add("accelerometer.thermal.warmed_up")
    of_parts = {parameter for parameter in LEAVES if parameter.startswith(("gyro.", "accelerometer."))}
    named = {parameter for parameter in devices.parameters(name) if parameter.startswith(("gyro.", "accelerometer."))}
    assert named == of_parts - of_the_run


def test_the_default_sensor_is_the_default_device_with_one_boards_errors() -> None:
    origins = devices.origins(devices.DEFAULT)
    for name, value in devices.parameters(devices.DEFAULT).items():
        start = LEAVES[name].start
        if isinstance(origins[name], Tolerance):
            if origins[name].reading == "limits":
                assert abs(start) <= in_si(origins[name].size, origins[name].unit), name
            else:
                tolerance = origins[name]
                assert abs(start) <= in_si(abs(tolerance.mean) + 3.0 * tolerance.size, tolerance.unit), name
        else:
            assert start == value, name


@pytest.mark.parametrize("name", DEVICES)
def test_a_device_runs(name: str) -> None:
    run = Run(MODEL, record_of(name, 1), Inputs())
    run.advance(Inputs(), 0.05)
    shown = run.outputs()
    assert shown.specific_force_measured[2] == pytest.approx(9.80665, rel=0.1)
    assert max(map(abs, shown.rate_measured)) < math.radians(5.0)


@pytest.mark.parametrize(("name", "taps"), [("ADIS16354_150", "bartlett_2"), ("ADIS16354_75", "bartlett_8")])
def test_too_few_taps_for_the_range_are_refused_with_the_rule(name: str, taps: str) -> None:
    kinds = LEAVES["gyro.filter"].fact
    with pytest.raises(ValueRefusedError, match=r"gyro\.range.*\+-150 deg/s with 4 taps or more, \+-75 deg/s with 16"):
        check_rules(MODEL, record_of(name, gyro__filter=kinds.value(taps)), "sensor")  # type: ignore[union-attr]


def test_the_three_accelerometer_ranges_fill_the_same_word() -> None:
    ranges = [devices.parameters(f"ADXRS450_ADXL355{end}") for end in ("", "_4g", "_8g")]
    for values in ranges:
        ratio = values["accelerometer.range"] / values["accelerometer.resolution"]
        assert ratio == pytest.approx(values["accelerometer.code_limit"], rel=1e-12)


def test_an_unknown_device_is_refused_with_the_known_ones() -> None:
    with pytest.raises(AttitudeFmuError, match=r"there is no device called ADXR450; there are ADXRS450_ADXL355, "):
        devices.parameters("ADXR450")


# pieces


@pytest.mark.parametrize("name", DEVICES)
def test_piece_zero_has_no_errors(name: str) -> None:
    assert not any(devices.specimen(name, 0).values())


@pytest.mark.parametrize("number", [-1, 2**31])
def test_a_piece_beyond_the_numbers_is_refused(number: int) -> None:
    with pytest.raises(AttitudeFmuError, match=rf"no specimen {number} of ADIS16354_75 \(allowed: 0 to 2147483647\)"):
        devices.specimen("ADIS16354_75", number)


PINNED = {
    ("ADXRS450_ADXL355", 1, "gyro.bias[1]"): 0.008982201962357566,
    ("ADXRS450_ADXL355", 1, "gyro.clock_error[3]"): -0.15191954585027456,
    ("ADXRS450_ADXL355", 1, "accelerometer.scale_error[2]"): 0.0012092007058527123,
    ("ADIS16354_150", 3, "gyro.bias[1]"): 0.004014637280113141,
    ("ADIS16354_150", 3, "accelerometer.misalignment[3]"): -0.005144561214350567,
    ("ADIS16354_75", 2**31 - 1, "gyro.g_sensitivity[2,3]"): 7.166915174619599e-05,
}


@pytest.mark.parametrize(("name", "number", "parameter"), PINNED)
def test_a_piece_is_the_same_on_every_machine(name: str, number: int, parameter: str) -> None:
    pinned = PINNED[name, number, parameter]
    assert devices.specimen(name, number)[parameter] == pytest.approx(pinned, rel=1e-15, abs=0.0)


def test_a_piece_does_not_change_when_a_parameter_is_added(monkeypatch: pytest.MonkeyPatch) -> None:
    before = devices.specimen("ADXRS450_ADXL355", 7)
    fewer = dict(adxrs450_sheet.ADXRS450.tolerances)
    gone = fewer.pop("bias")
    part = adxrs450_sheet.ADXRS450._replace(
        numbers={**adxrs450_sheet.ADXRS450.numbers, "bias": Datum(0.0, gone.unit, "test")}, tolerances=fewer
    )
    device = devices.DEVICES["ADXRS450_ADXL355"]._replace(gyro=part)
    monkeypatch.setitem(devices.DEVICES, "ADXRS450_ADXL355", device)
    after = devices.specimen("ADXRS450_ADXL355", 7)
    assert after == {name: value for name, value in before.items() if not name.startswith("gyro.bias[")}


def test_all_sensors_of_an_adis16354_have_one_clock_and_three_adxrs450_have_three() -> None:
    one, three = devices.specimen("ADIS16354_300", 5), devices.specimen("ADXRS450_ADXL355", 5)
    clocks = [f"gyro.clock_error[{axis}]" for axis in (1, 2, 3)] + ["accelerometer.clock_error"]
    assert len({one[clock] for clock in clocks}) == 1
    assert len({three[clock] for clock in clocks}) == 4


def expected_moments(tolerance: Tolerance) -> tuple[float, float, float]:
    """Mean, standard deviation and largest deviation of a tolerance, in SI."""
    size, mean = in_si(tolerance.size, tolerance.unit), in_si(tolerance.mean, tolerance.unit)
    if tolerance.reading == "limits":
        return mean, size / math.sqrt(3.0), size
    limit = size if tolerance.reading == "three sigma" else in_si(tolerance.limit, tolerance.unit)
    sigma = size / 3.0 if tolerance.reading == "three sigma" else size
    if math.isinf(limit):
        return mean, sigma, limit
    a = limit / sigma
    density = math.exp(-0.5 * a * a) / math.sqrt(2.0 * math.pi)
    return mean, sigma * math.sqrt(1.0 - 2.0 * a * density / math.erf(a / math.sqrt(2.0))), limit


@pytest.mark.parametrize("name", ["ADXRS450_ADXL355", "ADXRS453_ADXL355", "ADIS16354_150"])
def test_many_pieces_follow_the_tolerances(name: str) -> None:
    pieces = [devices.specimen(name, number) for number in range(1, PIECES + 1)]
    origins = devices.origins(name)
    for parameter in pieces[0]:
        values = np.array([piece[parameter] for piece in pieces])
        if parameter.endswith(("cross_axis[1,1]", "cross_axis[2,2]", "cross_axis[3,3]")):
            assert not values.any()
            continue
        tolerance = origins[parameter]
        if isinstance(tolerance, Datum):
            assert tolerance.limits is not None
            low, high = (in_si(limit, tolerance.unit) for limit in tolerance.limits)
            assert low <= values.min() < values.max() <= high, parameter
            # as many below the typical number as above: binomial, 4.5 standard deviations
            assert abs(np.sum(values < tolerance.si) - 0.5 * PIECES) < 4.5 * math.sqrt(0.25 * PIECES), parameter
            # the widest scatter by 44 % of their mean, which 400 pieces know to 2.2 %: 4.5 times that
            assert np.mean(values) == pytest.approx(0.25 * (low + 2.0 * tolerance.si + high), rel=0.1), parameter
            continue
        assert isinstance(tolerance, Tolerance)
        mean, sigma, largest = expected_moments(tolerance)
        # 4.5 standard errors: one in 150 000, for some hundred parameters
        assert abs(values.mean() - mean) < 4.5 * sigma / math.sqrt(PIECES), parameter
        assert values.std() == pytest.approx(sigma, rel=4.5 / math.sqrt(2.0 * PIECES)), parameter
        assert np.abs(values - mean).max() <= largest, parameter


def test_numbers_printed_with_limits_differ_from_piece_to_piece() -> None:
    for name, drawn in (
        (
            "ADXRS450_ADXL355",
            {"accelerometer.overload", *(f"accelerometer.self_test_response[{i}]" for i in (1, 2, 3))},
        ),
        ("ADIS16354_300", {f"gyro.self_test_response[{i}]" for i in (1, 2, 3)}),
    ):
        nominal = devices.parameters(name)
        for parameter in drawn:
            assert nominal[parameter] == devices.origins(name)[parameter].si  # type: ignore[union-attr]
            assert len({devices.parameters(name, number)[parameter] for number in range(5)}) == 5
    lsb = math.degrees(devices.parameters("ADIS16354_300")["gyro.resolution"])
    limits = adis16354_sheet.GYROS_300.datum("self_test_response").limits
    assert limits == pytest.approx((432 * lsb, 1105 * lsb), abs=0.005)


def test_axes_of_a_piece_are_independent() -> None:
    pieces = [devices.specimen("ADXRS450_ADXL355", number) for number in range(1, PIECES + 1)]
    biases = np.array([[piece[f"gyro.bias[{axis}]"] for axis in (1, 2, 3)] for piece in pieces])
    correlation = np.corrcoef(biases.T) - np.eye(3)
    assert np.abs(correlation).max() < 4.5 / math.sqrt(PIECES)
