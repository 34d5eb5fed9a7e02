"""The controller alone, and in closed loop with the plant and ideal measurements."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from attitude_fmu.models import gimbal_controller as control
from attitude_fmu.models import tripod_gimbal as plant
from attitude_fmu.models.attitude.rotations import Euler, matrix_from_euler
from attitude_fmu.models.gimbal_controller import MODE, Inputs, Parameters, State, body_from_euler, joint_from_body
from attitude_fmu.models.plants.gimbal import Axes
from attitude_fmu.models.record import defaults
from attitude_fmu.models.system import Run

DEFAULT: Parameters = defaults(Parameters)
HOLD = DEFAULT._replace(mode=MODE.value("hold_joints"))
OFF = DEFAULT._replace(mode=MODE.value("off"))
LEVEL = Euler(0.0, 0.0, 0.0)
NO_AXES = Axes(0.0, 0.0, 0.0)
PLANT: plant.Parameters = defaults(plant.Parameters)
CALM = PLANT._replace(
    wind=PLANT.wind._replace(speed=0.0), shutter=PLANT.shutter._replace(impulse=NO_AXES), initial=plant.Initial()
)
STEP = 1e-3


def along(axis: int, size: float) -> Axes:
    return Axes(*[size if i == axis else 0.0 for i in range(3)])


def run_of(p: Parameters, inputs: Inputs | None = None) -> Run:
    return Run(control.MODEL, p, inputs or Inputs())


def after(run: Run, inputs: Inputs, steps: int = 1) -> control.Outputs:
    state: State = run.state
    run.advance(inputs, (round(state.ticks) + steps) * STEP)
    out: control.Outputs = run.outputs()
    return out


def measured(out: plant.Outputs, valid: bool, setpoint: Axes = NO_AXES) -> Inputs:
    return Inputs(out.euler, out.rate, valid, out.joint, out.joint_rate, setpoint)


class Loop:
    """Plant and controller, one communication step apart."""

    def __init__(self, p: plant.Parameters, c: Parameters) -> None:
        self.plant = Run(plant.MODEL, p, plant.Inputs())
        self.control = Run(control.MODEL, c, Inputs())
        self.steps = 0

    def run(self, seconds: float, valid: bool = True, setpoint: Axes = NO_AXES) -> list[plant.Outputs]:
        shown = []
        for _ in range(round(seconds / STEP)):
            self.steps += 1
            inputs = measured(self.plant.outputs(), valid, setpoint)
            torque = plant.Inputs(self.control.outputs().motor_torque)
            self.plant.advance(torque, self.steps * STEP)
            self.control.advance(inputs, self.steps * STEP)
            shown.append(self.plant.outputs())
        return shown


def test_off_gives_no_torque() -> None:
    inputs = Inputs(Euler(0.1, 0.2, 0.3), (1.0, 1.0, 1.0), True, Axes(1.0, 1.0, 1.0), Axes(1.0, 1.0, 1.0))
    out = after(run_of(OFF), inputs, 10)
    assert out.motor_torque == NO_AXES
    assert (out.status, out.saturated) == (1, False)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_held_joints_are_springs_and_dampers(axis: int) -> None:
    """J (2 pi f)^2 per radian, 2 zeta J 2 pi f per rad/s, against the first angle seen."""
    p = HOLD._replace(hold=HOLD.hold._replace(integral=0.0))
    run = run_of(p)
    first = Axes(0.3, -0.2, 0.1)
    assert after(run, Inputs(joint=first)).motor_torque == NO_AXES
    moved = Axes(*[a + b for a, b in zip(first, along(axis, 1e-3), strict=True)])
    w = 2.0 * math.pi * p.hold.frequency
    stiffness = p.inertia[axis] * w * w
    out = after(run, Inputs(joint=moved))
    assert out.motor_torque[axis] == pytest.approx(-1e-3 * stiffness)
    assert out.status == 2
    out = after(run, Inputs(joint=first, joint_rate=along(axis, 0.01)))
    assert out.motor_torque[axis] == pytest.approx(-0.01 * 2.0 * p.hold.damping_ratio * p.inertia[axis] * w)


@pytest.mark.parametrize("seed", range(5))
def test_euler_differences_become_body_turns_and_back(seed: int) -> None:
    rng = np.random.default_rng(seed)
    euler, small = rng.uniform(-1.2, 1.2, 3), 1e-7 * rng.standard_normal(3)

    def attitude(e: np.ndarray) -> Rotation:
        return Rotation.from_matrix(matrix_from_euler(Euler(*e)))

    turn = (attitude(euler).inv() * attitude(euler + small)).as_rotvec()
    body = body_from_euler(Axes(*small), Euler(*euler))
    np.testing.assert_allclose(body, turn, atol=1e-13)
    np.testing.assert_allclose(joint_from_body(body, Axes(*euler)), small, rtol=1e-12, atol=1e-20)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_an_attitude_error_is_driven_back(axis: int) -> None:
    run = run_of(DEFAULT)
    after(run, Inputs(attitude_valid=True))
    out = after(run, Inputs(euler=Euler(*along(axis, 0.01)), attitude_valid=True))
    assert out.motor_torque[axis] < 0.0
    assert all(out.motor_torque[i] == pytest.approx(0.0, abs=1e-4) for i in range(3) if i != axis)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_body_rate_is_braked(axis: int) -> None:
    """Yaw is about -z, pitch about x, roll about y."""
    run = run_of(DEFAULT)
    rate = ((0.0, 0.0, -0.1), (0.1, 0.0, 0.0), (0.0, 0.1, 0.0))[axis]
    inputs = Inputs(rate=rate, joint_rate=along(axis, 0.1), attitude_valid=True)
    assert after(run, inputs, 50).motor_torque[axis] < 0.0


def test_engagement_is_bumpless() -> None:
    """No jump of the torque where the attitude becomes valid, or is lost, whatever the loops say at that moment."""
    run = run_of(DEFAULT)
    held = Inputs(joint=Axes(0.1, 0.1, 0.1))
    after(run, held)
    tilted = Inputs(Euler(1.0, 0.2, -0.3), (0.001, -0.002, 0.003), False, Axes(0.1004, 0.0998, 0.1003))
    before = after(run, tilted, 20).motor_torque
    engaged = after(run, tilted._replace(attitude_valid=True))
    assert engaged.status == 3
    np.testing.assert_allclose(engaged.motor_torque, before, atol=2e-4)  # one tick of the integrals
    lost = after(run, tilted)
    assert lost.status == 2
    np.testing.assert_allclose(lost.motor_torque, engaged.motor_torque, atol=2e-4)


def test_torque_is_limited_and_the_integral_does_not_wind_up() -> None:
    p = HOLD._replace(torque_limit=Axes(0.1, 0.1, 0.1), hold=HOLD.hold._replace(integral=2.0))
    run = run_of(p)
    after(run, Inputs())
    out = after(run, Inputs(joint=Axes(0.5, 0.5, 0.5)), 2000)
    assert out.motor_torque == Axes(-0.1, -0.1, -0.1)
    assert out.saturated
    state: State = run.state
    assert state.integral == NO_AXES
    assert after(run, Inputs(), 1).motor_torque == pytest.approx(NO_AXES, abs=1e-12)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_stabilised_camera_follows_the_setpoint(axis: int) -> None:
    loop = Loop(CALM, DEFAULT)
    loop.run(0.2)
    start = loop.plant.outputs().euler
    end = loop.run(2.5, setpoint=along(axis, 0.1))[-1]
    for i in range(3):
        assert end.euler[i] - start[i] == pytest.approx(0.1 if i == axis else 0.0, abs=2e-4)


def test_it_converges_from_a_tilted_gimbal() -> None:
    p = CALM._replace(initial=plant.Initial(0.4, Axes(0.6, 0.5, -0.4)))
    loop = Loop(p, DEFAULT)
    loop.run(0.2)
    start = loop.plant.outputs().euler
    end = loop.run(3.0, setpoint=Axes(0.2, -0.1, 0.15))[-1].euler
    np.testing.assert_allclose(np.array(end) - start, (0.2, -0.1, 0.15), atol=5e-4)


def test_nothing_hunts_in_a_calm() -> None:
    """Integral and static friction do not make a limit cycle."""
    loop = Loop(CALM, DEFAULT)
    loop.run(6.0)
    yaw, pitch, roll = np.array([out.euler for out in loop.run(1.0)]).T
    assert max(np.ptp(yaw), np.ptp(pitch), np.ptp(roll)) < 5e-6


def test_joints_are_held_until_the_attitude_is_valid() -> None:
    loop = Loop(CALM, DEFAULT)
    shown = loop.run(0.5, valid=False)
    assert loop.control.outputs().status == 2
    assert np.abs([out.joint for out in shown]).max() < 1e-3
    loop.run(STEP)
    assert loop.control.outputs().status == 3


def test_stabilised_line_of_sight_is_quieter_in_wind() -> None:
    """With ideal measurements, the same wind; yaw and pitch move the line of sight."""
    jitter = {}
    for name, p in (("held", HOLD), ("stabilised", DEFAULT)):
        loop = Loop(PLANT, p)
        loop.run(1.0)
        yaw, pitch, _ = np.array([out.euler for out in loop.run(4.0)]).T
        jitter[name] = math.hypot(float(np.std(yaw)), float(np.std(pitch)))
    assert 50e-6 < jitter["held"] < 500e-6
    assert jitter["stabilised"] < 0.8 * jitter["held"]
