"""A brushless gimbal motor and its driver, as the equal direct-current motor.

    L i' = u - R i - k w,   |u| <= U,   T = k i

The driver sets the voltage: as told, or such that the current follows a torque command as a first-order lag,
i' = w_c (T_c/k - i), as far as the voltage allows. Cogging: T = -A sin(N angle), N positions at rest in a turn.
Source of the motor equations: olliw.eu, "Brushless motor modelling".
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Enumeration, Item, Real
from ..scalar import PI, Scalar, clip, cos, exp, sin, where

DRIVE = Enumeration(
    "MotorDrive",
    (
        Item("ideal", "the motor's torque is the command, at once and without limit"),
        Item("current", "the driver's current loop follows the torque command"),
        Item("voltage", "the motor's voltage is the input"),
    ),
    "what drives the motors",
)


class Motor(NamedTuple):
    """One joint's motor and driver. Defaults: GM8112-80T, 4.2 ohm, 17.2 rpm/V [S SimpleFOC forum 4252]."""

    resistance: Annotated[float, Real("Ohm", "of the winding, line to line", 1e-3, 1e3)] = 4.2
    inductance: Annotated[float, Real("H", "of the winding", 1e-6, 1.0, None, 1e-3)] = 1.4e-3  # L/R as measured on a
    # GBM2804, 2.0 mH / 6.3 ohm [S SimpleFOC forum 6842]; that of this motor is an assumption
    torque_constant: Annotated[float, Real("N.m/A", "torque per current, back-EMF per rate", 1e-4, 100.0)] = (
        0.48  # 8.27/(17.2 rpm/V), sinusoidal back-EMF
    )
    voltage: Annotated[float, Real("V", "largest that the driver gives", 0.0, 1e3)] = 12.0  # three cells, assumption
    bandwidth: Annotated[float, Real("Hz", "of the driver's current loop", 1.0, 1e5)] = 500.0  # assumption
    cogging: Annotated[float, Real("1", "cogging torque over stall torque k U/R", 0.0, 1.0)] = 0.01  # 1..3 %, judgement
    cogging_positions: Annotated[float, Real("1", "positions at rest in a turn", 0.0, 1e4)] = (
        84.0  # 12 slots, 14 poles: their least common multiple
    )


class MotorConstants(NamedTuple):
    """What half a solver step needs."""

    electrical: Annotated[float, Real("1", "current left after half a step, exp(-R h/2L)")]
    loop: Annotated[float, Real("1", "current error left after half a step, exp(-w_c h/2)")]
    cogging: Annotated[float, Real("N.m", "amplitude of the cogging torque")]


def motor_constants(motor: Motor, half_step: Scalar) -> MotorConstants:
    """Decay factors over half a solver step (s), cogging amplitude."""
    return MotorConstants(
        electrical=exp(-half_step * motor.resistance / motor.inductance),
        loop=exp(-2.0 * PI * motor.bandwidth * half_step),
        cogging=motor.cogging * motor.torque_constant * motor.voltage / motor.resistance,
    )


class MotorCommand(NamedTuple):
    """What the driver is told."""

    drive: Scalar  # of `DRIVE`
    torque: Scalar  # N.m
    voltage: Scalar  # V


def _settled(motor: Motor, voltage: Scalar, rate: Scalar) -> Scalar:
    """(u - k w)/R, A."""
    return (voltage - motor.torque_constant * rate) / motor.resistance


def current_at_rest(motor: Motor, command: MotorCommand) -> Scalar:
    """The current (A) that a command ends at on a standing joint."""
    wanted = command.torque / motor.torque_constant
    limit = motor.voltage / motor.resistance
    driven = where(command.drive == DRIVE.value("current"), wanted, command.voltage / motor.resistance)
    return where(command.drive == DRIVE.value("ideal"), wanted, clip(driven, -limit, limit))


def current_after(motor: Motor, c: MotorConstants, command: MotorCommand, current: Scalar, rate: Scalar) -> Scalar:
    """The current (A) half a solver step later, at a constant joint rate (rad/s).

    Exact where the voltage limit binds all the time or never; stable for any step.
    """

    def at(voltage: Scalar) -> Scalar:
        settled = _settled(motor, voltage, rate)
        return settled + (current - settled) * c.electrical

    most = motor.voltage
    lowest, highest = at(-most), at(most)
    wanted = command.torque / motor.torque_constant
    followed = clip(wanted + (current - wanted) * c.loop, lowest, highest)
    told = at(clip(command.voltage, -most, most))
    driven = where(command.drive == DRIVE.value("current"), followed, told)
    return where(command.drive == DRIVE.value("ideal"), wanted, driven)


def cogging_torque(amplitude: Scalar, positions: Scalar, angle: Scalar) -> Scalar:
    """-A sin(N angle), N.m."""
    return -amplitude * sin(positions * angle)


def cogging_energy(amplitude: Scalar, positions: Scalar, angle: Scalar) -> Scalar:
    """A (1 - cos(N angle))/N, J."""
    turning = positions > 0.0
    return where(turning, amplitude * (1.0 - cos(positions * angle)) / where(turning, positions, 1.0), 0.0)
