"""The whole sensor: identities of the ideal one, statistics of the real one, behaviour of filters and solvers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from attitude_fmu.models.attitude.integration import INTEGRATION, INTEGRATORS, Integrator
from attitude_fmu.models.attitude.rotations import (
    STANDARD_GRAVITY,
    Euler,
    earth_rate_n,
    matrix_from_euler,
    matrix_from_quaternion,
)
from attitude_fmu.models.attitude.velocity_aided import FusionParameters
from attitude_fmu.models.attitude_sensor import FILTER, MODEL, SOLVER, Inputs, Parameters
from attitude_fmu.models.errors import ValueRefusedError
from attitude_fmu.models.filters.kalman import kalman_filtered
from attitude_fmu.models.record import check, defaults, flatten
from attitude_fmu.models.sensors.datasheet import REFERENCE_TEMPERATURE
from attitude_fmu.models.system import Run
from attitude_fmu.models.vectors import ZERO3, add, multiply_transposed, subtract

REAL: Parameters = defaults(Parameters)
IDEAL = REAL._replace(ideal=True)


def with_parts(parameters: Any, **parts: dict[str, Any]) -> Any:
    """Parameters with some fields of some of their records replaced."""
    return parameters._replace(**{name: getattr(parameters, name)._replace(**fields) for name, fields in parts.items()})


def at_rest(euler: Euler, latitude: float, temperature: float = REFERENCE_TEMPERATURE) -> Inputs:
    """What a body at rest on the turning Earth feels."""
    c_nb = matrix_from_euler(euler)
    return Inputs(
        rate=multiply_transposed(c_nb, earth_rate_n(latitude)),
        specific_force=multiply_transposed(c_nb, (0.0, 0.0, STANDARD_GRAVITY)),
        temperature=temperature,
        heading_aid=euler.yaw,
    )


def settled(parameters: Parameters, inputs: Inputs, until: float) -> Run:
    run = Run(MODEL, parameters, inputs)
    run.advance(inputs, until)
    return run


GRID = [
    Euler(math.radians(yaw), math.radians(pitch), math.radians(roll))
    for yaw in (-170, -60, 0, 35, 180)
    for pitch in (-90, -89, -40, 0, 20, 89, 90)
    for roll in (-179, -90, -10, 0, 45, 120)
]


@pytest.mark.parametrize("solver", ["levelling", "gyro", "fused"])
def test_an_ideal_sensor_at_rest_shows_the_true_attitude(solver: str) -> None:
    parameters = with_parts(IDEAL, solver={"kind": SOLVER.value(solver)}, alignment={"duration": 0.01})
    for euler in GRID:
        shown = settled(parameters, at_rest(euler, parameters.latitude), 0.2).outputs()
        truth = Rotation.from_euler("ZXY", [-euler.yaw, euler.pitch, euler.roll])
        ours = Rotation.from_euler("ZXY", [-shown.euler.yaw, shown.euler.pitch, shown.euler.roll])
        up = truth.inv().apply([0, 0, 1]), ours.inv().apply([0, 0, 1])
        inclination_error = math.degrees(math.asin(min(1.0, float(np.linalg.norm(np.cross(*up))))))
        assert inclination_error < 1e-9
        if abs(euler.pitch) < math.radians(89.5):
            errors = [math.remainder(a - b, 2 * math.pi) for a, b in zip(shown.euler, euler, strict=True)]
            assert max(map(abs, errors)) < math.radians(1e-9)
        x, y, z, w = truth.as_quat()
        if abs(euler.pitch) < math.radians(89.5):
            assert abs(abs(np.dot(shown.quaternion, (w, x, y, z))) - 1) < 1e-15


@pytest.mark.parametrize("solver", ["gyro", "fused"])
def test_an_ideal_sensor_follows_a_turn_about_every_axis(solver: str) -> None:
    parameters = with_parts(
        IDEAL, solver={"kind": SOLVER.value(solver)}, alignment={"duration": 0.0, "null_gyro": False}
    )
    level = at_rest(Euler(0.0, 0.0, 0.0), parameters.latitude)
    run = Run(MODEL, parameters, level)
    run.advance(level, 0.01)
    truth, step = Rotation.identity(), 0.002
    for k in range(1000):
        w = np.array([0.8 * math.sin(0.01 * k), 0.6, -0.4 * math.cos(0.02 * k)])
        truth = truth * Rotation.from_rotvec(w * step)
        c_nb = truth.as_matrix()
        earth = c_nb.T @ earth_rate_n(parameters.latitude)
        force = c_nb.T @ [0, 0, STANDARD_GRAVITY]
        inputs = level._replace(rate=tuple((w + earth).tolist()), specific_force=tuple(force.tolist()))
        run.advance(inputs, 0.01 + (k + 1) * step)
    error = Rotation.from_matrix(matrix_from_quaternion(run.outputs().quaternion)).inv() * truth
    # trapezoid on held rates lags by less than half a sample of the last rate change: well below 0.1 deg
    assert math.degrees(error.magnitude()) < (0.1 if solver == "gyro" else 1e-3)


def test_every_solver_integrates_in_the_chosen_way() -> None:
    # a fused solver that trusts its gyros does nothing but integrate; a cone tells the integrators apart
    fusion = FusionParameters(1e-9, 0.0, 0.0, 1e-9, 1e-9, 1e6, 0.0, rest_bias=0.0)
    ends = []
    for item in INTEGRATION.items:
        shown = []
        for kind in ("gyro", "fused"):
            solver = {"kind": SOLVER.value(kind), "integration": INTEGRATION.value(item.name), "fusion": fusion}
            parameters = with_parts(IDEAL, solver=solver, alignment={"duration": 0.0, "null_gyro": False})
            run = Run(MODEL, parameters, Inputs())
            for k in range(1, 501):
                rate = (2.0 * math.sin(0.3 * k), 2.0 * math.cos(0.3 * k), 0.5)
                run.advance(Inputs(rate=rate), 0.002 * k)
            shown.append(np.array(run.outputs().quaternion))
        # the filter's own corrections: 1e-9 rad of tilt at most
        assert shown[0] == pytest.approx(shown[1], abs=1e-8)
        integrate = INTEGRATORS[INTEGRATION.value(item.name)]
        q = by_hand(integrate, parameters)
        assert shown[0] == pytest.approx(np.array(q), abs=1e-12)
        ends.append(shown[0])
    apart = [np.linalg.norm(a - b) for i, a in enumerate(ends) for b in ends[:i]]
    assert min(apart) > 1e-12


def by_hand(integrate: Integrator, parameters: Parameters) -> Any:
    """q_nb of the cone of the test above, from its first reading on."""
    before, q = (2.0 * math.sin(0.3), 2.0 * math.cos(0.3), 0.5), (1.0, 0.0, 0.0, 0.0)
    for k in range(2, 501):
        now = (2.0 * math.sin(0.3 * k), 2.0 * math.cos(0.3 * k), 0.5)
        earth = multiply_transposed(matrix_from_quaternion(q), earth_rate_n(parameters.latitude))
        q = integrate(q, subtract(before, earth), subtract(now, earth), 0.002)
        before = now
    return q


@pytest.mark.parametrize("step", [0.005, 0.0073, 0.01])
def test_constant_inputs_give_the_same_bits_however_time_is_cut(step: float) -> None:
    inputs = at_rest(Euler(0.3, 0.1, -0.2), REAL.latitude)
    parameters = with_parts(REAL, alignment={"duration": 0.2})
    fine, coarse = Run(MODEL, parameters, inputs), Run(MODEL, parameters, inputs)
    for k in range(1, 731):
        fine.advance(inputs, k * 0.001)
    for k in range(1, round(0.73 / step) + 1):
        coarse.advance(inputs, k * step)
    coarse.advance(inputs, 0.73)
    assert coarse.snapshot() == fine.snapshot()
    assert coarse.outputs() == fine.outputs()


def spectral_density(x: np.ndarray, rate: float, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    """One-sided periodogram between two frequencies."""
    n = len(x)
    frequency = np.fft.rfftfreq(n, 1 / rate)
    power = 2 * np.abs(np.fft.rfft(x - x.mean())) ** 2 / (n * rate)
    band = (frequency > low) & (frequency < high)
    return frequency[band], power[band]


def test_white_noise_of_every_channel_of_a_resting_device_is_that_of_its_datasheet() -> None:
    # 5..45 Hz over 60 s: 2400 exponential bins give the density to 0.5/sqrt(2400) = 1.0 %, so 5 % is 4.9 sigma
    parameters = with_parts(REAL, solver={"kind": SOLVER.value("gyro")}, alignment={"duration": 0.0})
    inputs = at_rest(Euler(0.0, 0.0, 0.0), parameters.latitude)
    run = Run(MODEL, parameters, inputs)
    rows = []
    for k in range(1, 30_001):
        run.advance(inputs, k * 0.002)
        rows.append((*run.state.reading.rate, *run.state.reading.specific_force))
    samples = np.array(rows)
    k = run.coefficients
    for channel in range(6):
        frequency, power = spectral_density(samples[:, channel], 500.0, 5.0, 45.0)
        if channel < 3:
            sheet, sample_rate, ratio = parameters.gyro, 8.0 / k.gyro.sense_period[channel], 64
        else:
            sheet, sample_rate, ratio = parameters.accelerometer, 1.0 / k.accelerometer.sense_period, 8
        x = math.pi * frequency / sample_rate
        response = (np.sin(ratio * x) / (ratio * np.sin(x))) ** 2
        flicker = sheet.bias_instability**2 / (math.pi * frequency)
        density = math.sqrt(np.mean((power - flicker) / response**2))
        assert density == pytest.approx(sheet.noise_density, rel=0.05)


def test_registers_show_offset_scale_and_temperature_as_the_parameters_say() -> None:
    quiet = with_parts(
        REAL,
        gyro={"noise_density": 0.0, "bias_instability": 0.0, "nonlinearity": 0.0, "rectification": ZERO3},
        accelerometer={"noise_density": 0.0, "bias_instability": 0.0, "nonlinearity": 0.0},
    )
    warm = at_rest(Euler(0.0, 0.0, 0.0), 0.0, temperature=313.15)._replace(rate=(0.5, 0.0, 0.0))
    shown = settled(quiet, warm, 1.0).outputs()
    rise = 313.15 + quiet.gyro.thermal.self_heating - REFERENCE_TEMPERATURE
    g = quiet.gyro
    expected = (
        0.5 * (1 + g.scale_error[0])
        + g.bias[0]
        + g.bias_temperature_slope[0] * rise
        + g.g_sensitivity[0][2] * STANDARD_GRAVITY
    )
    assert shown.register.rate[0] == math.floor(expected / g.resolution + 0.5)
    a = quiet.accelerometer
    rise = 313.15 + a.thermal.self_heating - REFERENCE_TEMPERATURE
    expected = STANDARD_GRAVITY * (1 + a.scale_error[2]) + a.bias[2] + a.bias_temperature_slope[2] * rise
    assert shown.register.acceleration[2] == math.floor(expected / a.resolution + 0.5)
    assert shown.die_temperature.gyro == pytest.approx(313.15 + g.thermal.self_heating)


def test_gyros_saturate_at_their_range_and_say_so() -> None:
    spinning = at_rest(Euler(0.0, 0.0, 0.0), 0.0)._replace(rate=(0.0, 0.0, math.radians(500.0)))
    shown = settled(with_parts(REAL, alignment={"duration": 0.0}), spinning, 0.05).outputs()
    assert shown.register.rate[2] == 24000
    assert shown.status == 3


def test_alignment_takes_its_time_and_then_the_attitude_is_valid() -> None:
    parameters = with_parts(REAL, alignment={"duration": 0.5})
    inputs = at_rest(Euler(1.0, 0.2, -0.1), parameters.latitude)
    run = settled(parameters, inputs, 0.49)
    assert (run.outputs().aligned, run.outputs().status) == (0.0, 1.0)
    run.advance(inputs, 0.51)
    assert (run.outputs().aligned, run.outputs().status) == (1.0, 2.0)
    assert run.outputs().euler.yaw == pytest.approx(1.0, abs=1e-3)


def test_alignment_nulls_the_gyro_bias_to_its_averaged_noise() -> None:
    parameters = with_parts(REAL, alignment={"duration": 2.0}, solver={"kind": SOLVER.value("gyro")})
    run = settled(parameters, at_rest(Euler(0.0, 0.0, 0.0), parameters.latitude), 2.1)
    true_bias = [
        b + k * parameters.gyro.thermal.self_heating + row[2] * STANDARD_GRAVITY
        for b, k, row in zip(
            parameters.gyro.bias, parameters.gyro.bias_temperature_slope, parameters.gyro.g_sensitivity, strict=True
        )
    ]
    # white noise N/sqrt(T) with N = D/sqrt(2), and flicker of about B; 5 sigma
    sigma = math.hypot(parameters.gyro.noise_density / 2.0, 2.1 * parameters.gyro.bias_instability)
    assert run.outputs().gyro_bias == pytest.approx(true_bias, abs=5 * sigma)


def test_fusion_finds_a_gyro_bias_that_pure_integration_drifts_by() -> None:
    biased = with_parts(
        IDEAL, alignment={"duration": 0.1, "null_gyro": False}, processor={"period": 0.01, "clock_error": 0.0}
    )
    level = at_rest(Euler(0.0, 0.0, 0.0), biased.latitude)
    w = level.rate
    bias = (0.004, -0.003, 0.002)
    inputs = level._replace(rate=tuple(a + b for a, b in zip(w, bias, strict=True)))
    fused = settled(biased, inputs, 60.0).outputs()
    integrated = settled(with_parts(biased, solver={"kind": SOLVER.value("gyro")}), inputs, 60.0).outputs()
    assert abs(integrated.euler.pitch) > math.radians(10.0)
    assert abs(fused.euler.pitch) < math.radians(0.02)
    assert fused.gyro_bias == pytest.approx(bias, abs=2e-4)


@pytest.mark.parametrize("turn", [0.1, 1.0, 20.0])
def test_a_slow_steady_turn_after_the_alignment_is_not_taken_for_bias(turn: float) -> None:
    # rest is believed up to 1 mrad/s (0.057 deg/s) about the aligned bias
    parameters = with_parts(IDEAL, processor={"period": 0.01, "clock_error": 0.0})
    rest = at_rest(Euler(0.0, 0.0, 0.0), 0.0)
    parameters = parameters._replace(latitude=0.0)
    run = settled(parameters, rest, 5.0)
    for k in range(1, 6001):
        yaw = math.radians(turn * 0.01 * k)
        turning = at_rest(Euler(yaw, 0.0, 0.0), parameters.latitude)
        run.advance(turning._replace(rate=add(turning.rate, (0.0, 0.0, -math.radians(turn)))), 5.0 + 0.01 * k)
    missing = math.remainder(math.radians(turn * 60.0) - run.outputs().euler.yaw, 2 * math.pi)
    assert abs(math.degrees(missing)) < 0.05  # until the mean rate has left the bound


def test_rest_moves_the_bias_by_no_more_than_its_bound() -> None:
    parameters = with_parts(IDEAL, processor={"period": 0.01, "clock_error": 0.0})
    rest = at_rest(Euler(0.0, 0.0, 0.0), parameters.latitude)
    run = settled(parameters, rest, 5.0)
    bound = parameters.solver.fusion.rest_bias
    run.advance(rest._replace(rate=add(rest.rate, (0.0, 0.0, 0.9 * bound))), 120.0)
    assert 0.5 * bound < run.outputs().gyro_bias[2] < bound
    run.advance(rest._replace(rate=add(rest.rate, (0.0, 0.0, 1.5 * bound))), 240.0)
    assert run.outputs().gyro_bias[2] < bound


def test_a_turn_too_fast_for_a_null_offset_is_not_nulled() -> None:
    parameters = with_parts(IDEAL, processor={"period": 0.01, "clock_error": 0.0})
    rest = at_rest(Euler(0.0, 0.0, 0.0), parameters.latitude)
    turning = rest._replace(rate=add(rest.rate, (0.0, 0.0, math.radians(5.0))))
    assert settled(parameters, turning, 2.01).outputs().gyro_bias[2] == pytest.approx(0.0, abs=1e-6)


def test_levelling_follows_acceleration_where_fusion_does_not() -> None:
    # 2 Hz shaking of 1 m/s^2 along x: levelling swings by atan(1/g) = 5.8 deg
    def largest_roll(solver: str) -> float:
        parameters = with_parts(
            IDEAL, solver={"kind": SOLVER.value(solver)}, processor={"period": 0.01, "clock_error": 0.0}
        )
        rest = at_rest(Euler(0.0, 0.0, 0.0), parameters.latitude)
        run = Run(MODEL, parameters, rest)
        run.advance(rest, 3.0)
        worst = 0.0
        for k in range(1, 1001):
            t = k * 0.01
            shaken = (math.sin(4 * math.pi * t), 0.0, STANDARD_GRAVITY)
            run.advance(rest._replace(specific_force=shaken), 3.0 + t)
            worst = max(worst, abs(run.outputs().euler.roll))
        return math.degrees(worst)

    assert largest_roll("levelling") == pytest.approx(5.8, abs=0.1)
    assert largest_roll("fused") < 0.3


@pytest.mark.parametrize("kind", ["rc", "kalman"])
def test_angle_filters_are_those_of_the_paper(kind: str) -> None:
    parameters = with_parts(
        IDEAL,
        solver={"kind": SOLVER.value("levelling")},
        alignment={"duration": 0.0},
        processor={"period": 0.02, "clock_error": 0.0},
        filter={"kind": FILTER.value(kind), "from_zero": True, "divider": 1},
    )
    roll = math.radians(43.5)
    inputs = at_rest(Euler(0.0, 0.0, roll), parameters.latitude)
    run = Run(MODEL, parameters, inputs)
    y, p = 0.0, parameters.filter.kalman.R
    for k in range(1, 200):
        run.advance(inputs, k * 0.02)
        if kind == "rc":
            gain = 1 / 100
        else:
            p += parameters.filter.kalman.Q
            gain = p / (p + parameters.filter.kalman.R)
            p *= 1 - gain
        y += gain * (roll - y)
        assert run.outputs().euler.roll == pytest.approx(y, abs=1e-12)


def test_the_rc_filter_settles_in_the_papers_time() -> None:
    # 43.5 deg to within 0.104 deg takes 6.0 time constants: 12 s at the default 50 Hz and num = 100 (11 s published)
    parameters = with_parts(
        IDEAL,
        solver={"kind": SOLVER.value("levelling")},
        alignment={"duration": 0.0},
        filter={"kind": FILTER.value("rc"), "from_zero": True},
    )
    roll = math.radians(43.5)
    inputs = at_rest(Euler(0.0, 0.0, roll), parameters.latitude)
    run = settled(parameters, inputs, 11.0)
    assert math.degrees(roll - run.outputs().euler.roll) > 0.104
    run.advance(inputs, 12.5)
    assert math.degrees(roll - run.outputs().euler.roll) < 0.104


def test_the_kalman_filter_settles_to_the_papers_gain() -> None:
    kalman = REAL.filter.kalman
    variance = kalman.R
    for _ in range(1000):
        moved, variance = kalman_filtered(0.0, variance, 0.01, kalman.Q, kalman.R)
    assert moved / 0.01 == pytest.approx(0.094, abs=0.001)


@pytest.mark.parametrize("kind", ["rc", "kalman"])
def test_angles_filter_the_short_way_across_the_half_turn(kind: str) -> None:
    parameters = with_parts(
        IDEAL,
        alignment={"duration": 0.0, "null_gyro": False},
        processor={"clock_error": 0.0},
        solver={"kind": SOLVER.value("levelling")},
        filter={"kind": FILTER.value(kind), "divider": 1},
    )
    left = at_rest(Euler(0.0, 0.0, math.radians(179.0)), parameters.latitude)
    right = at_rest(Euler(0.0, 0.0, math.radians(-179.0)), parameters.latitude)
    run = settled(parameters, left, 0.1)
    for k in range(1, 1000):
        run.advance(right, 0.1 + k * 0.002)
        assert abs(math.degrees(run.outputs().euler.roll)) >= 179.0 - 1e-6
    assert math.degrees(run.outputs().euler.roll) == pytest.approx(-179.0, abs=0.01)


def test_the_filter_divider_slows_the_angle_filter_alone() -> None:
    parameters = with_parts(
        IDEAL,
        alignment={"duration": 0.0},
        processor={"period": 0.002, "clock_error": 0.0},
        filter={"kind": FILTER.value("rc"), "from_zero": True, "divider": 10},
    )
    inputs = at_rest(Euler(0.0, 0.0, 0.5), parameters.latitude)
    run = settled(parameters, inputs, 0.019)
    assert run.outputs().euler.roll == 0.0
    run.advance(inputs, 0.02)
    assert run.outputs().euler.roll == pytest.approx(0.005)


def test_mounting_turns_what_the_sensor_feels() -> None:
    parameters = with_parts(
        IDEAL, mounting={"rotation": Euler(0.0, math.radians(30.0), 0.0)}, alignment={"duration": 0.0}
    )
    shown = settled(parameters, at_rest(Euler(0.0, 0.0, 0.0), parameters.latitude), 0.01).outputs()
    assert math.degrees(shown.euler.pitch) == pytest.approx(30.0, abs=1e-9)


def test_equal_seeds_repeat_and_others_differ() -> None:
    inputs = at_rest(Euler(0.0, 0.0, 0.0), 0.0)
    a, b, c = (settled(REAL._replace(seed=seed), inputs, 0.05).outputs().register for seed in (3, 3, 4))
    assert a == b != c


def test_noise_does_not_change_when_the_filter_is_exchanged() -> None:
    inputs = at_rest(Euler(0.0, 0.0, 0.0), 0.0)
    plain = settled(REAL, inputs, 0.1).outputs()
    other = settled(with_parts(REAL, filter={"kind": FILTER.value("kalman")}), inputs, 0.1).outputs()
    assert plain.register == other.register


def test_celsius_for_kelvin_is_refused_with_a_hint() -> None:
    with pytest.raises(ValueRefusedError, match="kelvin wanted"):
        check(Inputs, flatten(Inputs()._replace(temperature=25.0)), "sensor")


def test_a_range_that_the_register_word_cannot_hold_is_refused() -> None:
    with pytest.raises(ValueRefusedError, match=r"sensor.gyro.range = .*register word ends at gyro.code_limit LSB"):
        Run(MODEL, with_parts(REAL, gyro={"range": 20.0}), Inputs(), name="sensor")
