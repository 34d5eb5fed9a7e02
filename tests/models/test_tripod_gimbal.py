"""The plant: energy, order, modes, sensors' truth, disturbances."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

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
from attitude_fmu.models.plants.gimbal import Axes, Body, mass_matrix
from attitude_fmu.models.record import defaults, flatten, leaves, unflatten
from attitude_fmu.models.system import Run
from attitude_fmu.models.tripod_gimbal import Initial, Inputs, JointFriction, Outputs, Parameters, State

NO_TORQUE = Axes(0.0, 0.0, 0.0)
NONE = Friction(coulomb=0.0, viscous=0.0)
DEFAULT: Parameters = defaults(Parameters)
QUIET = DEFAULT._replace(
    friction=JointFriction(NONE, NONE, NONE),
    wind=DEFAULT.wind._replace(speed=0.0),
    shutter=DEFAULT.shutter._replace(impulse=Axes(0.0, 0.0, 0.0)),
    tripod=DEFAULT.tripod._replace(damping_ratio=Axes(0.0, 0.0, 0.0)),
)
"""Nothing that gives or takes energy."""

VIGOROUS = QUIET._replace(
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
    """Solver step of these parameters as a CasADi function of state and motor torque: a tenth of the time."""
    state, torque = ca.SX.sym("state", len(leaves(State))), ca.SX.sym("torque", 3)
    stepped = plant.integrate(
        unflatten(State, ca.vertsplit(state)),
        Inputs(Axes(*ca.vertsplit(torque))),
        p,
        plant.coefficients(p),
        (),
    )
    return ca.Function("step", [state, torque], [ca.vertcat(*flatten(stepped))])


def started(p: Parameters, torque: Axes = NO_TORQUE) -> State:
    state: State = plant.initial_state(p, plant.coefficients(p), Inputs(torque))
    return state


def simulated(p: Parameters, steps: int, torque: Axes = NO_TORQUE, chunk: int = 1000) -> list[State]:
    """The states at the start and after every solver step, wind aside."""
    count = min(chunk, steps)
    many = traced(p).mapaccum("many", count)
    columns = [np.array(flatten(started(p, torque)), dtype=float)]
    for _ in range(steps // count):
        columns += list(np.array(many(columns[-1], np.tile([torque], (count, 1)).T)).T)
    return [unflatten(State, column.tolist()) for column in columns]


def shown(p: Parameters, states: list[State]) -> list[Outputs]:
    c = plant.coefficients(p)
    return [plant.outputs(state, p, c) for state in states]


def motion(state: State) -> NDArray[np.float64]:
    return np.array([*state.deflection, *state.joint, *state.head_rate, *state.joint_rate])


def test_energy_is_conserved() -> None:
    """To 1e-7 of the kinetic energy over 10 s at 0.1 ms, with all couplings at work."""
    p = VIGOROUS._replace(solver_period=1e-4)
    c = plant.coefficients(p)
    states = simulated(p, 100_000)[::1000]
    energies = np.array([plant.energy(state, p, c) for state in states])
    still = plant.energy(states[0]._replace(head_rate=(0.0, 0.0, 0.0), joint_rate=Axes(0.0, 0.0, 0.0)), p, c)
    kinetic = energies[0] - still
    assert kinetic > 0.1
    assert np.abs(energies - energies[0]).max() < 1e-7 * kinetic
    travelled = np.ptp([motion(state) for state in states], axis=0)
    assert (travelled[:3] > 1e-4).all()
    assert (travelled[3:6] > 0.3).all()


def test_damping_and_friction_only_take_energy() -> None:
    p = VIGOROUS._replace(tripod=DEFAULT.tripod, friction=DEFAULT.friction)
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
    assert states[-1].deflection[axis] < 0.0  # the reaction


def test_the_tripod_starts_in_equilibrium() -> None:
    p = VIGOROUS._replace(initial=Initial(joint=Axes(0.5, 0.4, -0.6)), wind=DEFAULT.wind)
    c = plant.coefficients(p)
    wind_n = np.array(plant.wind_now(p.wind, c.wind, plant.WindState(), 0.0)[0])
    state = started(p)
    head = np.array(matrix_from_euler(Euler(*state.deflection)))
    o = np.array([0.0, 0.0, c.height])
    camera = head @ matrix_from_turns(turns_of(state.joint))
    mass = sum(body.mass for body in c.bodies)
    moment = head @ (np.array(plant.first_moment(c.bodies, turns_of(state.joint))) + mass * o)
    torque = np.cross(moment, (0.0, 0.0, -p.gravity))
    torque += np.cross(head @ o + camera @ p.wind.center_of_pressure, wind_n)
    k, e = p.tripod.stiffness, state.deflection
    np.testing.assert_allclose((k.pitch * e.pitch, k.roll * e.roll, -k.yaw * e.yaw), torque, rtol=0.01, atol=1e-3)
    assert np.abs(e).max() > 1e-4


def test_yaw_mode_has_its_frequency() -> None:
    """sqrt(k/I)/2 pi; a balanced camera on free joints takes no part."""
    p = BALANCED._replace(knock=DEFAULT.knock._replace(impulse=Axes(1e-4, 0.0, 0.0), start=0.0, width=1e-3))
    yaw = np.array([state.deflection.yaw for state in simulated(p, 2000)])
    up = np.flatnonzero((yaw[:-1] < 0.0) & (yaw[1:] >= 0.0))
    crossings = up - yaw[up] / (yaw[up + 1] - yaw[up])
    found = 1e3 * (len(crossings) - 1) / (crossings[-1] - crossings[0])
    expected = math.sqrt(p.tripod.stiffness.yaw / p.tripod.inertia.yaw) / (2.0 * math.pi)
    assert found == pytest.approx(expected, rel=1e-4)


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
        head = matrix_from_euler(Euler(p.initial.heading + state.deflection.yaw, *state.deflection[1:]))
        place = (
            np.array(head) @ (0.0, 0.0, p.tripod.height) + np.array(matrix_from_euler(out.euler)) @ p.sensor_position
        )
        places.append(place)
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
    """Momentum of the head right after the blow, on springs too soft to matter; off the solver's grid."""
    soft = BALANCED._replace(tripod=BALANCED.tripod._replace(stiffness=Axes(1.0, 1.0, 1.0), height=0.0))
    impulse = Axes(2e-3, -1e-3, 1.5e-3)
    p = soft._replace(knock=DEFAULT.knock._replace(impulse=impulse, start=1.37e-3, width=width))
    c = plant.coefficients(p)
    state = simulated(p, 9)[-1]
    triangle = mass_matrix(c.bodies, turns_of(state.joint), c.height, c.mount.inertia)
    m = np.zeros((6, 6))
    m[np.tril_indices(6)] = triangle
    momentum = (m + np.tril(m, -1).T) @ [*state.head_rate, *state.joint_rate]
    np.testing.assert_allclose(momentum[:3], (impulse.pitch, impulse.roll, -impulse.yaw), rtol=1e-3)


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
        (DEFAULT._replace(solver_period=9e-3), "solver_period"),
        (DEFAULT._replace(ambient_temperature=20.0), "ambient_temperature"),
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
