"""The stabilised head's loop, its designs and its delays, on a head without wind: one linearisation instead of nine."""

from __future__ import annotations

from itertools import product

import control
import numpy as np
import pytest

from attitude_fmu.cosim.control import head_lqg, head_pid
from attitude_fmu.cosim.control.delays import delay_budget, register_response
from attitude_fmu.cosim.control.head_models import (
    AXES,
    BODY_RATES,
    JOINT,
    Friction,
    clocks_of,
    moving_friction,
    plant_model,
    sensor_model,
)
from attitude_fmu.cosim.control.stabilised_head import (
    CAUSES,
    Controller,
    Head,
    Loop,
    closed_loop,
    grid,
    head_of,
    line_of_sight,
    radius,
)
from attitude_fmu.cosim.errors import LinearisationRefusedError

SENSOR = "AttitudeSensor_ADXRS450_ADXL355"
PIDS = [head_pid.Pid(2e-3, 90.0, 12.0, 0.3, 3.0)] * 3


@pytest.fixture(scope="module")
def friction() -> Friction:
    clocks = clocks_of(SENSOR, {})
    f = grid(clocks)
    swinging = np.where((f > 3.0) & (f < 9.0), (3e-4) ** 2 / 6.0, 0.0)[:, None] * np.ones(3)
    return moving_friction(plant_model(clocks, {"wind.speed": 0.0}).point, f, swinging)


@pytest.fixture(scope="module")
def head(friction: Friction) -> Head:
    clocks = clocks_of(SENSOR, {})
    plant = plant_model(clocks, {"wind.speed": 0.0, **friction.parameters})
    return head_of(plant, sensor_model(SENSOR, clocks, {}, plant.point), clocks, friction)


@pytest.fixture(scope="module")
def controller(head: Head) -> Controller:
    sizes = head_pid.inertias(head)
    return head_pid.pid_controller([one._replace(inertia=J) for one, J in zip(PIDS, sizes, strict=True)], 0.002)


@pytest.fixture(scope="module")
def loop(head: Head, controller: Controller) -> Loop:
    return closed_loop(head, controller)


def test_poles_and_responses_are_those_of_python_controls_feedback(
    head: Head, loop: Loop, controller: Controller
) -> None:
    p, s = head.plant.mean.system, head.sensor.noise.system
    dt = head.clocks.period
    plant = control.ss(p.A, p.B, p.C, 0.0, dt, remove_useless_states=False)
    sensor = control.ss(s.A, s.B, s.C, 0.0, dt, remove_useless_states=False)
    K = control.ss(*controller[:4], dt, remove_useless_states=False)
    # the sensor reads the newest motion: one step earlier than a strictly proper system would
    z = np.exp(2j * np.pi * head.frequencies[::90] * dt)
    P, S, C = (np.moveaxis(one(z, squeeze=False), 2, 0) for one in (plant, sensor, K))
    read = z[:, None, None] * S @ P[:, :6]
    seen = np.concatenate([read, P[:, JOINT]], axis=1)
    by_torque = P[:, 12:15] @ np.linalg.inv(np.eye(3) - C @ seen)
    scale = np.abs(by_torque).max(axis=(1, 2), keepdims=True)
    assert np.allclose(loop.responses.by_torque[::90] / scale, by_torque / scale, atol=1e-6)


def test_stable_loop_decays_and_a_turned_one_does_not(head: Head, controller: Controller) -> None:
    assert radius(head, controller) < 1.0
    turned = controller._replace(C=-controller.C, D=-controller.D)
    assert radius(head, turned) > 1.0


def test_nyquist_agrees_with_the_poles(head: Head, controller: Controller, loop: Loop) -> None:
    gain = min(margin.gain_up for margin in loop.margins)
    axis = int(np.argmin([margin.gain_up for margin in loop.margins]))
    found = []
    for factor in (0.97 * gain, 1.03 * gain):
        size = np.ones((3, 1))
        size[axis] = factor
        found.append(radius(head, controller._replace(C=size * controller.C, D=size * controller.D)))
    assert found[0] < 1.0 < found[1]


def test_all_loops_at_once_stand_the_gains_of_the_disk_margin(head: Head, controller: Controller, loop: Loop) -> None:
    from attitude_fmu.cosim.control.margins import gain_of

    inside = gain_of(0.99 * float(loop.disk.min()))
    for signs in product((-1.0, 1.0), repeat=3):
        size = inside ** np.array(signs)[:, None]
        assert radius(head, controller._replace(C=size * controller.C, D=size * controller.D)) < 1.0


def test_disk_margin_lies_within_each_margin_of_one_loop(loop: Loop) -> None:
    from attitude_fmu.cosim.control.margins import gain_of, phase_of

    alpha = float(loop.disk.min())
    assert all(gain_of(alpha) <= 1.001 * margin.gain_up for margin in loop.margins)
    assert all(phase_of(alpha) <= 1.001 * margin.phase for margin in loop.margins)


def test_causes_add_up_to_the_jitter(loop: Loop) -> None:
    assert tuple(loop.spectra) == CAUSES
    squares = sum(loop.jitter(cause) ** 2 for cause in CAUSES)
    assert np.allclose(squares, loop.jitter() ** 2, rtol=1e-12)
    assert line_of_sight(np.array([3.0, 4.0, 99.0])) == 5.0
    # no wind; a PID that reads no accelerometer
    assert (loop.jitter("wind") == 0.0).all()
    assert (loop.jitter("accelerometer noise") == 0.0).all()


def test_thinned_head_tells_the_same_jitter(head: Head, loop: Loop, controller: Controller) -> None:
    # a third of the frequencies costs a few parts in a hundred, where peaks are narrow
    assert np.allclose(closed_loop(head.thinned(3), controller).jitter(), loop.jitter(), rtol=0.05)


def test_delays_add_up_to_the_phase_of_the_whole_way(head: Head) -> None:
    f, crossover, axis = head.frequencies, 30.0, AXES.index("pitch")
    register = register_response(head.sensor, head.clocks, {}, f)
    budget = delay_budget(head, axis, crossover, register)
    element, sign = BODY_RATES[axis]
    # gyro by torque, of a free inertia: -1/s at the crossover, a quarter of a turn
    way = sign * head.readings[:, element, element] * head.mean.torque[:, JOINT.start + axis, axis]
    at = np.interp(crossover, f, way.real) + 1j * np.interp(crossover, f, way.imag)
    together = sum(one.phase for one in budget)
    # interpolation of two products instead of one
    assert np.exp(-1j * together) == pytest.approx(-at / abs(at), abs=1e-3)
    for one in budget:
        assert one.seconds == pytest.approx(one.phase / (2.0 * np.pi * crossover))


def test_held_torque_costs_half_a_period_and_the_gyro_its_filter_and_word(head: Head) -> None:
    register = register_response(head.sensor, head.clocks, {}, head.frequencies)
    parts = {one.part: one.seconds for one in delay_budget(head, 1, 30.0, register)}
    assert parts["torque held between ticks"] == pytest.approx(0.5 * head.clocks.period)
    # 80 Hz low-pass of second order and more: 1/(pi 80 Hz) = 4 ms at most, half of it at least
    assert 2e-3 < parts["gyro: filter and word"] < 4e-3


def test_ideal_sensor_has_no_register(head: Head) -> None:
    clocks = clocks_of("AttitudeSensor", {"ideal": True})
    f = np.array([1.0, 30.0])
    ideal = sensor_model("AttitudeSensor", clocks, {"ideal": True}, head.plant.point)
    assert np.array_equal(register_response(ideal, clocks, {"ideal": True}, f)[:, 0, 0], np.ones(2))


def test_designed_pid_has_the_peak_asked_for(head: Head, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(head_pid, "_CROSSOVERS", (8.0, 12.0))
    monkeypatch.setattr(head_pid, "_BLENDS", (3.0,))
    monkeypatch.setattr(head_pid, "_SLOW", (0.3,))
    designed = closed_loop(head, head_pid.pid_controller(head_pid.pid_design(head), head.clocks.period))
    assert designed.radius < 1.0
    # axes are chosen one after the other: a later one moves those before by little
    assert all(margin.peak < 1.1 * head_pid.PEAK for margin in designed.margins)


def test_no_pid_is_refused_with_what_to_do(head: Head, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(head_pid, "_CROSSOVERS", (300.0,))
    monkeypatch.setattr(head_pid, "_BLENDS", (3.0,))
    with pytest.raises(LinearisationRefusedError, match=r"no PID of yaw .* choose one with less delay"):
        head_pid.pid_design(head)


def test_reduced_lqg_has_the_margin_and_costs_two_per_cent(
    head: Head, friction: Friction, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(head_lqg, "_ORDERS", range(30, 71, 10))
    designed = head_lqg.lqg_design(head, friction)
    assert designed.loop.disk.min() >= head_lqg.DISK
    assert designed.loop.radius < 1.0
    assert len(designed.controller.A) < len(head.plant.mean.system.A) + len(head.sensor.noise.system.A)
    assert line_of_sight(designed.loop.jitter()) < 1.02 * line_of_sight(designed.whole.jitter())


def test_no_lqg_is_refused_with_the_best_that_there_is(
    head: Head, friction: Friction, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(head_lqg, "DISK", 1.99)
    monkeypatch.setattr(head_lqg, "TORQUES", (1e-3,))
    with pytest.raises(LinearisationRefusedError, match=r"no LQG has a disk margin of 1\.99, the best has 0\.\d+: .*"):
        head_lqg.lqg_design(head, friction)
