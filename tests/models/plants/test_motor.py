"""A motor's current and torque against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

from attitude_fmu.models.plants.motor import (
    DRIVE,
    Motor,
    MotorCommand,
    cogging_energy,
    cogging_torque,
    current_after,
    current_at_rest,
    motor_constants,
)

MOTOR = Motor()
R, L, K, U = MOTOR.resistance, MOTOR.inductance, MOTOR.torque_constant, MOTOR.voltage


def command(drive: str, torque: float = 0.0, voltage: float = 0.0) -> MotorCommand:
    return MotorCommand(DRIVE.value(drive), torque, voltage)


@pytest.mark.parametrize("half_step", [1e-5, 5e-4, 0.1])
def test_a_voltage_step_on_a_blocked_rotor(half_step: float) -> None:
    """i = U/R (1 - exp(-R t/L)), whatever the step."""
    c, current = motor_constants(MOTOR, half_step), 0.0
    for n in range(1, 6):
        current = current_after(MOTOR, c, command("voltage", voltage=5.0), current, 0.0)
        assert current == pytest.approx(5.0 / R * -math.expm1(-n * half_step * R / L), rel=1e-12)


def test_the_back_emf_lowers_the_current() -> None:
    c = motor_constants(MOTOR, 1.0)
    assert current_after(MOTOR, c, command("voltage", voltage=5.0), 0.0, 3.0) == pytest.approx((5.0 - K * 3.0) / R)
    assert current_after(MOTOR, c, command("voltage", voltage=99.0), 0.0, 3.0) == pytest.approx((U - K * 3.0) / R)


def test_the_splitting_is_of_second_order_against_the_closed_form() -> None:
    """L i' = u - R i - k w, J w' = k i by the matrix exponential."""
    inertia, voltage, end = 2e-3, 4.0, 0.02
    A = np.array([[-R / L, -K / L, voltage / L], [K / inertia, 0.0, 0.0], [0.0, 0.0, 0.0]])
    expected = (expm(A * end) @ [0.0, 0.0, 1.0])[1]
    errors = []
    for steps in (80, 160, 320):
        h, current, rate = end / steps, 0.0, 0.0
        c = motor_constants(MOTOR, 0.5 * h)
        for _ in range(steps):
            current = current_after(MOTOR, c, command("voltage", voltage=voltage), current, rate)
            rate += h * K * current / inertia
            current = current_after(MOTOR, c, command("voltage", voltage=voltage), current, rate)
        errors.append(abs(rate - expected))
    assert errors[2] < 1e-3 * expected
    assert math.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.1)


def test_the_current_loop_is_a_lag_of_its_bandwidth() -> None:
    """Within the voltage limit the back-EMF does not show."""
    half_step = 1e-4
    c, current = motor_constants(MOTOR, half_step), 0.0
    for n in range(1, 6):
        current = current_after(MOTOR, c, command("current", torque=0.05), current, 1.0)
        assert K * current == pytest.approx(0.05 * -math.expm1(-2.0 * math.pi * 500.0 * n * half_step), rel=1e-12)


@pytest.mark.parametrize("rate", [-20.0, 0.0, 20.0])
def test_the_current_loop_gets_no_more_than_the_voltage_gives(rate: float) -> None:
    c = motor_constants(MOTOR, 1e-4)
    for torque in (-50.0, 50.0):
        full = math.copysign(U, torque)
        loop = current_after(MOTOR, c, command("current", torque=torque), 0.1, rate)
        assert loop == pytest.approx(current_after(MOTOR, c, command("voltage", voltage=full), 0.1, rate))


def test_an_ideal_drive_is_the_command() -> None:
    c = motor_constants(MOTOR, 1e-4)
    assert K * current_after(MOTOR, c, command("ideal", torque=7.0), 0.0, 20.0) == pytest.approx(7.0)


@pytest.mark.parametrize("drive", ["ideal", "current", "voltage"])
def test_the_current_at_rest_stays(drive: str) -> None:
    told = command(drive, torque=0.1, voltage=2.0)
    current = current_at_rest(MOTOR, told)
    assert current > 0.0
    assert current_after(MOTOR, motor_constants(MOTOR, 5e-4), told, current, 0.0) == pytest.approx(current, rel=1e-15)


def test_cogging_has_its_positions_and_its_share_of_the_stall_torque() -> None:
    amplitude = motor_constants(MOTOR, 5e-4).cogging
    assert amplitude == pytest.approx(0.01 * K * U / R)
    angles = np.linspace(0.0, 2.0 * math.pi, 8400, endpoint=False)
    torques = np.array([cogging_torque(amplitude, 84.0, angle) for angle in angles])
    assert np.argmax(np.abs(np.fft.rfft(torques))) == 84
    assert torques.max() == pytest.approx(amplitude, rel=1e-3)


@pytest.mark.parametrize("angle", [-1.3, 0.0, 0.011, 2.0])
def test_cogging_torque_is_the_slope_of_its_energy(angle: float) -> None:
    d = 1e-6
    slope = (cogging_energy(0.02, 84.0, angle + d) - cogging_energy(0.02, 84.0, angle - d)) / (2.0 * d)
    assert cogging_torque(0.02, 84.0, angle) == pytest.approx(-slope, abs=1e-8)
    assert cogging_energy(0.02, 0.0, angle) == 0.0
