"""Every error of the parts alone, against its equation: what a part without any other error reads."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from faultless_parts import ADIS, GYRO, STILL, faultless, only_slow, run_of

from attitude_fmu.models.attitude.rotations import STANDARD_GRAVITY, earth_rate_n
from attitude_fmu.models.attitude_sensor import MODEL, Parameters
from attitude_fmu.models.record import defaults, with_defaults
from attitude_fmu.models.sensors import accelerometer, devices, gyro, sensitivity
from attitude_fmu.models.sensors.accelerometer import OUTPUT_DATA_RATE
from attitude_fmu.models.sensors.gyro import GYRO_FILTER
from attitude_fmu.models.system import Run
from attitude_fmu.models.vectors import IDENTITY3, ZERO3

PARTS = ("gyro", "accelerometer")
BOTH = pytest.mark.parametrize("device", [GYRO, ADIS])
WARM = STILL._replace(temperature=STILL.temperature + 30.0)


def read(parameters: Parameters, inputs: Any = STILL, until: float = 0.03) -> dict[str, np.ndarray]:
    """What the registers of both parts show, rad/s and m/s^2."""
    shown = run_of(parameters, inputs, until).outputs().register
    return {
        "gyro": np.array(shown.rate) * parameters.gyro.resolution,
        "accelerometer": np.array(shown.acceleration) * parameters.accelerometer.resolution,
    }


def with_both(device: str, fine: bool = True, **values: Any) -> Parameters:
    """The same error for gyros and accelerometers."""
    return faultless(device, fine, **{f"{part}__{name}": value for part in PARTS for name, value in values.items()})


# --- random errors ---------------------------------------------------------------------------------------------------


def normal_draws(seed: int, count: int, width: int) -> list[tuple[float, ...]]:
    return [tuple(row) for row in np.random.default_rng(seed).normal(size=(count, width)).tolist()]


def words_of_noise(part: str, count: int, **values: Any) -> np.ndarray:
    """Register words of a still part with white noise alone, in SI."""
    device = ADIS if "bartlett" in values else GYRO
    taps = values.pop("bartlett", 0)
    found = []
    if part == "gyro":
        p = faultless(device, True, gyro__noise_density=1e-4, **values).gyro
        k = gyro.gyro_coefficients(p, IDENTITY3, False)
        state, lines = gyro.initial_gyro(0, ZERO3, ZERO3, 0.0, 1.0, p, k)
        register, sample = gyro.register(0), gyro.sample(0, taps or 1)
        for draws in normal_draws(1, count, 4):
            if taps:
                state, lines = sample(state, lines, 0.0, p, k, (), draws)
            else:
                state = register(state, 0.0, p, k, (), draws)
            found.append(state.code * p.resolution)
    else:
        a = faultless(device, True, accelerometer__noise_density=1e-2, **values).accelerometer
        c = accelerometer.accelerometer_coefficients(a, IDENTITY3, False)
        part_state, three = accelerometer.initial_accelerometer(ZERO3, ZERO3, (1.0, 1.0, 1.0), a, c)
        step = accelerometer.sample(taps or 1)
        for draws in normal_draws(2, count, 10):
            if taps:
                part_state, three = step(part_state, three, ZERO3, a, c, (), draws)
                found.append(part_state.latest.code[1] * a.resolution)
            else:
                part_state = accelerometer.register(part_state, ZERO3, a, c, (), draws)
                found.append(part_state.latest.code[1] * a.resolution)
    return np.array(found)


def standard_error_of_rms(window: np.ndarray, count: int) -> float:
    """Relative standard error of the rms of so many samples of white noise behind a window (Bartlett's formula)."""
    correlation = np.correlate(window, window, "full") / (window @ window)
    return math.sqrt((correlation**2).sum() / (2 * count))


def test_block_noise_of_the_cic_has_its_noise_bandwidth() -> None:
    # sinc^2 of 64 at 16 kHz passes 83.3 Hz; words 32 samples apart are what the window's autocorrelation says
    found = words_of_noise("gyro", 20_000)
    window = np.convolve(np.ones(64), np.ones(64)) / 64**2
    bandwidth = 8000.0 * (window @ window)
    assert bandwidth == pytest.approx(83.3, rel=1e-3)
    bound = 4 * standard_error_of_rms(window[::32], len(found))
    assert found[8:].std() == pytest.approx(1e-4 * math.sqrt(bandwidth), rel=bound)
    together = np.correlate(window, window, "full")
    middle = len(window) - 1
    for lag in (1, 2, 3):
        expected = together[middle + 32 * lag] / together[middle]
        assert np.corrcoef(found[8:-lag], found[8 + lag :])[0, 1] == pytest.approx(expected, abs=4 / math.sqrt(20_000))


@pytest.mark.parametrize("rate", ["2000_Hz", "500_Hz", "31_25_Hz"])
def test_block_noise_of_the_decimator_has_its_noise_bandwidth(rate: str) -> None:
    code = OUTPUT_DATA_RATE.value(rate)
    found = words_of_noise("accelerometer", 10_000, accelerometer__output_data_rate=code)
    ratio = 2 ** (code - 1)
    window = np.convolve(np.ones(ratio), np.ones(ratio)) / ratio**2
    bound = 4 * standard_error_of_rms(window[::ratio], len(found))
    assert found[2:].std() == pytest.approx(1e-2 * math.sqrt(2000.0 * (window @ window)), rel=bound)


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("taps", [1, 4, 16])
def test_sampled_noise_behind_a_bartlett_window(part: str, taps: int) -> None:
    way = GYRO_FILTER.value(f"bartlett_{taps}")
    found = words_of_noise(part, 20_000, bartlett=taps, **{f"{part}__filter": way})
    window = np.convolve(np.ones(taps), np.ones(taps)) / taps**2
    density = {"gyro": 1e-4, "accelerometer": 1e-2}[part]
    expected = density * math.sqrt(409.6) * math.sqrt(window @ window)
    assert found[2 * taps :].std() == pytest.approx(expected, rel=4 * standard_error_of_rms(window, len(found)))


def test_the_sheets_noise_of_the_parts_comes_out() -> None:
    # calculated from the sheets: 0.137 deg/s (CIC), 1.01 and 0.62 deg/s (ADIS16354 with 1 and 2 taps)
    cic = faultless(GYRO, gyro__noise_density=math.radians(0.015)).gyro
    k = gyro.gyro_coefficients(cic, IDENTITY3, False)
    assert math.degrees(k.sample_deviation[0]) * math.sqrt(83.3 / 8000.0) == pytest.approx(0.137, rel=0.005)
    p = faultless(ADIS, gyro__noise_density=math.radians(0.05), gyro__divider=7).gyro
    k = gyro.gyro_coefficients(p, IDENTITY3, False)  # a divider does not quieten what is converted
    assert math.degrees(k.sample_deviation[0]) == pytest.approx(1.01, rel=0.005)


@pytest.mark.parametrize("part", PARTS)
def test_the_rate_random_walk_grows_with_the_root_of_time(part: str) -> None:
    # 60 runs of 3 axes: the rms has a relative standard error of 1/sqrt(2 180) = 5.3 %, so 20 % is 3.8 sigma
    walked = {1.0: [], 9.0: []}
    for seed in range(60):
        p = only_slow(**{f"{part}__rate_random_walk": 0.02})._replace(seed=seed)
        run = Run(MODEL, p, STILL)
        for time, values in walked.items():
            run.advance(STILL, time)
            values.extend(getattr(run.state.slow, f"{part}_offset"))
    for time, values in walked.items():
        assert np.sqrt(np.mean(np.square(values))) == pytest.approx(0.02 * math.sqrt(time), rel=0.2)


@pytest.mark.parametrize("part", PARTS)
def test_the_turn_on_bias_spreads_from_run_to_run_and_stays_within_one(part: str) -> None:
    # 200 runs of 3 axes: standard error of the deviation 1/sqrt(2 600) = 2.9 %, of the mean 4 % of it
    drawn = []
    for seed in range(200):
        run = Run(MODEL, only_slow(**{f"{part}__turn_on_bias": 0.3})._replace(seed=seed), STILL)
        run.advance(STILL, 0.1)
        first = getattr(run.state.slow, f"{part}_offset")
        run.advance(STILL, 0.5)
        assert getattr(run.state.slow, f"{part}_offset") == first
        drawn.extend(first)
    assert np.std(drawn) == pytest.approx(0.3, rel=4 * 0.029)
    assert abs(np.mean(drawn)) < 4 * 0.3 / math.sqrt(600)
    assert abs(np.corrcoef(np.reshape(drawn, (200, 3)).T)[np.triu_indices(3, 1)]).max() < 4 / math.sqrt(200)


@pytest.mark.parametrize("part", PARTS)
def test_the_bias_instability_starts_and_stays_at_its_level(part: str) -> None:
    # six processes of 0.8561 B each: 100 runs of 3 axes give the rms with 4.1 % standard error
    level = 1e-3 * 0.8561 * math.sqrt(6)
    for time in (0.1, 2.0):
        drawn = [
            x
            for seed in range(100)
            for x in getattr(
                run_of(only_slow(**{f"{part}__bias_instability": 1e-3})._replace(seed=seed), STILL, time).state.slow,
                f"{part}_offset",
            )
        ]
        assert np.sqrt(np.mean(np.square(drawn))) == pytest.approx(level, rel=4 * 0.041)


@pytest.mark.parametrize("part", PARTS)
def test_turn_on_bias_and_instability_are_drawn_at_a_tenth_of_a_second(part: str) -> None:
    run = Run(MODEL, only_slow(**{f"{part}__turn_on_bias": 0.3, f"{part}__bias_instability": 1e-3}), STILL)
    run.advance(STILL, 0.099)
    assert getattr(run.state.slow, f"{part}_offset") == ZERO3
    run.advance(STILL, 0.1)
    assert min(map(abs, getattr(run.state.slow, f"{part}_offset"))) > 0.0


def test_the_alignment_misses_the_twentieth_of_the_turn_on_bias_that_came_before_it() -> None:
    p = faultless(fine=True, gyro__turn_on_bias=1e-3)
    level = STILL._replace(rate=earth_rate_n(p.latitude), specific_force=(0.0, 0.0, STANDARD_GRAVITY))
    run = run_of(p, level, 2.0)
    assert run.state.attitude.aligned == 1.0
    turn_on = run.state.slow.gyro_wander.turn_on
    # drawn ahead of the 50th of 1000 readings, and in its word
    for axis in range(3):
        assert run.state.attitude.bias[axis] / turn_on[axis] == pytest.approx(1.0 - 0.049, abs=1e-4)


# --- temperature -----------------------------------------------------------------------------------------------------


@BOTH
def test_bias_follows_temperature_linearly_and_by_its_square(device: str) -> None:
    bias, slope, curve = (0.01, -0.02, 0.03), (1e-4, 2e-4, -3e-4), (1e-6, -2e-6, 4e-6)
    p = with_both(device, bias=bias, bias_temperature_slope=slope, bias_temperature_curve=curve)
    for part, shown in read(p, WARM).items():
        expected = [b + 30.0 * s + 900.0 * c for b, s, c in zip(bias, slope, curve, strict=True)]
        assert shown == pytest.approx(expected, abs=2e-8), part


@BOTH
def test_scale_follows_temperature_linearly_and_by_its_square(device: str) -> None:
    slope, curve = (1e-4, 2e-4, -3e-4), (1e-6, -2e-6, 4e-6)
    p = with_both(device, scale_temperature_slope=slope, scale_temperature_curve=curve)
    true = {"gyro": (0.5, -0.6, 0.7), "accelerometer": (3.0, 4.0, -5.0)}
    moving = WARM._replace(rate=true["gyro"], specific_force=true["accelerometer"])
    for part, shown in read(p, moving).items():
        expected = [x * (1 + 30.0 * s + 900.0 * c) for x, s, c in zip(true[part], slope, curve, strict=True)]
        assert shown == pytest.approx(expected, abs=2e-8), part


@pytest.mark.parametrize("part", PARTS)
def test_hysteresis_is_a_loop_of_its_height_and_width(part: str) -> None:
    # +A after warming by more than the width, the way back to -A takes twice the width
    values = {f"{part}__hysteresis": 0.2, f"{part}__hysteresis_width": 4.0, f"{part}__thermal__warm_up": 1e-3}
    run = Run(MODEL, only_slow(**values), STILL)
    seen, time = {}, 0.0
    course = [*np.arange(0.0, 20.1, 1.0), *np.arange(19.0, -20.1, -1.0), *np.arange(-19.0, 20.1, 1.0)]
    for way, warmer in enumerate(course):
        time += 0.1
        run.advance(STILL._replace(temperature=STILL.temperature + warmer), time)
        seen[way] = getattr(run.state.slow, f"{part}_offset")[0]
    up, down, again = list(seen.values())[:21], list(seen.values())[21:61], list(seen.values())[61:]
    assert up[:5] == pytest.approx([0.0, 0.05, 0.10, 0.15, 0.20])
    assert up[5:] == pytest.approx([0.2] * 16)
    assert down[:8] == pytest.approx([0.2 - 0.05 * i for i in range(1, 9)])
    assert down[8:] == pytest.approx([-0.2] * 32)
    assert again[:8] == pytest.approx([-0.2 + 0.05 * i for i in range(1, 9)])
    assert again[8:] == pytest.approx([0.2] * 32)


@pytest.mark.parametrize("part", PARTS)
def test_a_part_just_switched_on_warms_up(part: str) -> None:
    thermal = {"thermal__self_heating": 8.0, "thermal__warm_up": 5.0, "thermal__warmed_up": False}
    values = {f"{part}__{name}": value for name, value in thermal.items()}
    run = Run(MODEL, only_slow(**values, **{f"{part}__bias_temperature_slope": (0.01, 0.0, 0.0)}), STILL)
    for time in (0.1, 5.0, 20.0):
        run.advance(STILL, time)
        warmer = 8.0 * (1.0 - math.exp(-time / 5.0))
        assert getattr(run.outputs().die_temperature, part) == pytest.approx(298.15 + warmer)
        assert getattr(run.state.slow, f"{part}_offset")[0] == pytest.approx(0.01 * warmer)


# --- sensitivity and axes --------------------------------------------------------------------------------------------


@BOTH
def test_scale_error_and_cross_axis_multiply_the_truth(device: str) -> None:
    scale_error, cross = (0.01, -0.02, 0.03), ((0.0, 0.004, -0.003), (0.002, 0.0, 0.001), (-0.005, 0.006, 0.0))
    p = with_both(device, scale_error=scale_error, cross_axis=cross)
    rate, force = np.array([0.5, -0.6, 0.7]), np.array([3.0, 4.0, -5.0])
    shown = read(p, STILL._replace(rate=tuple(rate.tolist()), specific_force=tuple(force.tolist())))
    matrix = np.eye(3) + np.diag(scale_error) + np.array(cross)
    assert shown["gyro"] == pytest.approx(matrix @ rate, abs=2e-8)
    assert shown["accelerometer"] == pytest.approx(matrix @ force, abs=2e-8)


def test_a_misalignment_turns_and_does_not_stretch() -> None:
    for rotation in ((0.3, 0.0, 0.0), (0.1, -0.2, 0.15), (1e-9, 0.0, 0.0), ZERO3):
        s = np.array(sensitivity.sensitivity_matrix(ZERO3, (ZERO3,) * 3, ZERO3, rotation, IDENTITY3))
        assert s @ s.T == pytest.approx(np.eye(3), abs=1e-15)
        assert np.linalg.det(s) == pytest.approx(1.0)
        # the triad turned by +r sees a fixed vector turned by -r
        angle, axis = np.linalg.norm(rotation), np.array(rotation)
        assert s @ axis == pytest.approx(axis, abs=1e-15)
        assert np.trace(s) == pytest.approx(1.0 + 2.0 * math.cos(angle))
    turned = np.array(sensitivity.sensitivity_matrix(ZERO3, (ZERO3,) * 3, ZERO3, (0.0, 0.0, 0.1), IDENTITY3))
    assert turned @ [1.0, 0.0, 0.0] == pytest.approx([math.cos(0.1), -math.sin(0.1), 0.0])


def test_a_skewed_triad_has_unit_axes_that_lean_by_these_angles() -> None:
    lean = (0.02, -0.1, 0.15)
    x, y, z = np.array(sensitivity.sensitivity_matrix(ZERO3, (ZERO3,) * 3, lean, ZERO3, IDENTITY3))
    for axis in (x, y, z):
        assert np.linalg.norm(axis) == pytest.approx(1.0)
    for (a, b), angle in zip(((y, x), (z, x), (z, y)), lean, strict=True):
        assert math.acos(a @ b) == pytest.approx(0.5 * math.pi - angle)


@pytest.mark.parametrize("nonlinearity", [0.0005, 0.01])
def test_nonlinearity_is_the_rms_about_the_best_straight_line_over_the_range(nonlinearity: float) -> None:
    full_scale = 5.2
    gains = sensitivity.cubic_gains(nonlinearity, full_scale)
    x = np.linspace(-full_scale, full_scale, 20_001)
    y = np.array([sensitivity.bent(one, gains) for one in x.tolist()])
    rest = y - np.polyval(np.polyfit(x, y, 1), x)
    assert np.sqrt(np.mean(rest**2)) == pytest.approx(nonlinearity * full_scale, rel=1e-3)
    assert np.polyfit(x, y, 1)[0] == pytest.approx(1.0, abs=1e-5)  # the scale is the best line's


@BOTH
def test_the_registers_show_the_nonlinearity(device: str) -> None:
    p = with_both(device, nonlinearity=0.01)
    c = 0.01 / math.sqrt(4 / 175)  # rms of u^3 - 3/5 u
    for u in (-1.0, -0.4, 0.7):
        true = {"gyro": u * p.gyro.range, "accelerometer": u * p.accelerometer.range}
        shown = read(p, STILL._replace(rate=(true["gyro"], 0.0, 0.0), specific_force=(true["accelerometer"], 0.0, 0.0)))
        for part, value in shown.items():
            full_scale = getattr(p, part).range
            bent = full_scale * (u + c * (u**3 - 0.6 * u))
            assert value[0] == pytest.approx(max(-full_scale, min(bent, full_scale)), abs=1e-7), part


# --- other influences ------------------------------------------------------------------------------------------------


@BOTH
def test_gyros_feel_specific_force_and_its_square(device: str) -> None:
    g = ((1e-3, 2e-3, -1e-3), (0.0, 3e-3, 1e-3), (-2e-3, 0.0, 1e-3))
    squared = (1e-4, -2e-4, 3e-4)
    force = np.array([3.0, -4.0, 9.0])
    p = faultless(device, True, gyro__g_sensitivity=g, gyro__rectification=squared)
    shown = read(p, STILL._replace(specific_force=tuple(force.tolist())))["gyro"]
    assert shown == pytest.approx(np.array(g) @ force + np.array(squared) * (force @ force), abs=4e-9)


@BOTH
def test_vibration_shifts_an_accelerometer_by_its_mean_square(device: str) -> None:
    p = faultless(device, True, accelerometer__rectification=(1e-4, -2e-4, 3e-4))
    force = (3.0, -4.0, 9.0)
    shown = read(p, STILL._replace(specific_force=force))["accelerometer"]
    expected = [f + r * 106.0 for f, r in zip(force, (1e-4, -2e-4, 3e-4), strict=True)]
    assert shown == pytest.approx(expected, abs=2e-8)


@BOTH
def test_the_supply_voltage_moves_the_offset(device: str) -> None:
    p = with_both(device, supply_sensitivity=0.01)
    for shown in read(p, STILL._replace(supply_voltage=5.2)).values():
        assert shown == pytest.approx([0.002] * 3, abs=2e-8)
    run = run_of(p, STILL, 0.02)
    run.advance(STILL._replace(supply_voltage=4.8), 0.15)  # the next slow step
    assert run.outputs().register.rate[0] * p.gyro.resolution == pytest.approx(-0.002, abs=4e-9)


@BOTH
def test_registers_end_at_the_range(device: str) -> None:
    p = faultless(device)
    far = STILL._replace(rate=(9.0, -9.0, 0.0), specific_force=(50.0, -50.0, 0.0))
    shown = run_of(p, far, 0.03)
    for part, codes in (
        ("gyro", shown.outputs().register.rate),
        ("accelerometer", shown.outputs().register.acceleration),
    ):
        one = getattr(p, part)
        end = math.floor(one.range / one.resolution + 0.5)
        assert codes == (min(end, one.code_limit - 1), -min(end, one.code_limit), 0.0)
    assert all(gyro.over_range for gyro in shown.state.gyro[:2])
    assert not shown.state.gyro[2].over_range
    assert accelerometer.registers(shown.state.accelerometer, shown.coefficients.accelerometer).over_range


@BOTH
def test_codes_are_the_nearest_of_the_truth(device: str) -> None:
    # the ADIS16354 rounds twice, first in steps of 1/64 LSB
    p, most = faultless(device), 0.5 + (1 / 128 if device == ADIS else 0.0) + 1e-9
    chance = np.random.default_rng(7)
    for _ in range(20):
        rate, force = chance.uniform(-5.0, 5.0, 3), chance.uniform(-16.0, 16.0, 3)
        moving = STILL._replace(rate=tuple(rate.tolist()), specific_force=tuple(force.tolist()))
        for until in (0.0, 0.02):
            register = run_of(p, moving, until).outputs().register
            errors = [*(register.rate - rate / p.gyro.resolution)]
            errors += [*(register.acceleration - force / p.accelerometer.resolution)]
            assert max(map(abs, errors)) <= most
            assert all(code == int(code) for code in (*register.rate, *register.acceleration))


def test_an_overload_silences_the_accelerometer_for_half_a_millisecond() -> None:
    bent = defaults(Parameters).accelerometer.nonlinearity
    assert bent > 0.0
    part = faultless(
        fine=True,
        accelerometer__output_data_rate=OUTPUT_DATA_RATE.value("4000_Hz"),
        accelerometer__range=2.048 * STANDARD_GRAVITY,
        accelerometer__nonlinearity=bent,
    ).accelerometer
    k = accelerometer.accelerometer_coefficients(part, IDENTITY3, False)
    state, _ = accelerometer.initial_accelerometer((0.0, 0.0, 9.0), ZERO3, (1.0, 1.0, 1.0), part, k)
    assert part.overload == pytest.approx(8 * 9.80665)
    heard = []
    for tick in range(12):
        felt = (0.0, -80.0 if tick == 3 else 70.0 if tick == 8 else 0.0, 9.0)
        state = accelerometer.sense(state, felt, (1.0, 1.0, 1.0), part, k)
        heard.append(state.specific_force[2] != 0.0)
    assert heard == [tick not in (3, 4) for tick in range(12)]  # 4 kHz: two samples are 0.5 ms


@pytest.mark.parametrize("device", ["ADXRS450_ADXL355", "ADXRS450_ADXL355_4g", "ADXRS450_ADXL355_8g"])
@pytest.mark.parametrize("axis", range(3))
def test_the_overload_is_one_of_specific_force_and_not_of_the_bent_reading(device: str, axis: int) -> None:
    part = defaults(with_defaults(Parameters, devices.parameters(device))).accelerometer
    k = accelerometer.accelerometer_coefficients(part, IDENTITY3, False)
    state, _ = accelerometer.initial_accelerometer(ZERO3, ZERO3, (1.0, 1.0, 1.0), part, k)
    for share, silent in ((0.999, False), (1.001, True), (-0.999, False), (-1.001, True)):
        felt = tuple(share * part.overload if i == axis else 0.0 for i in range(3))
        assert (accelerometer.sense(state, felt, (1.0, 1.0, 1.0), part, k).silent > 0) is silent


def test_beyond_the_range_a_reading_grows_as_at_its_end() -> None:
    gains = sensitivity.cubic_gains(0.01, 2.0)
    end = sensitivity.bent(2.0, gains)
    for x in (2.0, 3.0, 8.0, 1e3):
        assert sensitivity.bent(x, gains) == pytest.approx(end / 2.0 * x)
        assert sensitivity.bent(-x, gains) == -sensitivity.bent(x, gains)


@BOTH
def test_the_lever_arm_is_the_accelerometers_and_gyros_feel_the_force_as_given(device: str) -> None:
    # turning at 3 rad/s 0.5 m off the place where the force is given: 4.5 m/s^2 inwards, for the accelerometer alone
    push = ((1e-3, 2e-3, -1e-3), (0.0, 3e-3, 1e-3), (-2e-3, 0.0, 1e-3))
    p = faultless(device, True, gyro__g_sensitivity=push, mounting__lever_arm=(0.5, 0.0, 0.0))
    turning = STILL._replace(rate=(0.0, 0.0, 3.0), specific_force=(1.0, 2.0, 9.0))
    for until in (0.0, 0.05):  # at the start and later
        shown = read(p, turning, until)
        assert shown["gyro"] == pytest.approx([0.0, 0.0, 3.0] + np.array(push) @ (1.0, 2.0, 9.0), abs=1e-8)
        assert shown["accelerometer"] == pytest.approx((1.0 - 4.5, 2.0, 9.0), abs=2e-8)


def test_a_turned_accelerometer_is_overloaded_along_its_own_axes() -> None:
    part = faultless().accelerometer
    half = math.sqrt(0.5)
    diagonal = ((half, half, 0.0), (-half, half, 0.0), (0.0, 0.0, 1.0))
    for mounting, force, silent in (
        (diagonal, (60.0, 60.0, 0.0), True),
        (diagonal, (80.0, 0.0, 0.0), False),
        (IDENTITY3, (60.0, 60.0, 0.0), False),
    ):
        k = accelerometer.accelerometer_coefficients(part, mounting, False)
        state, _ = accelerometer.initial_accelerometer(ZERO3, ZERO3, (1.0, 1.0, 1.0), part, k)
        assert (accelerometer.sense(state, force, (1.0, 1.0, 1.0), part, k).silent > 0) is silent


# --- clocks ----------------------------------------------------------------------------------------------------------


@BOTH
def test_a_clocks_error_makes_more_or_fewer_words(device: str) -> None:
    errors = (0.02, -0.01, 0.05)
    p = faultless(device, gyro__clock_error=errors, accelerometer__clock_error=0.03)
    run = run_of(p, STILL, 0.5)
    nominal = {GYRO: (500.0, 500.0), ADIS: (819.2, 819.2)}[device]
    for gyro_state, error in zip(run.state.gyro, errors, strict=True):
        assert abs(gyro_state.words - 0.5 * nominal[0] * (1 + error)) < 1.0
    assert abs(run.state.accelerometer.words - 0.5 * nominal[1] * 1.03) <= 1.0


@pytest.mark.parametrize("error", [-0.05, 0.0, 0.03])
def test_the_processors_clock_error_makes_more_or_fewer_readings(error: float) -> None:
    p = faultless(processor__clock_error=error)
    run = run_of(p, STILL, 2.0)
    assert abs(run.state.reading.readings - 2.0 * 500.0 * (1.0 + error)) <= 1.0
    ideal = run_of(p._replace(ideal=True), STILL, 2.0)
    assert ideal.state.reading.readings == 1000.0
    # a faster processor reads words twice, a slower one misses some
    beat = 6.0 * 2.0 * 500.0 * error
    assert abs(run.state.reading.repeated - max(beat, 0.0)) <= 6
    assert abs(run.state.reading.missed - max(-beat, 0.0)) <= 6


def test_repeated_and_missed_words_are_the_beat_of_the_clocks() -> None:
    # a part faster than the processor loses f_part - f_processor words a second, a slower one repeats as many
    p = faultless(gyro__clock_error=(0.02, -0.03, 0.05), accelerometer__clock_error=0.04)
    run = run_of(p, STILL, 3.0)
    reading = run.state.reading
    assert run.outputs().sample == (reading.repeated, reading.missed)
    # the accelerometer's three axes count one by one
    assert abs(reading.missed - 3.0 * 500.0 * (0.02 + 0.05 + 3.0 * 0.04)) <= 5
    assert abs(reading.repeated - 3.0 * 500.0 * 0.03) <= 2


def test_a_slow_processor_misses_most_words_and_an_ideal_sensor_repeats_none() -> None:
    slow = run_of(faultless(processor__period=0.01), STILL, 2.0).outputs().sample
    assert slow.repeated == 0
    assert abs(slow.missed - 2.0 * (500.0 - 100.0) * 6) <= 24
    assert run_of(faultless(ideal=True), STILL, 0.1).outputs().sample == (0.0, 0.0)


@pytest.mark.parametrize("part", PARTS)
@BOTH
def test_jitter_errs_by_the_slope_of_the_signal(device: str, part: str) -> None:
    # on a ramp of 0.1 /s^2 a sample 1e-3 s early or late errs by 1e-4; a standard deviation of 1990 words is known to
    # 1/sqrt(2 * 1990) = 1.6 %, four of these
    slope, jitter = 0.1, 1e-3
    way = {"gyro__filter": GYRO_FILTER.value("bartlett_1"), "accelerometer__filter": 2} if device == ADIS else {}
    p = faultless(device, True, **way, **{f"{part}__clock_jitter": jitter})
    level = 0.0
    shown, plain = [], []
    draws = normal_draws(5, 2000, 10)
    if part == "gyro":
        k = gyro.gyro_coefficients(p.gyro, IDENTITY3, False)
        state, lines = gyro.initial_gyro(0, ZERO3, ZERO3, 0.0, 1.0, p.gyro, k)
        sense = gyro.sense(0) if device == GYRO else gyro.sense_bartlett(0)
        for z in draws:
            for _ in range(4):
                level += slope * k.sense_period[0]
                state = sense(state, (level, 0.0, 0.0), ZERO3, 1.0, p.gyro, k)
            if device == GYRO:
                state = gyro.register(0)(state, 0.0, p.gyro, k, (), z)
            else:
                state, lines = gyro.sample(0, 1)(state, lines, 0.0, p.gyro, k, (), z)
            shown.append(state.code * p.gyro.resolution)
            plain.append(level)
        drawn = np.array([z[2] for z in draws])
    else:
        a = accelerometer.accelerometer_coefficients(p.accelerometer, IDENTITY3, False)
        part_state, three = accelerometer.initial_accelerometer(ZERO3, ZERO3, (1.0,) * 3, p.accelerometer, a)
        sense_part = accelerometer.sense if device == GYRO else accelerometer.sense_bartlett
        for z in draws:
            for _ in range(int(a.decimation)):
                level += slope * a.sense_period
                part_state = sense_part(part_state, (level, 0.0, 0.0), (1.0,) * 3, p.accelerometer, a)
            if device == GYRO:
                part_state = accelerometer.register(part_state, ZERO3, p.accelerometer, a, (), z)
            else:
                part_state, three = accelerometer.sample(1)(part_state, three, ZERO3, p.accelerometer, a, (), z)
            shown.append(part_state.latest.code[0] * p.accelerometer.resolution)
            plain.append(level)
        drawn = np.array([z[6] for z in draws])
    error = (np.array(shown) - np.array(plain))[10:]
    error -= error.mean()
    assert error.std() == pytest.approx(slope * jitter, rel=0.065)
    assert np.corrcoef(error, drawn[10:])[0, 1] > 0.999


@pytest.mark.parametrize("device", [GYRO, ADIS])
def test_no_error_means_the_truth(device: str) -> None:
    true = {"gyro": (0.5, -0.6, 0.7), "accelerometer": (3.0, 4.0, -5.0)}
    moving = WARM._replace(rate=true["gyro"], specific_force=true["accelerometer"], supply_voltage=4.9)
    for part, shown in read(faultless(device, True), moving, 0.3).items():
        assert shown == pytest.approx(true[part], abs=2e-8), part


def test_errors_of_parts_add_up() -> None:
    # turned, skewed, out of scale and coupled at once: S = (I + diag + cross) N R'
    s, x = (0.01, -0.02, 0.03), ((0.0, 0.01, 0.0), (0.0, 0.0, 0.02), (0.0, 0.0, 0.0))
    lean, turn = (0.01, 0.02, 0.03), (0.1, -0.05, 0.02)
    whole = np.array(sensitivity.sensitivity_matrix(s, x, lean, turn, IDENTITY3))
    parts = [
        np.array(sensitivity.sensitivity_matrix(*one, IDENTITY3))
        for one in ((s, x, ZERO3, ZERO3), (ZERO3, (ZERO3,) * 3, lean, ZERO3), (ZERO3, (ZERO3,) * 3, ZERO3, turn))
    ]
    assert whole == pytest.approx(parts[0] @ parts[1] @ parts[2])
    for a, b in itertools.pairwise(parts):
        assert a @ b != pytest.approx(b @ a)
