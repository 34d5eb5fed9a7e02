"""The plant: energy, order, modes, sensors' truth, disturbances."""

from __future__ import annotations

import itertools
import math
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from attitude_fmu.models import tripod_gimbal as plant
from attitude_fmu.models.attitude.rotations import (
    EARTH_RATE,
    Euler,
    matrix_from_euler,
    matrix_from_quaternion,
    matrix_from_turns,
    turns_of,
)
from attitude_fmu.models.errors import ValueRefusedError
from attitude_fmu.models.plants.friction import Friction
from attitude_fmu.models.plants.gimbal import Axes, Body, first_moment, mass_matrix
from attitude_fmu.models.plants.joint import Cable, EndStop
from attitude_fmu.models.plants.motor import DRIVE, Motor
from attitude_fmu.models.plants.rig import coupling
from attitude_fmu.models.plants.tripod import attitude
from attitude_fmu.models.plants.wind import wind_force
from attitude_fmu.models.record import defaults, flatten, leaves, unflatten
from attitude_fmu.models.system import Run
from attitude_fmu.models.tripod_gimbal import (
    Initial,
    Inputs,
    JointCables,
    JointFriction,
    JointMotors,
    JointStops,
    Outputs,
    Parameters,
    State,
)

NO_TORQUE = Axes(0.0, 0.0, 0.0)
NONE = Friction(coulomb=0.0, viscous=0.0)
DEFAULT: Parameters = defaults(Parameters)
SLACK = Cable(stiffness=0.0, damping=0.0)
FREE = EndStop(stiffness=0.0)
SMOOTH = Motor(cogging=0.0)
QUIET = DEFAULT._replace(
    friction=JointFriction(NONE, NONE, NONE),
    cable=JointCables(SLACK, SLACK, SLACK),
    stop=JointStops(FREE, FREE, FREE),
    motor=JointMotors(SMOOTH, SMOOTH, SMOOTH),
    drive=DRIVE.value("ideal"),
    wind=DEFAULT.wind._replace(speed=0.0),
    shutter=DEFAULT.shutter._replace(impulse=Axes(0.0, 0.0, 0.0)),
    tripod=DEFAULT.tripod._replace(damping_ratio=Axes(0.0, 0.0, 0.0)),
    head=DEFAULT.head._replace(damping_ratio=Axes(0.0, 0.0, 0.0)),
)
"""Nothing that gives or takes energy."""

_SPRUNG = Cable(stiffness=0.02, damping=0.0, neutral=0.1)
VIGOROUS = QUIET._replace(
    cable=JointCables(_SPRUNG, _SPRUNG, _SPRUNG),
    motor=JointMotors(Motor(), Motor(), Motor()),
    head=QUIET.head._replace(stiffness=Axes(500.0, 500.0, 500.0), inertia=Axes(0.02, 0.02, 0.02)),
    yaw_frame=Body(0.4, (0.01, 0.02, -0.06), (2e-3, 1.5e-3, 1e-3), (2e-4, -1e-4, 1e-4)),
    pitch_frame=Body(0.3, (0.01, -0.01, 0.005), (1e-3, 0.8e-3, 1.2e-3), (1e-4, 1e-4, -1e-4)),
    camera=Body(1.2, (0.01, 0.02, -0.015), (4.6e-3, 2.3e-3, 5.7e-3), (4e-4, 3e-4, -5e-4)),
    initial=Initial(0.3, Axes(0.5, 0.4, -0.6), Axes(4.0, -3.0, 6.0)),
)
"""Far out of balance and fast, so that every coupling matters."""

BALANCED = QUIET._replace(
    yaw_frame=Body(0.35, (0.0, 0.0, 0.0), (1.5e-3, 1.2e-3, 1.0e-3)),
    pitch_frame=Body(0.25, (0.0, 0.0, 0.0), (1.0e-3, 0.8e-3, 1.2e-3)),
    camera=Body(1.2, (0.0, 0.0, 0.0), (4.6e-3, 2.3e-3, 5.7e-3)),
)


@cache
def traced(p: Parameters) -> Any:
    """Solver step of these parameters as a CasADi function of state and inputs: a tenth of the time."""
    state, inputs = ca.SX.sym("state", len(leaves(State))), ca.SX.sym("inputs", 6)
    torque, voltage = ca.vertsplit(inputs)[:3], ca.vertsplit(inputs)[3:]
    stepped = plant.integrate(
        unflatten(State, ca.vertsplit(state)),
        Inputs(Axes(*torque), Axes(*voltage)),
        p,
        plant.coefficients(p),
        (),
    )
    return ca.Function("step", [state, inputs], [ca.vertcat(*flatten(stepped))])


def started(p: Parameters, torque: Axes = NO_TORQUE, voltage: Axes = NO_TORQUE) -> State:
    state: State = plant.initial_state(p, plant.coefficients(p), Inputs(torque, voltage))
    return state


def simulated(
    p: Parameters, steps: int, torque: Axes = NO_TORQUE, chunk: int = 1000, voltage: Axes = NO_TORQUE
) -> list[State]:
    """The states at the start and after every solver step, wind aside."""
    count = min(chunk, steps)
    many = traced(p).mapaccum("many", count)
    columns = [np.array(flatten(started(p, torque, voltage)), dtype=float)]
    for _ in range(steps // count):
        columns += list(np.array(many(columns[-1], np.tile([*torque, *voltage], (count, 1)).T)).T)
    return [unflatten(State, column.tolist()) for column in columns]


def shown(p: Parameters, states: list[State]) -> list[Outputs]:
    c = plant.coefficients(p)
    return [plant.outputs(state, p, c) for state in states]


def motion(state: State) -> NDArray[np.float64]:
    angles = [*state.tripod, *state.head, *state.joint]
    return np.array([*angles, *state.apex_rate, *state.head_rate, *state.joint_rate])


def at_rest(state: State) -> State:
    return state._replace(apex_rate=(0.0, 0.0, 0.0), head_rate=(0.0, 0.0, 0.0), joint_rate=Axes(0.0, 0.0, 0.0))


def turned(deflection: Axes) -> NDArray[np.float64]:
    """The attitude of what is elastic: scipy's, from its axis and angle, e = 2 tan(angle/2) axis."""
    e = np.array([deflection.pitch, deflection.roll, -deflection.yaw])
    size = float(np.linalg.norm(e))
    matrix: NDArray[np.float64] = Rotation.from_rotvec(e * (2.0 * math.atan(0.5 * size) / max(size, 1e-30))).as_matrix()
    return matrix


def apex_attitude(state: State, heading: float = 0.0) -> NDArray[np.float64]:
    """C_np."""
    attitude: NDArray[np.float64] = np.array(matrix_from_euler(Euler(heading, 0.0, 0.0))) @ turned(state.tripod)
    return attitude


def head_attitude(state: State, heading: float = 0.0) -> NDArray[np.float64]:
    """C_nt."""
    return apex_attitude(state, heading) @ turned(state.head)


def test_energy_is_conserved() -> None:
    """To 1e-7 of the kinetic energy over 10 s at 0.25 ms, with all couplings at work."""
    p = VIGOROUS._replace(solver_period=2.5e-4)
    c = plant.coefficients(p)
    states = simulated(p, 40_000)[::400]
    energies = np.array([plant.energy(state, p, c) for state in states])
    still = plant.energy(at_rest(states[0]), p, c)
    kinetic = energies[0] - still
    assert kinetic > 0.1
    assert np.abs(energies - energies[0]).max() < 1e-7 * kinetic
    travelled = np.ptp([motion(state) for state in states], axis=0)
    assert (travelled[:6] > 1e-5).all()
    assert (travelled[6:9] > 0.3).all()


def test_damping_and_friction_only_take_energy() -> None:
    p = VIGOROUS._replace(tripod=DEFAULT.tripod, head=DEFAULT.head, friction=DEFAULT.friction, cable=DEFAULT.cable)
    c = plant.coefficients(p)
    energies = np.array([plant.energy(state, p, c) for state in simulated(p, 3000)])
    assert (np.diff(energies) < 1e-9).all()
    assert energies[-1] < energies[0] - 0.01


def test_integrator_is_of_fourth_order() -> None:
    ends = []
    for k in (1, 2, 4):
        p = VIGOROUS._replace(solver_period=1e-3 / k)
        ends.append(motion(simulated(p, 200 * k, chunk=200)[-1]))
    order = math.log2(float(np.linalg.norm(ends[0] - ends[1]) / np.linalg.norm(ends[1] - ends[2])))
    assert order == pytest.approx(4.0, abs=0.1)


def test_friction_split_is_of_second_order() -> None:
    """Strang's splitting, where the bristles are soft enough to be resolved."""
    soft = Friction(coulomb=5e-3, presliding=0.01, stribeck_rate=1.0, static_ratio=1.5)
    ends = []
    for k in (1, 2, 4):
        p = VIGOROUS._replace(solver_period=1e-3 / k, friction=JointFriction(soft, soft, soft))
        ends.append(motion(simulated(p, 20 * k, chunk=20)[-1]))
    order = math.log2(float(np.linalg.norm(ends[0] - ends[1]) / np.linalg.norm(ends[1] - ends[2])))
    assert order == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize("joint", [Axes(0.0, 0.0, 0.0), Axes(0.7, -0.5, 0.9), Axes(-2.0, 1.2, -0.4)])
def test_at_rest_gravity_and_the_earths_rate_are_felt(joint: Axes) -> None:
    p = BALANCED._replace(initial=Initial(heading=0.8, joint=joint), latitude=0.9)
    (out,) = shown(p, [started(p)])
    C_nb = np.array(matrix_from_euler(out.euler))
    np.testing.assert_allclose(out.specific_force, C_nb.T @ (0.0, 0.0, p.gravity), atol=1e-12)
    earth = EARTH_RATE * np.array([0.0, math.cos(0.9), math.sin(0.9)])
    np.testing.assert_allclose(out.rate, C_nb.T @ earth, atol=1e-18)
    np.testing.assert_allclose(out.angular_acceleration, 0.0, atol=1e-12)
    np.testing.assert_allclose(matrix_from_quaternion(out.quaternion), C_nb, atol=1e-14)


def test_angles_turn_the_camera_as_their_names_say() -> None:
    p = BALANCED._replace(initial=Initial(heading=0.3, joint=Axes(0.5, 0.2, -0.4)))
    (out,) = shown(p, [started(p)])
    assert out.euler == pytest.approx(Euler(0.8, 0.2, -0.4), abs=1e-6)
    rolled = p._replace(initial=Initial(joint=Axes(0.0, 0.0, 0.4)))
    assert shown(rolled, [started(rolled)])[0].specific_force[0] < 0.0  # right side down


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_motor_torque_turns_its_angle_up(axis: int) -> None:
    torque = Axes(*[0.01 if i == axis else 0.0 for i in range(3)])
    states = simulated(BALANCED, 100, torque)
    turned = np.array(shown(BALANCED, states[-1:])[0].euler) - shown(BALANCED, states[:1])[0].euler
    assert turned[axis] > 1e-3
    assert states[-1].tripod[axis] < 0.0  # the reaction


def test_the_tripod_starts_in_equilibrium() -> None:
    p = VIGOROUS._replace(initial=Initial(joint=Axes(0.5, 0.4, -0.6)), wind=DEFAULT.wind)
    c = plant.coefficients(p)
    wind_n = np.array(wind_force(p.wind, c.wind, plant.WindState(), 0.0))
    state, bodies = started(p), c.rig.bodies
    apex, head = apex_attitude(state), head_attitude(state)
    o = np.array([0.0, 0.0, p.head.height])
    camera = head @ matrix_from_turns(turns_of(state.joint))
    mass = sum(body.mass for body in bodies)
    moment = head @ (np.array(first_moment(bodies, turns_of(state.joint))) + mass * o)
    arm = head @ o + camera @ p.wind.center_of_pressure
    about_q = np.cross(moment, (0.0, 0.0, -p.gravity)) + np.cross(arm, wind_n)
    about_p = about_q + np.cross(p.tripod.height * apex[:, 2], wind_n - np.array([0.0, 0.0, mass * p.gravity]))
    for k, e, torque in ((p.tripod.stiffness, state.tripod, about_p), (p.head.stiffness, state.head, about_q)):
        np.testing.assert_allclose((k.pitch * e.pitch, k.roll * e.roll, -k.yaw * e.yaw), torque, rtol=0.01, atol=1e-3)
    assert np.abs(state.tripod).max() > 1e-4


def test_yaw_modes_have_their_frequencies() -> None:
    """Tripod and base in series on free joints: a balanced camera takes no part in yaw.

    (k1 + k2)/J1, k2/J2 on the diagonal, k2^2/(J1 J2) beside it: the roots of the two-mass oscillator.
    """
    p = BALANCED._replace(
        knock=DEFAULT.knock._replace(impulse=Axes(1e-4, 0.0, 0.0), start=0.0, width=1e-3), solver_period=2.5e-4
    )
    yaw = np.array([[state.tripod.yaw, state.head.yaw] for state in simulated(p, 40_000)]) * [1.0, 10.0]
    k1, k2, j1, j2 = p.tripod.stiffness.yaw, p.head.stiffness.yaw, p.tripod.inertia.yaw, p.head.inertia.yaw
    expected = np.sqrt(np.linalg.eigvals([[(k1 + k2) / j1, -k2 / j1], [-k2 / j2, k2 / j2]])) / (2.0 * math.pi)
    spectrum = np.abs(np.fft.rfft((yaw[1:, 0] + yaw[1:, 1]) * np.hanning(40_000)))
    frequency = np.fft.rfftfreq(40_000, 2.5e-4)  # bins of 0.1 Hz
    for mode in expected:
        near = np.abs(frequency - mode) < 5.0
        assert frequency[near][np.argmax(spectrum[near])] == pytest.approx(mode, abs=0.1)
        assert spectrum[near].max() > 100.0 * np.median(spectrum)


def test_the_default_modes_are_those_of_its_description() -> None:
    """Joints locked, of M and K at zero angles: the first are the tripod's, the others across the ball head."""
    c = plant.coefficients(DEFAULT)
    turns = turns_of((0.0, 0.0, 0.0))
    triangle, forces = mass_matrix(c.rig.bodies, turns, DEFAULT.head.height, c.rig.head.inertia)
    beside = coupling(c.rig, attitude(NO_TORQUE), forces)
    m, k = np.zeros((6, 6)), np.zeros((6, 6))
    m[3:, 3:][np.tril_indices(3)] = triangle[:6]
    m[3:, :3] = np.array([beside.about_x, beside.about_y, [0.0] * 6]).T[:3]
    m[:3, :3] = np.diag(beside.diagonal)
    m = np.tril(m) + np.tril(m, -1).T
    low, high = (np.diag([s.pitch, s.roll, s.yaw]) for s in (DEFAULT.tripod.stiffness, DEFAULT.head.stiffness))
    k[:3, :3], k[:3, 3:], k[3:, :3], k[3:, 3:] = low + high, -high, -high, high
    modes = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(m, k)).real)) / (2.0 * math.pi)
    np.testing.assert_allclose(modes, (6.3, 6.33, 13.8, 67.3, 88.7, 96.2), rtol=0.01)


def test_a_steady_wind_bends_tripod_and_head_in_series() -> None:
    """In yaw the wind's torque about the axis turns the head by T (1/k1 + 1/k2)."""
    p = BALANCED._replace(
        wind=DEFAULT.wind._replace(speed=10.0, direction=math.pi / 2.0, center_of_pressure=(0.0, 0.05, 0.0))
    )
    state = started(p)
    torque = (
        0.5 * p.wind.density * p.wind.drag_area * 100.0 * 0.05
    )  # westward force, ahead of the axis: counterclockwise
    expected = -torque * (1.0 / p.tripod.stiffness.yaw + 1.0 / p.head.stiffness.yaw)
    assert state.tripod.yaw + state.head.yaw == pytest.approx(expected, rel=1e-3)


def second_derivative(x: NDArray[np.float64], h: float) -> NDArray[np.float64]:
    """Sixth-order central difference at the middle of seven samples."""
    weights = np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) / 180.0
    result: NDArray[np.float64] = weights @ x / (h * h)
    return result


def test_specific_force_is_the_second_derivative_of_the_sensors_place() -> None:
    h = 5e-4
    torque = Axes(0.05, -0.03, 0.02)
    p = VIGOROUS._replace(solver_period=h, sensor_position=(0.05, -0.08, 0.1))
    states = simulated(p, 400, torque, 400)
    places, middle = [], 300
    for state, out in zip(states, shown(p, states), strict=True):
        o = (
            p.tripod.height * apex_attitude(state, p.initial.heading)[:, 2]
            + p.head.height * head_attitude(state, p.initial.heading)[:, 2]
        )
        places.append(o + np.array(matrix_from_euler(out.euler)) @ p.sensor_position)
    window = np.array(places[middle - 3 : middle + 4])
    acceleration = second_derivative(window, h)
    (out,) = shown(p, [states[middle]])
    C_nb = np.array(matrix_from_euler(out.euler))
    expected = C_nb.T @ (acceleration + np.array([0.0, 0.0, p.gravity]))
    assert np.linalg.norm(acceleration) > 1.0
    np.testing.assert_allclose(out.specific_force, expected, atol=2e-5)


def test_angular_acceleration_is_the_derivative_of_the_rate() -> None:
    h = 2e-4
    p = VIGOROUS._replace(solver_period=h)
    outs = shown(p, simulated(p, 400, chunk=400)[297:304])
    weights = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60.0
    derivative = weights @ np.array([out.rate for out in outs]) / h
    np.testing.assert_allclose(outs[3].angular_acceleration, derivative, atol=1e-5)


def test_rates_are_the_derivatives_of_the_attitude() -> None:
    h = 2e-4
    p = VIGOROUS._replace(solver_period=h)
    a, now, b = shown(p, simulated(p, 100, chunk=100)[49:52])
    relative = np.array(matrix_from_euler(a.euler)).T @ np.array(matrix_from_euler(b.euler))
    skew = (relative - relative.T) / (4.0 * h)
    earth = np.array(matrix_from_euler(now.euler)).T @ plant.earth_rate_n(p.latitude)
    np.testing.assert_allclose(np.array(now.rate) - earth, (skew[2, 1], skew[0, 2], skew[1, 0]), rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("width", [3e-4, 2.6e-3, 7e-3])
def test_a_knock_hands_over_its_impulse(width: float) -> None:
    """Momentum of the apex after the blow, of which soft springs take back up to 0.3 %; off the solver's grid."""
    weak = Axes(1.0, 1.0, 1.0)
    soft = BALANCED._replace(
        tripod=BALANCED.tripod._replace(stiffness=weak), head=BALANCED.head._replace(stiffness=weak), gravity=0.0
    )
    impulse = Axes(2e-3, -1e-3, 1.5e-3)
    p = soft._replace(knock=DEFAULT.knock._replace(impulse=impulse, start=1.37e-3, width=width))
    c = plant.coefficients(p)
    state = simulated(p, 9)[-1]
    _, forces = mass_matrix(c.rig.bodies, turns_of(state.joint), p.head.height, c.rig.head.inertia)
    beside = coupling(c.rig, attitude(state.head), forces)
    carried = np.array([beside.about_x, beside.about_y, np.zeros(6)]) @ [*state.head_rate, *state.joint_rate]
    momentum = np.array(beside.diagonal) * state.apex_rate + carried
    np.testing.assert_allclose(momentum, (impulse.pitch, impulse.roll, -impulse.yaw), rtol=3e-3)


def test_a_curtain_hands_over_its_impulse_and_takes_it_back() -> None:
    shutter = DEFAULT.shutter._replace(
        impulse=Axes(0.0, 1e-4, 0.0), start=0.0, lag=2.7e-3, travel=0.01, width=1.5e-3, exposure=0.1, period=0.0
    )
    p = BALANCED._replace(shutter=shutter)
    rates = [state.joint_rate.pitch + state.head_rate[0] for state in simulated(p, 20)]
    turned = p.camera.inertia[0] + p.pitch_frame.inertia[0]
    assert rates[6] * turned == pytest.approx(1e-4, rel=1e-3)
    assert abs(rates[18]) * turned < 1e-7


@pytest.mark.parametrize("rate", [0.5, 5.0, 20.0])
def test_friction_is_stable_at_slew_and_brakes_with_the_coulomb_torque(rate: float) -> None:
    """At 1 ms, where the bristles' own time constant is a hundredth of the step."""
    dry = Friction(coulomb=3e-3, presliding=2e-4, viscous=0.0)
    p = BALANCED._replace(
        friction=JointFriction(dry, dry, dry), initial=Initial(joint_rate=Axes(rate, 0.0, 0.0)), gravity=0.0
    )
    rates = np.array([state.joint_rate.yaw + -state.head_rate[2] for state in simulated(p, 300)])
    turned = p.camera.inertia[2] + p.pitch_frame.inertia[2] + p.yaw_frame.inertia[2]
    braking = -np.diff(rates[50:300]) / 1e-3 * turned
    if rate > 1.0:
        assert braking.mean() == pytest.approx(3e-3, rel=0.01)
    assert np.isfinite(rates).all()
    assert (np.abs(rates) < 1.01 * rate).all()


def test_a_stuck_joint_is_a_spring() -> None:
    """Torque below the sliding level: angle = T / sigma0."""
    dry = Friction(coulomb=3e-3, presliding=2e-4, damping_ratio=1.0)
    p = BALANCED._replace(friction=JointFriction(dry, dry, dry), gravity=0.0)
    state = simulated(p, 3000, Axes(1e-4, 1e-4, 1e-4))[-1]
    # the held torque makes the bristle creep, by sigma0 |w|/g z: a percent here
    np.testing.assert_allclose(state.joint, 1e-4 / 15.0, rtol=0.05)


def test_electrical_energy_becomes_heat_and_motion() -> None:
    """Closed to second order in the step: a held torque T turns out T times the turn, the currents' halves are exact.

    Over half a step at a constant rate: i(t) = s + (i0 - s) exp(-R t/L), of which in goes u i and heat is R i^2.
    """
    errors = []
    voltage = Axes(6.0, -4.0, 3.0)
    for k in (1, 2, 4):
        p = VIGOROUS._replace(drive=DRIVE.value("voltage"), initial=Initial(), solver_period=1e-3 / k)
        c, motor = plant.coefficients(p), p.motor.yaw
        states = simulated(p, 250 * k, chunk=250 * k, voltage=voltage)
        tau, half, supplied, heat = motor.inductance / motor.resistance, 0.5e-3 / k, 0.0, 0.0
        left = math.exp(-half / tau)
        for before, after in itertools.pairwise(states):
            for u, start, rates in zip(
                voltage, before.current, zip(before.joint_rate, after.joint_rate, strict=True), strict=True
            ):
                current = start
                for rate in rates:
                    settled = (u - motor.torque_constant * rate) / motor.resistance
                    gap = current - settled
                    passed = settled * half + gap * tau * (1.0 - left)
                    squares = settled**2 * half + 2.0 * settled * gap * tau * (1.0 - left)
                    squares += gap**2 * 0.5 * tau * (1.0 - left**2)
                    supplied, heat = supplied + u * passed, heat + motor.resistance * squares
                    current = settled + gap * left
        stored = [sum(0.5 * motor.inductance * i * i for i in state.current) for state in (states[0], states[-1])]
        gained = plant.energy(states[-1], p, c) - plant.energy(states[0], p, c) + stored[1] - stored[0]
        errors.append(abs(supplied - heat - gained) / supplied)
    assert errors[0] < 0.02
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.2)


def test_a_voltage_drives_a_joint_up_to_its_no_load_rate() -> None:
    """U/k on a free, balanced joint, 14 mechanical time constants R J/k^2 later; mean over the head's ringing."""
    p = BALANCED._replace(drive=DRIVE.value("voltage"), gravity=0.0)
    states = simulated(p, 3000, voltage=Axes(3.0, 0.0, 0.0))[2000:]
    rate = np.mean([state.joint_rate.yaw for state in states])
    assert rate == pytest.approx(3.0 / p.motor.yaw.torque_constant, rel=1e-3)


def test_the_current_loop_gives_the_commanded_torque() -> None:
    p = BALANCED._replace(drive=DRIVE.value("current"))
    states = simulated(p, 20, Axes(0.05, -0.02, 0.01))
    for constant, command, last in zip((0.48, 0.48, 0.48), (0.05, -0.02, 0.01), states[-1].current, strict=True):
        assert constant * last == pytest.approx(command, rel=1e-9)
    limited = simulated(p, 20, Axes(100.0, 0.0, 0.0))[-1]
    assert limited.current.yaw < p.motor.yaw.voltage / p.motor.yaw.resistance


@pytest.mark.parametrize("rate", [0.5, 2.0, 6.0])
def test_an_end_stop_throws_the_camera_back_slower(rate: float) -> None:
    """Hunt & Crossley: G(chi v) = chi v - ln(1 + chi v) is the same before and, for -v, after; the stop's own joint."""
    stop = EndStop(-0.02, 0.02)
    p = BALANCED._replace(
        stop=JointStops(stop, FREE, FREE),
        initial=Initial(joint_rate=Axes(rate, 0.0, 0.0)),
        gravity=0.0,
        tripod=DEFAULT.tripod._replace(stiffness=Axes(1e5, 1e5, 1e5), damping_ratio=Axes(0.0, 0.0, 0.0)),
        head=DEFAULT.head._replace(
            stiffness=Axes(1e5, 1e5, 1e5), inertia=Axes(1e4, 1.0, 1.0), damping_ratio=Axes(0.0, 0.0, 0.0)
        ),
    )._replace(solver_period=1e-4)
    states = simulated(p, 2500)
    c = plant.coefficients(p)
    energies = np.array([plant.energy(state, p, c) for state in states])
    kinetic = 0.5 * 0.0079 * rate**2
    assert np.diff(energies).max() < 1e-6 * kinetic  # RK4 meets the kink at touch; never more than that is gained
    thrown = min(state.joint_rate.yaw for state in states)
    x = stop.loss * rate
    before, y = x - math.log(1.0 + x), stop.loss * -thrown
    assert -y - math.log(1.0 - y) == pytest.approx(before, rel=2e-3)
    assert max(state.joint.yaw for state in states) < 0.02 + rate / math.sqrt(stop.stiffness / 0.0079)


def test_stops_at_the_default_step_only_take_energy() -> None:
    """Bounces on all stops at 1 ms: 50 ms always lose, and no step gains more than a thousandth of the motion."""
    stop = EndStop(-0.1, 0.1)
    p = VIGOROUS._replace(stop=JointStops(stop, stop, stop), initial=Initial(joint_rate=Axes(4.0, -3.0, 6.0)))
    p = p._replace(head=DEFAULT.head, tripod=DEFAULT.tripod)
    c = plant.coefficients(p)
    states = simulated(p, 1000)
    energies = np.array([plant.energy(state, p, c) for state in states])
    kinetic = energies[0] - plant.energy(at_rest(states[0]), p, c)
    assert np.diff(energies).max() < 1e-3 * kinetic
    assert (energies[50::50] < energies[:-50:50]).all()


def test_a_press_pushes_the_camera_down() -> None:
    """Impulse F T/2 at the button's arm, on joints that turn freely."""
    press = DEFAULT.press._replace(force=2.0, position=(0.05, 0.0, 0.0), start=0.0103, duration=0.02, period=0.0)
    p = BALANCED._replace(press=press, gravity=0.0)
    turned = simulated(p, 35)[-1].joint_rate.roll * p.camera.inertia[1]
    assert turned == pytest.approx(0.5 * 2.0 * 0.02 * 0.05, rel=0.01)


@pytest.mark.parametrize("speed", [0.0, 7.0])
def test_the_plant_at_rest_has_finite_derivatives(speed: float) -> None:
    """Of the step by state and inputs; a stuck joint is held by its bristle, a torque moves it."""
    p = DEFAULT._replace(wind=DEFAULT.wind._replace(speed=speed))
    for drive in ("ideal", "current", "voltage"):
        driven = p._replace(drive=DRIVE.value(drive))
        state, inputs = ca.SX.sym("state", len(leaves(State))), ca.SX.sym("inputs", 6)
        torque, voltage = ca.vertsplit(inputs)[:3], ca.vertsplit(inputs)[3:]
        after = plant.integrate(
            unflatten(State, ca.vertsplit(state)),
            Inputs(Axes(*torque), Axes(*voltage)),
            driven,
            plant.coefficients(driven),
            (),
        )
        flat = ca.vertcat(*flatten(after))
        slopes = ca.Function("slopes", [state, inputs], [ca.jacobian(flat, state), ca.jacobian(flat, inputs)])
        by_state, by_input = (np.array(m.full()) for m in slopes(flatten(started(driven)), np.zeros(6)))
        names = [leaf.name for leaf in leaves(State)]
        assert np.isfinite(by_state).all()
        assert np.isfinite(by_input).all()
        for i, axis in enumerate(("yaw", "pitch", "roll")):
            rate = names.index(f"joint_rate.{axis}")
            assert by_state[rate, names.index(f"bristle.{axis}")] < -0.1
            assert by_state[rate, names.index(f"joint.{axis}")] < -0.01  # the cogging holds
            assert by_input[rate, (3 if drive == "voltage" else 0) + i] > 0.01


def test_bits_do_not_depend_on_how_the_master_cuts_time() -> None:
    p = DEFAULT._replace(shutter=DEFAULT.shutter._replace(start=0.1))
    inputs = Inputs(Axes(0.01, -0.005, 0.002))
    ends = []
    for step in (1e-3, 5e-3, 7.3e-3, 10e-3):
        run = Run(plant.MODEL, p, inputs)
        for k in range(round(0.365 / step)):
            run.advance(inputs, (k + 1) * step)
        run.advance(inputs, 0.365)
        ends.append(run.snapshot())
    assert ends[0] == ends[1] == ends[2] == ends[3]


def test_gusts_go_on_when_the_solver_is_refined() -> None:
    """The gusts' clock is the same, so are their draws."""
    winds = []
    for period in (1e-3, 5e-4):
        p = DEFAULT._replace(solver_period=period)
        run = Run(plant.MODEL, p, Inputs())
        run.advance(Inputs(), 0.1)
        winds.append(run.outputs().wind_speed)
    assert winds[0] == pytest.approx(winds[1], rel=1e-9)
    assert winds[0] != pytest.approx(DEFAULT.wind.speed, rel=1e-6)


@pytest.mark.parametrize(
    ("changed", "name"),
    [
        (DEFAULT._replace(camera=DEFAULT.camera._replace(inertia=(1.0, 0.1, 0.1))), "camera.inertia"),
        (DEFAULT._replace(camera=DEFAULT.camera._replace(products=(0.01, 0.0, 0.0))), "camera.products"),
        (DEFAULT._replace(shutter=DEFAULT.shutter._replace(period=0.05)), "shutter.period"),
        (DEFAULT._replace(knock=DEFAULT.knock._replace(period=1e-3)), "knock.period"),
        (DEFAULT._replace(press=DEFAULT.press._replace(period=0.4)), "press.period"),
        (DEFAULT._replace(initial=Initial(joint=Axes(0.0, 0.0, -1.5))), "initial.joint.roll"),
        (DEFAULT._replace(head=DEFAULT.head._replace(stiffness=Axes(1500.0, 1.0, 2500.0))), "head.stiffness.pitch"),
        (DEFAULT._replace(head=DEFAULT.head._replace(inertia=Axes(1e-3, 1e-3, 1e-3))), "solver_period"),
        (DEFAULT._replace(stop=DEFAULT.stop._replace(roll=EndStop(stiffness=1e4))), "solver_period"),
        (DEFAULT._replace(solver_period=9e-3), "solver_period"),
        (DEFAULT._replace(ambient_temperature=20.0), "ambient_temperature"),
        (DEFAULT._replace(initial=Initial(joint_rate=Axes(0.0, 0.0, -10.1))), "initial.joint_rate.roll"),
        (DEFAULT._replace(wind=DEFAULT.wind._replace(speed=60.0)), "wind.period"),
        (DEFAULT._replace(wind=DEFAULT.wind._replace(lens_diameter=0.03)), "wind.period"),
        # 1.5 ms would do, but is rounded to 2 ms
        (DEFAULT._replace(wind=DEFAULT.wind._replace(speed=60.0, period=1.5e-3)), "wind.period"),
        (DEFAULT._replace(tripod=DEFAULT.tripod._replace(stiffness=Axes(320.0, 1.0, 500.0))), "tripod.stiffness.pitch"),
        (
            DEFAULT._replace(
                tripod=DEFAULT.tripod._replace(stiffness=Axes(3e4, 3e4, 3e4), damping_ratio=Axes(2.0, 2.0, 2.0))
            ),
            "solver_period",
        ),
        (
            DEFAULT._replace(friction=DEFAULT.friction._replace(roll=DEFAULT.friction.roll._replace(viscous=10.0))),
            "solver_period",
        ),
    ],
)
def test_impossible_parameters_are_refused_by_name(changed: Parameters, name: str) -> None:
    with pytest.raises(ValueRefusedError, match=rf"rig\.{name}"):
        Run(plant.MODEL, changed, Inputs(), name="rig")


@pytest.mark.parametrize(
    "changes",
    [
        {"speed": 10.0},
        {"speed": 60.0, "period": 1e-3},
        {"speed": 60.0, "shedding": 0.0},
        {"speed": 0.0, "period": 1.0},
    ],
)
def test_a_wind_that_the_clock_follows_is_taken(changes: dict[str, float]) -> None:
    Run(plant.MODEL, DEFAULT._replace(wind=DEFAULT.wind._replace(**changes)), Inputs())


def test_a_refused_period_of_the_wind_tells_what_to_do() -> None:
    strong = DEFAULT._replace(wind=DEFAULT.wind._replace(speed=60.0))
    with pytest.raises(ValueRefusedError, match=r"rig\.wind\.period = 0\.005 s: too long .* set wind\.shedding to 0 "):
        Run(plant.MODEL, strong, Inputs(), name="rig")


def test_the_hardest_impact_allowed_at_the_start_is_stable_at_the_longest_step() -> None:
    """The same number limits the rate at the start and counts for the step: a joint thrown at its stop loses energy."""
    stop = EndStop(-0.1, 0.1)
    p = BALANCED._replace(
        stop=JointStops(stop, stop, stop), initial=Initial(joint_rate=Axes(10.0, 0.0, 0.0)), solver_period=1e-3
    )
    c = plant.coefficients(p)
    energies = np.array([plant.energy(state, p, c) for state in simulated(p, 300)])
    assert np.isfinite(energies).all()
    assert energies[-1] < energies[0]
    assert energies.max() < 1.001 * energies[0]
