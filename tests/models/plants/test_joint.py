"""Cables and end stops of a joint."""

from __future__ import annotations

import math

import pytest

from attitude_fmu.models.plants.friction import Friction, lugre
from attitude_fmu.models.plants.joint import Cable, EndStop, JointParts, joint_energy, joint_torque, stop_torque

NO_FRICTION = lugre(Friction(coulomb=0.0, viscous=0.0), 3e-3)
STOP = EndStop(-0.5, 0.8, stiffness=50.0, loss=0.3)


@pytest.mark.parametrize("angle", [-0.6, -0.5, 0.0, 0.8, 0.81])
@pytest.mark.parametrize("rate", [-20.0, -1.0, 0.0, 1.0, 20.0])
def test_a_stop_only_pushes(angle: float, rate: float) -> None:
    torque = stop_torque(STOP, angle, rate)
    if -0.5 <= angle <= 0.8:
        assert torque == 0.0
    elif angle < 0.0:
        assert torque >= 0.0
    else:
        assert torque <= 0.0


def test_a_stop_is_a_spring_at_rest_and_harder_when_hit() -> None:
    assert stop_torque(STOP, 0.81, 0.0) == pytest.approx(-0.5)
    assert stop_torque(STOP, 0.81, 2.0) == pytest.approx(-0.5 * 1.6)
    assert stop_torque(STOP, 0.81, -2.0) == pytest.approx(-0.5 * 0.4)
    assert stop_torque(STOP, 0.81, -20.0) == 0.0
    assert stop_torque(STOP, -0.51, -2.0) == pytest.approx(0.5 * 1.6)


@pytest.mark.parametrize("rate", [0.3, 3.0, 10.0])
def test_the_rebound_follows_the_closed_form(rate: float) -> None:
    """v dv/dd = -(k/J) d (1 + chi v): chi v - ln(1 + chi v) is the same before and, with -v, after."""
    inertia, steps = 5e-3, 40_000
    h = 2.0 * math.pi * math.sqrt(inertia / STOP.stiffness) / steps
    angle, v = 0.8, rate
    while angle >= 0.8:  # midpoint rule
        half = angle + 0.5 * h * v, v + 0.5 * h * stop_torque(STOP, angle, v) / inertia
        angle, v = angle + h * half[1], v + h * stop_torque(STOP, *half) / inertia
    before, after = STOP.loss * rate, STOP.loss * -v
    assert -after - math.log(1.0 - after) == pytest.approx(before - math.log(1.0 + before), rel=1e-3)
    assert -v < rate


@pytest.mark.parametrize("angle", [-0.7, -0.4, 0.3, 0.9])
def test_torque_at_rest_is_the_slope_of_the_energy(angle: float) -> None:
    parts = JointParts(NO_FRICTION, Cable(0.01, 0.0, 0.2), STOP, 0.02, 84.0)
    d = 1e-6
    slope = (joint_energy(parts, angle + d) - joint_energy(parts, angle - d)) / (2.0 * d)
    assert joint_torque(parts, 0.0, angle, 0.0) == pytest.approx(-slope, abs=1e-7)


def test_a_cable_pulls_towards_its_neutral_angle_and_brakes() -> None:
    parts = JointParts(NO_FRICTION, Cable(0.01, 1e-3, 0.2), STOP, 0.0, 84.0)
    assert joint_torque(parts, 0.0, 0.5, 0.0) == pytest.approx(-3e-3)
    assert joint_torque(parts, 0.0, 0.2, 2.0) == pytest.approx(-2e-3)
