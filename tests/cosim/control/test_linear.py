"""The linear model is the model's own derivative, with several clocks in a sampling time."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any
from unittest import mock

import control
import numpy as np
import pytest

from attitude_fmu.cosim.control import LinearisationRefusedError, OperatingPoint, model_ss, operating_point
from attitude_fmu.cosim.control.folding import without_sums
from attitude_fmu.models.record import flatten, leaves, unflatten
from attitude_fmu.models.sensors import digital_filter, quantiser, words
from attitude_fmu.models.system import Run

sys.path.insert(0, str(Path(__file__).parent))
from small_models import model

SENSOR = "AttitudeSensor_ADXRS450_ADXL355"
PROBE = model()
CALM = {"wind.turbulence": 0.0, "wind.shedding": 0.0}
SMOOTH = CALM | {f"friction.{joint}.coulomb": 0.0 for joint in ("yaw", "pitch", "roll")}
"""Without dry friction, whose bristles make the plant's second derivative jump where it rests."""
SILENT = {f"{part}.{term}": 0.0 for part in ("gyro", "accelerometer") for term in ("noise_density", "bias_instability")}


def test_ticks_in_a_sampling_time_are_one_product() -> None:
    """Four steps of the lag, then the reading: lag' = a^4 lag + (1 - a^4) u, shown' = lag'."""
    system = model_ss(PROBE, 1.0, inputs="level")
    a = 0.8**4
    assert system.state_labels == ["lag", "shown"]
    np.testing.assert_allclose(system.A, [[a, 0.0], [a, 0.0]], rtol=1e-14)
    np.testing.assert_allclose(system.B, [[1.0 - a], [1.0 - a]], rtol=1e-14)
    np.testing.assert_array_equal(system.C, [[0.0, 1.0]])
    assert system.dt == 1.0


def test_of_two_ticks_at_one_moment_the_clock_declared_first_goes_first() -> None:
    """With the reading's clock ahead the register holds what the lag was one fast tick before."""
    system = model_ss(model(("reading", "fast", "slow")), 1.0, inputs="level")
    np.testing.assert_allclose(system.A, [[0.8**4, 0.0], [0.8**3, 0.0]], rtol=1e-14)


def test_a_longer_sampling_time_folds_several_readings() -> None:
    system = model_ss(PROBE, 3.0, inputs="level")
    np.testing.assert_allclose(system.A[:, 0], [0.8**12, 0.8**12], rtol=1e-13)


def test_a_clock_a_little_wrong_is_taken_at_its_nominal_rate() -> None:
    late = model_ss(PROBE, 1.0, {"fast": 0.255}, inputs="level")
    np.testing.assert_array_equal(late.A, model_ss(PROBE, 1.0, inputs="level").A)


@pytest.mark.parametrize(
    ("dt", "parameters", "inputs", "told"),
    [
        (1.0, {"every": 3}, "level", "choose dt = 3 s"),
        (1.0, {"reading": 1.5}, "level", "choose dt = 3 s"),
        (1.0, {"reading": 1.414213}, "level", "set reading"),
        (1.0, {}, "offset", "choose dt = 10 s"),
        (1.0, {}, "levl", "did you mean level"),
        (-1.0, {}, "level", "positive"),
    ],
)
def test_what_does_not_fit_the_sampling_time_is_refused_with_a_way_out(
    dt: float, parameters: Mapping[str, float], inputs: str, told: str
) -> None:
    with pytest.raises(LinearisationRefusedError, match=told):
        model_ss(PROBE, dt, parameters, inputs=inputs)


def test_the_sampling_time_that_the_refusal_names_is_accepted() -> None:
    system = model_ss(PROBE, 3.0, {"reading": 1.5}, inputs="level")
    np.testing.assert_allclose(system.A[:, 0], [0.8**12, 0.8**12], rtol=1e-13)
    assert model_ss(PROBE, 10.0).input_labels == ["level", "offset"]


def test_clocks_that_are_set_by_different_parameters_are_all_named_and_the_advice_is_accepted() -> None:
    """ADIS16354 at 819.2 Hz under a processor at 500 Hz: both dt and the processor's period have to go."""
    adis, dt = "AttitudeSensor_ADIS16354_150", 2.0 / 819.2
    with pytest.raises(LinearisationRefusedError, match=rf"choose dt = {dt} s and set processor\.period"):
        model_ss(adis, 0.002)
    assert model_ss(adis, dt, {"processor.period": dt}).ninputs == 6
    with pytest.raises(LinearisationRefusedError, match=r"choose dt = 1.414213 s and set fast .*; or set reading"):
        model_ss(PROBE, 1.0, {"reading": 1.414213}, inputs="level")


def test_an_empty_result_is_refused_with_what_to_set() -> None:
    with pytest.raises(LinearisationRefusedError, match=r"command\.angle.* acts on none .*source \(profile, inputs\)"):
        model_ss("Turntable", 0.001)
    with pytest.raises(LinearisationRefusedError, match=r"command\.mode \("):
        model_ss("Turntable", 0.001, inputs="command.angle")
    with pytest.raises(LinearisationRefusedError, match="level acts on none"):
        model_ss(PROBE, 1.0, {"limit": 1.0}, operating_point={"level": 3.0}, inputs="level")


def test_inputs_that_act_through_slower_clocks_are_left_out_unless_asked_for() -> None:
    assert model_ss(PROBE, 1.0).input_labels == ["level"]


def test_a_signal_passes_the_quantiser_but_not_the_limit() -> None:
    assert model_ss(PROBE, 1.0, {"step": 100.0}, inputs="level").dcgain() == pytest.approx(1.0)
    beyond = model_ss(PROBE, 1.0, {"limit": 1.0}, operating_point={"level": 3.0}, inputs="level", outputs="value")
    assert beyond.nstates == 0
    assert beyond.dcgain() == 0.0


def test_a_growing_mode_is_refused_unless_allowed() -> None:
    with pytest.raises(LinearisationRefusedError, match="allow_unstable=True"):
        model_ss(PROBE, 1.0, {"pole": 1.1}, inputs="level")
    grows = model_ss(PROBE, 1.0, {"pole": 1.1}, inputs="level", allow_unstable=True)
    assert max(abs(grows.poles())) == pytest.approx(1.1**4)


def test_an_operating_point_that_moves_is_refused_unless_allowed() -> None:
    at_rest = operating_point(PROBE, 1.0)
    moving = at_rest._replace(state=at_rest.state._replace(lag=0.3))
    with pytest.raises(LinearisationRefusedError, match=r"moves: state\.lag = 0\.3 .*hold"):
        model_ss(PROBE, 1.0, operating_point=moving, inputs="level")
    system = model_ss(PROBE, 1.0, operating_point=moving, inputs="level", allow_drift=True)
    assert system.nstates == 2


def test_what_cannot_be_held_is_refused() -> None:
    with pytest.raises(LinearisationRefusedError, match="cannot be held"):
        operating_point("TripodGimbal", 0.001, hold={"joint": 0.1}, free="motor_torque.yaw")


def test_unknown_names_are_refused_with_those_that_are_near() -> None:
    with pytest.raises(LinearisationRefusedError, match="did you mean solver.kind"):
        model_ss(SENSOR, 0.002, {"solver.kin": "gyro"})
    with pytest.raises(LinearisationRefusedError, match="levelling, gyro, fused"):
        model_ss(SENSOR, 0.002, {"solver.kind": "gyros"})
    with pytest.raises(LinearisationRefusedError, match="no FMU called"):
        model_ss("Turbine", 0.002)


def test_the_gauss_seidel_master_has_one_delay_less_and_each_further_one_adds_a_step() -> None:
    steps = [model_ss(PROBE, 1.0, inputs="level", coupling_delay=delay) for delay in range(4)]
    responses = [control.impulse_response(system, 12).outputs[:10] for system in steps]
    for less, more in pairwise(responses):
        np.testing.assert_allclose(more[1:], less[:-1], atol=1e-15)
    assert steps[0].D[0, 0] == pytest.approx(1.0 - 0.8**4)
    assert steps[3].state_labels[-2:] == ["level.before[2]", "level.before[1]"]


def test_models_connected_with_each_other_need_no_further_delay() -> None:
    """The Jacobi master's run of two probes in a row is the series of their linear models."""
    system = model_ss(PROBE, 1.0, {"step": 1e-9}, inputs="level")
    series = control.series(system, system)
    first, second = (_started(operating_point(PROBE, 1.0, {"step": 1e-9})) for _ in range(2))
    seen = []
    for k in range(1, 9):
        held = first.outputs().value.reading
        first.advance(first.model.Inputs(1.0, 0.0), float(k))
        second.advance(second.model.Inputs(held, 0.0), float(k))
        seen.append(second.outputs().value.reading)
    expected = control.forced_response(series, np.arange(9.0), np.ones(9)).outputs[1:]
    np.testing.assert_allclose(seen, expected, atol=3e-9)  # two quantisers of 1e-9


def _started(point: OperatingPoint) -> Run:
    """A run of the model at the operating point, at t = 0."""
    run = Run(point.model, point.parameters, point.inputs)
    run.state = point.state
    return run


@contextmanager
def rounding_passed() -> Iterator[None]:
    """The real model without its quantisers."""
    with (
        mock.patch.object(quantiser, "round_half_up", lambda x: x),
        mock.patch.object(digital_filter, "round_half_up", lambda x: x),
        mock.patch.object(words, "round_half_up", lambda x: x),
    ):
        yield


def response_of_the_model(point: OperatingPoint, place: int, size: float, steps: int) -> Any:
    """Half the difference of two runs of the model itself, an input moved up and down by `size`; per unit of it."""
    seen = []
    for sign in (1.0, -1.0):
        values = flatten(point.inputs)
        values[place] += sign * size
        moved = unflatten(point.model.Inputs, values)
        run = _started(point)
        with rounding_passed():
            shown = []
            for k in range(1, steps + 1):
                run.advance(moved, k * point.dt)
                shown.append([float(value) for value in flatten(run.outputs())])
        seen.append(shown)
    return (np.array(seen[0]) - np.array(seen[1])) / (2.0 * size)


@pytest.mark.parametrize(
    ("name", "dt", "parameters", "where", "size", "allowed"),
    [
        (SENSOR, 0.002, SILENT | {"solver.kind": "gyro"}, {}, 1e-5, 1e-9),
        (SENSOR, 0.002, SILENT, {}, 1e-5, 1e-6),  # the fused solver's gains have not quite settled
        ("TripodGimbal", 0.001, SMOOTH, {"hold": {"joint": 0.0}, "free": "motor_torque"}, 3e-6, 1e-9),
        ("GimbalController", 0.001, {}, {"inputs": {"attitude_valid": 1.0}}, 1e-3, 1e-9),
    ],
)
def test_linear_response_is_that_of_the_model_itself(
    name: str, dt: float, parameters: Mapping[str, Any], where: Mapping[str, Any], size: float, allowed: float
) -> None:
    """To 1e-9 of the largest: what third derivatives (they go with the size's square) and rounding (with its inverse)
    leave in the difference of two runs."""
    point = operating_point(name, dt, parameters, **where)
    system = model_ss(name, dt, operating_point=point, allow_unstable=True)
    steps = 40
    time = np.arange(steps + 1) * dt
    inputs = [leaf.replace(".", "_") for leaf in _names(point.model.Inputs)]
    outputs = [_names(point.model.Outputs).index(_dotted(point, label)) for label in system.output_labels]
    for number, label in enumerate(system.input_labels):
        u = np.zeros((system.ninputs, steps + 1))
        u[number] = 1.0
        linear = control.forced_response(system, time, u).outputs.T[1:]
        real = response_of_the_model(point, inputs.index(label), size, steps)[:, outputs]
        error = np.abs(real - np.asarray(linear)).max(axis=0) / np.abs(linear).max()
        assert error.max() < allowed, (label, system.output_labels[int(error.argmax())], error.max())


def test_with_dry_friction_the_model_comes_nearer_to_the_linear_one_as_the_torque_shrinks() -> None:
    """At rest |w| z of the bristle is of second order and has a kink: the error goes with the size, not its square."""
    point = operating_point("TripodGimbal", 0.001, CALM, hold={"joint": 0.0}, free="motor_torque")
    system = model_ss("TripodGimbal", 0.001, operating_point=point, inputs="motor_torque.roll", outputs="rate[2]")
    steps, place = 20, _names(point.model.Outputs).index("rate[2]")
    linear = np.squeeze(control.forced_response(system, np.arange(steps + 1) * 0.001, np.ones(steps + 1)).outputs)[1:]
    errors = [
        np.abs(response_of_the_model(point, 2, size, steps)[:, place] - linear).max() / np.abs(linear).max()
        for size in (1e-4, 1e-5)
    ]
    assert errors[1] < 1e-3
    assert 5.0 < errors[0] / errors[1] < 20.0


def _names(record: type) -> list[str]:
    return [leaf.name for leaf in leaves(record)]


def _dotted(point: OperatingPoint, label: str) -> str:
    return next(name for name in _names(point.model.Outputs) if name.replace(".", "_") == label)


def test_states_keep_their_fmi_names_and_idle_ones_are_left_out() -> None:
    system = model_ss(SENSOR, 0.002, inputs="rate", outputs="rate_measured[2]")
    assert system.input_labels == ["rate[1]", "rate[2]", "rate[3]"]
    assert set(system.state_labels) == {
        "gyro[2].sensed",
        "gyro[2].windows.first",
        "gyro[2].windows.second",
        "gyro[2].windows.third",
        "reading.rate[2]",
    }
    assert model_ss(SENSOR, 0.002).nstates < 60  # of 1047


def phase_delay(system: Any, frequency: float) -> float:
    """Seconds by which the output is late, without the half sampling time of the held input."""
    z = np.exp(2j * np.pi * frequency * system.dt)
    return float(-np.angle(np.squeeze(system(z))) / (2.0 * np.pi * frequency) - 0.5 * system.dt)


def test_gyro_path_is_late_by_half_its_window() -> None:
    """ADXRS450: sinc^2 of 127 samples at 16 kHz, delay 63; a held input comes in over 8 samples, 3.5 of them lost."""
    system = model_ss(SENSOR, 0.002, inputs="rate[1]", outputs="rate_measured[1]")
    assert phase_delay(system, 1.0) == pytest.approx((63.0 + 0.5 + 3.5) / 16e3, rel=1e-4)


def test_accelerometer_path_is_late_by_its_sheets_delay_and_the_wait_for_the_processor() -> None:
    """ADXL355 at 500 Hz: 3.26 ms (Rev. D p. 26); its word is there 5 of 8 senses after the window's end, 0.75 ms before
    it is read; samples at the end of their 0.25 ms make a held input half as much older."""
    system = model_ss(SENSOR, 0.002, inputs="specific_force[1]", outputs="specific_force_measured[1]")
    assert phase_delay(system, 1.0) == pytest.approx(3.26e-3 + 0.75e-3 + 0.125e-3, rel=1e-3)


def test_a_running_sum_that_repeats_its_samples_is_left_out() -> None:
    """s' = s + u - x2, x1' = u, x2' = x1: s - x1 - x2 never changes, an integrator that nothing drives."""
    A = np.array([[1.0, 0.0, -1.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    B, C = np.array([[1.0], [1.0], [0.0]]), np.array([[0.5, 0.0, 0.0]])
    slim = without_sums(A, B, C)
    assert len(slim.states) == 2
    assert np.abs(np.linalg.eigvals(slim.A)).max() < 1e-7
    for k in range(5):
        before, after = (c @ np.linalg.matrix_power(a, k) @ b for a, b, c in ((A, B, C), slim[1:]))
        np.testing.assert_allclose(after, before, atol=1e-14)


def test_bartlett_filters_leave_no_pole_on_the_unit_circle() -> None:
    """ADIS16354, processor at its pace: 4 taps are late by 3 samples, the 350 Hz pole and a held input add the rest."""
    dt = 2.0 / 819.2
    system = model_ss(
        "AttitudeSensor_ADIS16354_150", dt, {"processor.period": dt}, inputs="rate[1]", outputs="rate_measured[1]"
    )
    assert max(abs(system.poles())) < 0.9
    assert phase_delay(system, 0.5) == pytest.approx(3.0 / 819.2 + 1.0 / (2.0 * np.pi * 350.0), abs=0.5 / 819.2)
