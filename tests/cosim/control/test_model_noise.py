"""The noise states give the variances and spectra that the models themselves show."""

from __future__ import annotations

import sys
from math import sqrt
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest

from attitude_fmu.cosim.control import (
    LinearisationRefusedError,
    ModelNoise,
    model_nlsys,
    model_noise,
    model_ss,
    operating_point,
)

sys.path.insert(0, str(Path(__file__).parent))
from small_models import DRIFT_MEMORY, chained, model

SENSOR = "AttitudeSensor_ADXRS450_ADXL355"
QUIET_BIAS = {"gyro.bias_instability": 0.0}
PROBE = model()
FINE = 1e-9


def test_white_noise_of_a_register_is_its_variance_and_that_of_its_rounding() -> None:
    noise = model_noise(PROBE, 1.0, {"noise": 0.3, "step": 0.5}, inputs="level")
    assert noise.names == ["noise_read[1]", "noise_read_rounding[1]"]
    np.testing.assert_allclose(noise.QN, np.diag([1.0, 1.0 / 12.0]))
    np.testing.assert_allclose(noise.covariance(), [[0.3**2 + 0.5**2 / 12.0]], rtol=1e-12)
    np.testing.assert_allclose(noise.RN, 1e-6 * noise.covariance(), rtol=1e-12)
    assert not model_noise(PROBE, 1.0, {"noise": 0.3}, inputs="level", reading_noise=0.0).RN.any()


def test_several_draws_in_a_sampling_time_are_inputs_of_their_own() -> None:
    noise = model_noise(PROBE, 2.0, {"noise": 0.3, "step": FINE}, inputs="level")
    assert noise.names[0] == "noise_read[1](2)"  # of the first reading nothing is left
    np.testing.assert_allclose(noise.covariance(), [[0.3**2]], rtol=1e-9)


@pytest.mark.parametrize("dt", [10.0, 5.0, 1.0])
def test_a_process_of_a_slower_clock_keeps_its_covariance_at_its_own_steps(dt: float) -> None:
    """Every 10 s R(0) = s^2, R(10 s) = s^2 exp(-0.3), whatever dt the process is taken at."""
    noise = model_noise(PROBE, dt, {"drift": 0.7, "step": FINE}, inputs="level")
    np.testing.assert_allclose(noise.covariance(), [[0.7**2]], rtol=1e-9)
    np.testing.assert_allclose(correlation(noise, round(10.0 / dt)), 0.7**2 * DRIFT_MEMORY, rtol=1e-6)


def test_noise_that_cannot_be_taken_at_the_sampling_time_is_refused_with_what_sets_its_pace() -> None:
    plant = operating_point("TripodGimbal", 0.001, hold={"joint": 0.0}, free="motor_torque")
    with pytest.raises(LinearisationRefusedError, match=r"task wind.*set wind\.period"):
        model_noise("TripodGimbal", 0.001, operating_point=plant)


def test_noise_that_a_slower_task_hands_on_is_refused_not_lost() -> None:
    """A relay at a tenth of the pace of what it reads draws nothing itself."""
    relay = chained(24)
    for outputs in ("relayed", ["relayed", "walk"], None):
        with pytest.raises(LinearisationRefusedError, match=r"task relay steps every 10 s.*hands on.*set slow"):
            model_noise(relay, 1.0, inputs="level", outputs=outputs)
    at_its_pace = model_noise(relay, 10.0, inputs="level", outputs="relayed")
    np.testing.assert_allclose(at_its_pace.covariance(), [[1.0 / (1.0 - 0.5**2)]], rtol=1e-5)
    beside = model_noise(relay, 1.0, inputs="level", outputs="walk")
    np.testing.assert_allclose(beside.covariance(), [[1.0 / (1.0 - 0.5**2)]], rtol=1e-12)


def test_noise_without_a_stationary_variance_is_refused() -> None:
    noise = model_noise(SENSOR, 0.002, {"solver.kind": "gyro"}, outputs="euler")
    with pytest.raises(LinearisationRefusedError, match="integrates"):
        noise.covariance()


def test_the_system_without_the_noise_is_the_linear_model() -> None:
    noise = model_noise(SENSOR, 0.002, inputs="rate", outputs="rate_measured")
    bare = model_ss(SENSOR, 0.002, inputs="rate", outputs="rate_measured")
    z = np.exp(2j * np.pi * 0.002 * np.array([1.0, 30.0, 200.0]))
    for one in z:
        np.testing.assert_allclose(noise.system(one), bare(one), rtol=1e-9, atol=1e-12)


def correlation(noise: ModelNoise, lag: int) -> float:
    """Autocovariance of the first output at a lag, by the state's covariance."""
    s = noise.system
    P = control.dlyap(s.A, noise.G @ noise.QN @ noise.G.T)
    return float((s.C @ np.linalg.matrix_power(s.A, lag) @ P @ s.C.T)[0, 0])


def shown(steps: int, seed: int, parameters: dict[str, float]) -> Any:
    """Rates of the sensor at rest as the processor reads them, over so many readings, noise from numpy."""
    system = model_nlsys(SENSOR, 0.002, parameters, outputs="rate_measured")
    draw = np.random.default_rng(seed)
    x, u = system.initial_state, np.zeros(system.ninputs)
    u[: system.ninputs - len(system.noise_labels)] = system.constant_inputs
    rates = np.empty((steps, 3))
    for k in range(steps):
        u[-len(system.noise_labels) :] = draw.standard_normal(len(system.noise_labels))
        x = system.dynamics(k * 0.002, x, u)
        rates[k] = system.output((k + 1) * 0.002, x, u)
    return rates[20:]  # the window is full


@pytest.fixture(scope="module")
def measured() -> Any:
    return shown(12000, 20260, QUIET_BIAS)


@pytest.fixture(scope="module")
def predicted() -> ModelNoise:
    return model_noise(SENSOR, 0.002, QUIET_BIAS, inputs="rate", outputs="rate_measured")


def test_predicted_variance_is_that_of_the_sensor_itself(measured: Any, predicted: ModelNoise) -> None:
    """Within four standard deviations of a variance of N correlated samples, sqrt(2/N sum R(k)^2)/R(0), one axis each.

    Full model: quantisers, limits, alignment.
    """
    R = np.array([correlation(predicted, abs(lag)) for lag in range(-20, 21)])
    bound = 4.0 * sqrt(2.0 / len(measured) * np.sum(R**2))
    found = np.var(measured, axis=0)
    np.testing.assert_allclose(found, np.diag(predicted.covariance()), atol=bound)
    assert bound < 0.1 * R[20]


def test_predicted_spectrum_is_that_of_the_sensor_itself(measured: Any, predicted: ModelNoise) -> None:
    """Periodograms of 3 axes, averaged over M segments: within five of their relative deviation 1/sqrt(3 M)."""
    length = 200
    segments = measured[: len(measured) // length * length].T.reshape(3, -1, length)
    power = np.abs(np.fft.rfft((segments - measured.mean(axis=0)[:, None, None]), axis=2)) ** 2
    density = 2.0 * 0.002 / length * power.mean(axis=(0, 1))
    frequencies = np.fft.rfftfreq(length, 0.002)
    inner = slice(2, 24)  # 5 to 58 Hz: beyond, a segment's leakage is more than what the window leaves
    expected = predicted.density(frequencies[inner])[0]
    count = 3 * segments.shape[1]
    np.testing.assert_allclose(density[inner], expected, rtol=5.0 / sqrt(count))


def test_low_frequency_noise_is_the_datasheets_density(predicted: ModelNoise) -> None:
    """0.015 deg/s/sqrt(Hz), and the register's rounding of 0.0125 deg/s, white over its 500 Hz."""
    rounding = np.radians(0.0125) ** 2 / 12.0 * 2.0 * 0.002
    expected = np.radians(0.015) ** 2 + rounding
    np.testing.assert_allclose(predicted.density([0.01])[:, 0], expected, rtol=0.01)  # gain of the nonlinearity


def test_kalman_designs_of_python_control_take_the_matrices(predicted: ModelNoise) -> None:
    """From a wrong start the estimate comes to the noisy truth, and its error then has the covariance P.

    The squared error of N readings scatters by sqrt(2/N) where they are independent; over 4 times that stands for their
    correlation over the two readings of a window, and 3 axes are taken together.
    """
    s = predicted.system
    L, P, poles = control.dlqe(s.A, predicted.G, s.C, predicted.QN, predicted.RN)
    assert L.shape == (s.nstates, 3)
    assert max(abs(poles)) < 1.0
    estimator = control.create_estimator_iosystem(
        predicted.driven, predicted.QN, predicted.RN, P0=P, control_indices=s.ninputs
    )
    steps, draw = 1500, np.random.default_rng(7)
    time = np.arange(steps) * 0.002
    rate = np.zeros((3, steps))
    rate[0] = 0.1
    w = np.sqrt(np.diag(predicted.QN))[:, None] * draw.standard_normal((len(predicted.QN), steps))
    plant = control.forced_response(predicted.driven, time, np.vstack([rate, w]))
    v = np.sqrt(np.diag(predicted.RN))[:, None] * draw.standard_normal((3, steps))
    far = np.concatenate([10.0 * np.sqrt(np.diag(P)), P.ravel()])
    given = np.vstack([plant.outputs + v, rate])
    estimate = control.input_output_response(estimator, time, given, far).outputs[: s.nstates]
    error = s.C @ (estimate - plant.states)
    late = error[:, steps // 2 :]
    expected = np.trace(s.C @ P @ s.C.T)
    assert np.square(error[:, :3]).sum(axis=0).max() > 5.0 * expected
    np.testing.assert_allclose(np.square(late).sum(axis=0).mean(), expected, rtol=4.0 * sqrt(2.0 / late.size))


@pytest.mark.parametrize("kind", ["gyro", "levelling", "fused"])
@pytest.mark.parametrize("outputs", ["rate_measured", "euler"])
def test_every_solvers_noise_gives_a_stable_estimator(kind: str, outputs: str) -> None:
    noise = model_noise(SENSOR, 0.002, {"solver.kind": kind}, inputs="rate", outputs=outputs)
    s = noise.system
    _, P, poles = control.dlqe(s.A, noise.G, s.C, noise.QN, noise.RN)
    assert max(abs(poles)) < 1.0
    assert np.linalg.eigvalsh(P).min() > -1e-12 * np.abs(P).max()
