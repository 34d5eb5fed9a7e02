"""What the sensor FMU does, against its parameters and the datasheets: short seeded records, bounds from statistics."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from attitude_fmu.cosim import allan
from attitude_fmu.cosim.bench import Benches, benches
from attitude_fmu.cosim.characteristics import (
    PARTS,
    Part,
    Sensor,
    at_rest,
    calibration,
    clockwork,
    deviation_at,
    filter_settings,
    frequency_response,
    perfect,
    quiet,
    register_codes,
    step_response,
    temperature_drift,
    thermometer_codes,
    wander_alone,
    white_density,
    white_noise_alone,
    word_rate,
)
from attitude_fmu.cosim.errors import RunStoppedError, SystemRefusedError
from attitude_fmu.cosim.filter_claims import filter_claim
from attitude_fmu.cosim.interface import read_interface
from attitude_fmu.cosim.sensor import values_of
from attitude_fmu.models.attitude.rotations import STANDARD_GRAVITY
from attitude_fmu.models.sensors.bias_instability import SIGMA_PER_INSTABILITY, TIME_CONSTANTS

DEVICES = ("ADXRS450_ADXL355", "ADIS16354_300")
DEGREE = math.pi / 180.0


@pytest.fixture(scope="module")
def made(sensor_dist: Path) -> Iterator[Benches]:
    fmu = sensor_dist / "AttitudeSensor.fmu"
    with benches(fmu, read_interface(fmu)) as made:
        yield made


@pytest.fixture(scope="module", params=DEVICES)
def sensor(made: Benches, request: pytest.FixtureRequest) -> Sensor:
    return Sensor(made, values_of(request.param, 1))


@pytest.fixture(scope="module")
def adxrs450(made: Benches) -> Sensor:
    return Sensor(made, values_of("ADXRS450_ADXL355", 1))


# --- noise: the figures ---------------------------------------------------------------------------------------


def test_white_noise_has_its_density_within_three_per_cent(sensor: Sensor) -> None:
    # 200 s, three axes, 0.01 Hz to 6 Hz: 3600 lines, the density known to 1/sqrt(4 * 3600) = 0.83 %
    records = white_noise_alone(sensor, 200.0)
    for part in PARTS:
        density = sensor.number(f"{part}.noise_density")
        found = white_density(records[part], 0.01, 6.0)
        assert found.value == pytest.approx(density, rel=0.03), part
        assert 0.97 * density < found.high
        assert found.low < 1.03 * density
        assert (found.high - found.low) / found.value == pytest.approx(2.0 * 1.96 / math.sqrt(4.0 * 3597.0), rel=0.01)
        at_one_second = deviation_at(records[part], 1.0)
        assert at_one_second.low < allan.white_noise(1.0, density) < at_one_second.high


def test_the_instability_has_its_floor_within_ten_per_cent(sensor: Sensor) -> None:
    # 1800 s in clusters of 3 s, three axes: 2200 degrees of freedom, the deviation known to 1.5 %
    records = wander_alone(sensor, "bias_instability", 1800.0)
    for part in PARTS:
        instability = sensor.number(f"{part}.bias_instability")
        found = deviation_at(records[part], 3.0)
        assert found.value == pytest.approx(allan.FLICKER_FLOOR * instability, rel=0.10), part
        theory = allan.modelled_instability(3.0, instability, TIME_CONSTANTS, SIGMA_PER_INSTABILITY)
        # 95 % and again half as much: 99.7 %
        assert found.value == pytest.approx(float(theory), abs=0.75 * (found.high - found.low))


def test_the_rate_random_walk_is_within_ten_per_cent(sensor: Sensor) -> None:
    walking = sensor.but({"gyro.rate_random_walk": 1e-5, "accelerometer.rate_random_walk": 1e-4})
    # 600 s in clusters of 1 s, three axes: 1800 degrees of freedom, the deviation known to 1.7 %
    records = wander_alone(walking, "rate_random_walk", 600.0)
    for part in PARTS:
        walk = walking.number(f"{part}.rate_random_walk")
        found = deviation_at(records[part], 1.0)
        assert math.sqrt(3.0) * found.value == pytest.approx(walk, rel=0.10), part
        assert found.value == pytest.approx(
            float(allan.rate_random_walk(1.0, walk)), abs=0.75 * (found.high - found.low)
        )


def test_all_terms_together_follow_the_sum_of_their_theories(adxrs450: Sensor) -> None:
    taus = np.array([0.1, 0.5, 2.0])
    for part, rest in at_rest(adxrs450, 120.0).items():
        found = rest.pooled_allan(taus.tolist())
        theory = allan.combined(
            allan.white_noise(taus, adxrs450.number(f"{part}.noise_density")),
            allan.modelled_instability(
                taus, adxrs450.number(f"{part}.bias_instability"), TIME_CONSTANTS, SIGMA_PER_INSTABILITY
            ),
        )
        # the record's own 95 % interval, widened to four standard errors; at 0.1 s the filter's 4 ms take 4 % off
        error = 4.0 * (found.high - found.low) / (2.0 * 1.96)
        assert np.all(found.deviation < theory + error)
        assert np.all(found.deviation > theory * (1.0 - 0.004 / taus) - error)


def test_equal_seeds_give_equal_records_and_others_do_not(adxrs450: Sensor) -> None:
    first, again, other = (at_rest(adxrs450.but({"seed": seed}), 1.0)["gyro"].readings for seed in (7, 7, 8))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def clock_error(sensor: Sensor, part: Part, axis: int) -> float:
    return sensor.number(f"gyro.clock_error[{axis + 1}]" if part == "gyro" else "accelerometer.clock_error")


# --- filters ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("part", PARTS)
def test_every_setting_of_the_filter_has_the_sheets_cutoff_and_delay(sensor: Sensor, part: Part) -> None:
    missed = []
    for setting in filter_settings(sensor, part):
        chosen = sensor.but(setting.values)
        for axis, response in enumerate(frequency_response(chosen, part, filter_claim(chosen, part).frequency)):
            claim = filter_claim(chosen, part, 1.0 + clock_error(sensor, part, axis))
            frequency, delay = response.frequency_of(claim.decibels), response.delay
            if abs(frequency / claim.frequency - 1.0) > 0.01 or abs(delay / claim.delay - 1.0) > 0.02:
                missed.append((setting.label, axis, frequency, claim.frequency, delay, claim.delay))
    assert not missed


def test_each_axis_is_measured_at_its_own_clock(adxrs450: Sensor) -> None:
    errors = (-0.15, 0.0, 0.15)
    spread = adxrs450.but({f"gyro.clock_error[{i}]": error for i, error in enumerate(errors, 1)})
    nominal = frequency_response(adxrs450.but(quiet(adxrs450)), "gyro", 79.7)[0]
    for error, response in zip(errors, frequency_response(spread, "gyro", 79.7), strict=True):
        # all times of the part stretch together; what stays is its pole at 10.6 kHz, 15 us of 4 ms
        assert response.cutoff == pytest.approx(nominal.cutoff * (1.0 + error), rel=1e-3)
        assert response.delay == pytest.approx(nominal.delay / (1.0 + error), rel=1e-3)


@pytest.mark.parametrize("divider", [1, 4, 31])
def test_conversions_left_out_fold_their_noise_into_the_words(made: Benches, divider: int) -> None:
    sensor = Sensor(made, values_of("ADIS16354_300")).but({"gyro.divider": divider, "accelerometer.divider": divider})
    records = white_noise_alone(sensor, 400.0)
    for part in PARTS:
        claim = filter_claim(sensor, part)
        high = 0.1 * claim.frequency
        found = white_density(records[part], 0.01, high)
        # each line of each axis has two degrees of freedom; four standard errors, and 0.5 % that the window takes off
        lines = 3.0 * 400.0 * (high - 0.01)
        expected = sensor.number(f"{part}.noise_density") * math.sqrt(divider)
        assert found.value == pytest.approx(expected, rel=0.005 + 4.0 / math.sqrt(4.0 * lines)), part


def test_a_reference_that_is_no_frequency_is_refused(adxrs450: Sensor) -> None:
    with pytest.raises(SystemRefusedError, match=r"reference = 0.0 Hz: wanted is a positive frequency"):
        frequency_response(adxrs450, "gyro", 0.0)


def test_the_response_is_that_of_the_window(made: Benches) -> None:
    sensor = Sensor(made, values_of("ADIS16354_75"))
    response = frequency_response(sensor, "gyro", 16.3)[0]
    turn = np.pi * response.frequency / 819.2
    window = (np.sin(16.0 * turn) / (16.0 * np.sin(turn))) ** 2
    below = response.frequency < 30.0
    # the pole at 350 Hz takes (30/350)^2/2 = 0.37 % at 30 Hz, where the window leaves a seventh
    assert np.abs(response.gain[below]) == pytest.approx(window[below], rel=3.7e-3, abs=1e-5)
    # and of its 0.455 ms of delay (30/350)^2/3 = 0.24 %, 0.006 % of the whole
    assert response.delays[below] == pytest.approx(response.delay, rel=1e-4)


@pytest.mark.parametrize("part", PARTS)
def test_a_step_is_half_way_after_the_delay(sensor: Sensor, part: Part) -> None:
    claim = filter_claim(sensor, part, 1.0 + clock_error(sensor, part, 0))
    step = step_response(sensor, part)
    assert step.share[0] < 0.1
    assert step.share[-1] == pytest.approx(1.0, abs=1e-6)
    # a sample's period either way: the step is known to no better
    assert step.half == pytest.approx(claim.delay, abs=clockwork(sensor, part).sample)


def test_words_come_at_the_pieces_own_rate(sensor: Sensor) -> None:
    for part in PARTS:
        nominal = 1.0 / clockwork(perfect(sensor), part).word
        expected = [nominal * (1.0 + clock_error(sensor, part, axis)) for axis in range(3)]
        # the first and the last of 850 words or more are each known to an eighth of a word (of the first axis, which
        # may be a third shorter than another's)
        assert word_rate(sensor, part) == pytest.approx(expected, rel=2.0 / 8.0 / 850.0 * 1.35)


# --- calibration, temperature, registers ------------------------------------------------------------------------------


def test_calibration_finds_the_parameters(adxrs450: Sensor) -> None:
    still = adxrs450.but({"gyro.thermal.self_heating": 0.0, "accelerometer.thermal.self_heating": 0.0})
    for part in PARTS:
        found = calibration(still, part)
        # what is left are the fine register's steps, 2^-30 of the range, over inputs of half of it or of 1 g: 1e-8
        assert found.offset == pytest.approx([still.number(f"{part}.bias[{i}]") for i in (1, 2, 3)], rel=1e-6)
        across = found.matrix[0, 1]
        assert across == pytest.approx(still.number(f"{part}.cross_axis[1,2]"), abs=1e-7)
        assert found.matrix[0, 0] - 1.0 == pytest.approx(still.number(f"{part}.scale_error[1]"), abs=1e-7)
        # 201 points, both ends among them, stand for the continuous rms: it is 3/201 too large
        assert found.nonlinearity_rms == pytest.approx(still.number(f"{part}.nonlinearity"), rel=0.02)
    gyro = calibration(still, "gyro")
    assert gyro.g_sensitivity[2, 1] == pytest.approx(still.number("gyro.g_sensitivity[3,2]"), rel=1e-5)
    # the steps again, over 1 g^2: 5e-9 rad/s of 5e-5 rad/s
    assert gyro.rectification[0] == pytest.approx(still.number("gyro.rectification[1]"), rel=1e-4)


def test_drift_has_the_slope_of_its_parameters(adxrs450: Sensor) -> None:
    for part in PARTS:
        drift = temperature_drift(adxrs450, part)
        slope = [adxrs450.number(f"{part}.bias_temperature_slope[{i}]") for i in (1, 2, 3)]
        scale = [adxrs450.number(f"{part}.scale_temperature_slope[{i}]") for i in (1, 2, 3)]
        assert drift.slope(drift.offset) == pytest.approx(slope, rel=1e-5)
        # relative to the scale at an ambient 25 degC, where self-heating has changed it already: slope x 5 K, 0.1 %
        assert drift.slope(drift.scale) == pytest.approx(scale, rel=2e-3)


def test_drift_shows_the_hysteresis(adxrs450: Sensor) -> None:
    worn = adxrs450.but({"gyro.hysteresis": 1e-3, "gyro.hysteresis_width": 5.0})
    drift = temperature_drift(worn, "gyro")
    middle = len(drift.hysteresis) // 2
    # 65 K from either end, of a width of 5 K: exp(-65/5) = 2e-6 of it is left of the turning
    assert drift.hysteresis[middle] == pytest.approx(np.full(3, 2e-3), rel=1e-4)


@pytest.mark.parametrize(
    ("device", "part", "given", "codes"),
    [
        ("ADXRS450_ADXL355", "gyro", [300.0, -300.0, 1.0, 0.0125, 400.0], [24000, -24000, 80, 1, 24000]),
        ("ADXRS450_ADXL355", "accelerometer", [1.0, -1.0, 2.0, 3.0], [256000, -256000, 512000, 524287]),
        ("ADXRS450_ADXL355_8g", "accelerometer", [1.0, -8.0], [64000, -512000]),
        ("ADIS16354_300", "gyro", [0.07326, 146.52, -300.0], [1, 2000, -4095]),
        ("ADIS16354_75", "gyro", [0.018315, 73.26], [1, 4000]),
        ("ADIS16354_150", "accelerometer", [0.4672e-3, 0.4672, -1.7], [1, 1000, -3639]),
    ],
)
def test_known_inputs_have_the_sheets_codes(
    made: Benches, device: str, part: Part, given: list[float], codes: list[int]
) -> None:
    unit = DEGREE if part == "gyro" else STANDARD_GRAVITY
    found = register_codes(Sensor(made, values_of(device)), part, unit * np.array(given))
    assert found.codes.tolist() == [[code] * 3 for code in codes]


@pytest.mark.parametrize(
    ("device", "part", "given", "codes"),
    [
        ("ADXRS450_ADXL355", "gyro", [85.0, 45.0, 0.0], [200, 0, -225]),
        ("ADXRS450_ADXL355", "accelerometer", [25.0], [1885]),
        ("ADIS16354_300", "gyro", [25.0, 35.0], [0, 69]),
    ],
)
def test_known_temperatures_have_the_sheets_codes(
    made: Benches, device: str, part: Part, given: list[float], codes: list[int]
) -> None:
    found = thermometer_codes(Sensor(made, values_of(device)), part, np.array(given))
    assert found.codes.tolist() == codes


# --- the bench -------------------------------------------------------------------------------------------------------


def test_an_unknown_parameter_is_refused_with_what_was_meant(adxrs450: Sensor) -> None:
    with pytest.raises(SystemRefusedError, match=r"no variable 'gyro.noise_densty'; did you mean gyro.noise_density"):
        adxrs450.but({"gyro.noise_densty": 1.0}).bench()


def test_an_output_is_no_parameter(adxrs450: Sensor) -> None:
    with pytest.raises(SystemRefusedError, match="euler.yaw is no parameter"):
        adxrs450.but({"euler.yaw": 1.0}).bench()


def test_what_the_fmu_refuses_is_told_in_its_words(adxrs450: Sensor) -> None:
    with pytest.raises(RunStoppedError, match=r"gyro.range"):
        adxrs450.but({"gyro.range": 1e4 * DEGREE}).bench()


def test_a_bench_goes_on_where_it_was(adxrs450: Sensor) -> None:
    with adxrs450.bench() as bench:
        parts = [bench.record(2e-3, 50), bench.record(2e-3, 50)]
        with pytest.raises(ValueError, match="this bench records every 0.002 s"):
            bench.record(1e-3, 1)
    with adxrs450.bench() as bench:
        whole = bench.record(2e-3, 100)
    assert np.array_equal(np.concatenate([part.gyro for part in parts]), whole.gyro)
    assert np.array_equal(np.concatenate([part.time for part in parts]), whole.time)


@pytest.mark.slow
def test_an_hour_at_rest_follows_the_theory_at_every_cluster_time(adxrs450: Sensor) -> None:
    for part, rest in at_rest(adxrs450, 3600.0).items():
        found = rest.pooled_allan([0.1, 1.0, 10.0, 100.0])
        theory = allan.combined(
            allan.white_noise(found.tau, adxrs450.number(f"{part}.noise_density")),
            allan.modelled_instability(
                found.tau, adxrs450.number(f"{part}.bias_instability"), TIME_CONSTANTS, SIGMA_PER_INSTABILITY
            ),
        )
        # 100 s: 100 degrees of freedom, 7 %; three of these
        assert found.deviation == pytest.approx(theory, rel=0.21), part
        assert found.deviation[:2] == pytest.approx(theory[:2], rel=0.05), part
