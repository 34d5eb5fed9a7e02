"""The table: what a sensor on it feels, its profile, its disturbances."""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from attitude_fmu.models import turntable
from attitude_fmu.models.attitude.rotations import EARTH_RATE, Euler, matrix_from_euler, matrix_from_quaternion
from attitude_fmu.models.errors import ValueRefusedError
from attitude_fmu.models.plants.turntable_axes import Harmonic, NonOrthogonality, PositionError, Wobble
from attitude_fmu.models.plants.turntable_profile import KIND, MODE, NO_AXES, ROWS, Axes, Command, Profile, Row
from attitude_fmu.models.record import defaults, flatten, leaves, unflatten
from attitude_fmu.models.scalar import PI
from attitude_fmu.models.system import Run
from attitude_fmu.models.turntable import SOURCE, Axis, EveryAxis, Inputs, Outputs, Parameters, State

DEG = PI / 180.0
INPUTS: Inputs = defaults(Inputs)
DEFAULT: Parameters = defaults(Parameters)
TRUE_AXIS = Axis(position_error=PositionError(0.0, Harmonic(), Harmonic()), wobble=Wobble(Harmonic(), Harmonic()))
PERFECT = DEFAULT._replace(axis=EveryAxis(TRUE_AXIS, TRUE_AXIS, TRUE_AXIS), nonorthogonality=NonOrthogonality(0.0, 0.0))


def axes_at(p: Parameters, outer: float, middle: float, inner: float) -> Parameters:
    """The same table, its axes at rest at these angles (rad)."""
    a, b, c = p.axis
    return p._replace(
        axis=EveryAxis(
            a._replace(initial_angle=outer), b._replace(initial_angle=middle), c._replace(initial_angle=inner)
        )
    )


def move(outer: float = 0.0, middle: float = 0.0, inner: float = 0.0, rest: float = 0.5, **more: Any) -> Row:
    """A move to angles in degrees."""
    return Row(KIND.value("move"), Axes(outer * DEG, middle * DEG, inner * DEG), duration=rest, **more)


def turn(outer: float = 0.0, middle: float = 0.0, inner: float = 0.0, duration: float = 1.0) -> Row:
    """Turning at rates in degrees per second."""
    return Row(KIND.value("turn"), rate=Axes(outer * DEG, middle * DEG, inner * DEG), duration=duration)


def with_rows(p: Parameters, *rows: Row) -> Parameters:
    return p._replace(profile=p.profile._replace(row=(*rows, *[Row()] * (ROWS - len(rows)))))


def driven(p: Parameters) -> Parameters:
    return p._replace(source=SOURCE.value("inputs"))


def told(mode: str, angle: Axes = NO_AXES, rate: Axes = NO_AXES, temperature: float = 293.15) -> Inputs:
    return Inputs(Command(MODE.value(mode), angle, rate, temperature))


def shown(p: Parameters, steps: int, step: float = 1e-3, inputs: Inputs = INPUTS) -> list[Outputs]:
    """What the table shows at the start and after every communication step."""
    run = Run(turntable.MODEL, p, inputs)
    found = [run.outputs()]
    for k in range(steps):
        run.advance(inputs, (k + 1) * step)
        found.append(run.outputs())
    return found


@cache
def traced(p: Parameters) -> Any:
    """A tick of the table without its commands as a CasADi function of the state and its draws: a tenth of the time."""
    symbols, z = ca.SX.sym("x", len(leaves(State))), ca.SX.sym("z", 12)
    c = turntable.coefficients(p)
    state, draws = unflatten(State, ca.vertsplit(symbols)), ca.vertsplit(z)
    state = turntable.sway(state, INPUTS, p, c, tuple(draws[:6]))
    state = turntable.shake(state, INPUTS, p, c, tuple(draws[6:]))
    after = turntable.move(state, INPUTS, p, c, ())
    out = turntable.outputs(after, p, c)
    return ca.Function(
        "tick", [symbols, z], [ca.vertcat(*flatten(after)), ca.vertcat(*out.specific_force, *out.rate, *out.euler)]
    )


def vibrated(p: Parameters, ticks: int, seed: int = 1) -> NDArray[np.float64]:
    """Specific force, rate and Euler angles after every tick."""
    start = [float(x) for x in flatten(turntable.initial_state(p, turntable.coefficients(p), INPUTS))]
    draws = np.random.default_rng(seed).standard_normal((12, ticks))
    _, rows = traced(p).mapaccum("many", ticks)(start, draws)
    return np.array(rows).T


# --- a table at rest -------------------------------------------------------------------------------------------------

ATTITUDES = [(0.0, 0.0, 0.0), (0.7, -0.5, 0.9), (-2.0, 1.2, -0.4), (3.0, 0.2, 2.8)]


@pytest.mark.parametrize("angles", ATTITUDES)
def test_angles_of_a_perfect_table_are_yaw_pitch_and_roll(angles: tuple[float, float, float]) -> None:
    out = shown(axes_at(PERFECT, *angles), 0)[0]
    assert out.euler == pytest.approx(Euler(*angles), abs=1e-14)
    np.testing.assert_allclose(matrix_from_quaternion(out.quaternion), matrix_from_euler(out.euler), atol=1e-14)


@pytest.mark.parametrize("angles", ATTITUDES)
@pytest.mark.parametrize("p", [PERFECT, DEFAULT])
def test_at_rest_gravity_and_the_earths_rate_are_felt(p: Parameters, angles: tuple[float, float, float]) -> None:
    p = axes_at(p, *angles)._replace(
        latitude=0.9,
        base=turntable.Base(0.4, 0.01, -0.02),
        mounting=turntable.Mounting(0.1, 0.2, -0.3),
        sensor_position=(0.1, -0.2, 0.3),
    )
    out = shown(p, 0)[0]
    C_nb = np.array(matrix_from_quaternion(out.quaternion))
    np.testing.assert_allclose(out.specific_force, C_nb.T @ (0.0, 0.0, p.gravity), atol=1e-14)
    earth = EARTH_RATE * np.array([0.0, math.cos(0.9), math.sin(0.9)])
    np.testing.assert_allclose(out.rate, C_nb.T @ earth, atol=1e-19)
    assert out.angular_acceleration == pytest.approx((0.0, 0.0, 0.0), abs=1e-20)


def test_base_and_mounting_come_before_and_after_the_axes() -> None:
    p = axes_at(PERFECT, 0.7, -0.5, 0.9)._replace(
        base=turntable.Base(0.4, 0.1, -0.2), mounting=turntable.Mounting(0.1, 0.2, -0.3)
    )
    expected = Rotation.identity()
    for yaw, pitch, roll in (p.base, (0.7, -0.5, 0.9), p.mounting):
        expected = expected * Rotation.from_euler("ZXY", [-yaw, pitch, roll])
    found = matrix_from_quaternion(shown(p, 0)[0].quaternion)
    np.testing.assert_allclose(found, expected.as_matrix(), atol=1e-14)


# --- a table that moves ----------------------------------------------------------------------------------------------

MOVING = with_rows(
    DEFAULT._replace(
        base=turntable.Base(0.4, 0.1, -0.2),
        mounting=turntable.Mounting(0.1, 0.2, -0.3),
        sensor_position=(0.1, -0.2, 0.3),
        tilt=turntable.Tilt((1e-3, 2e-3, 1e-3), 3.0, 0.2),
    ),
    Row(KIND.value("turn"), rate=Axes(0.3, -0.4, 0.5), duration=10.0),
)
"""Every axis and the bench turn, and every error is there."""


def rotation(out: Outputs) -> Rotation:
    w, x, y, z = out.quaternion
    return Rotation.from_quat([x, y, z, w])


def test_rates_are_the_derivatives_of_the_attitude() -> None:
    """Turn over a tick against the mean of the rates at its ends: no jump of acceleration lies in between.

    The rule's error is h^2/12 of the rate's second derivative, 1e-9 of less than 1000 rad/s^3.
    """
    h = 1e-4
    outs = shown(MOVING._replace(period=h), 3000, h)[1000:]
    earth_n = turntable.earth_rate_n(MOVING.latitude)
    rates = [np.array(out.rate) - rotation(out).inv().apply(earth_n) for out in outs]
    turned = [(rotation(a).inv() * rotation(b)).as_rotvec() / h for a, b in pairwise(outs)]
    np.testing.assert_allclose([0.5 * (a + b) for a, b in pairwise(rates)], turned, atol=1e-6)
    assert np.abs(outs[-1].rate).max() > 0.02


def test_angular_acceleration_is_the_derivative_of_the_rate() -> None:
    h = 1e-4
    p = MOVING._replace(period=h, tilt=turntable.Tilt())
    outs = shown(p, 4000, h)[1000:]
    rates = np.array([out.rate for out in outs])
    found = np.array([out.angular_acceleration for out in outs])[1:-1]
    np.testing.assert_allclose(found, (rates[2:] - rates[:-2]) / (2.0 * h), atol=1e-5)
    assert np.abs(found).max() > 0.1


def test_specific_force_is_the_second_derivative_of_the_sensors_place() -> None:
    h = 1e-3
    p = MOVING._replace(period=h, tilt=turntable.Tilt())
    outs = shown(p, 700, h)[200:]
    back = Rotation.from_euler("ZXY", [-p.mounting.yaw, p.mounting.pitch, p.mounting.roll]).inv()
    places = np.array([rotation(out).apply(back.apply(p.sensor_position)) for out in outs])
    acceleration = (places[2:] - 2.0 * places[1:-1] + places[:-2]) / (h * h)
    felt_n = acceleration + np.array([0.0, 0.0, p.gravity])
    expected = [rotation(out).inv().apply(a) for out, a in zip(outs[1:-1], felt_n, strict=True)]
    np.testing.assert_allclose([out.specific_force for out in outs[1:-1]], expected, atol=2e-5)
    assert np.abs(acceleration).max() > 0.01


def test_turning_at_a_rate_is_felt_as_that_rate() -> None:
    p = with_rows(PERFECT, turn(inner=5.0, duration=2.0))
    outs = [out for out in shown(p, 300, 1e-2) if out.turning]
    assert len(outs) == 200
    for out in outs:
        earth = np.array(matrix_from_quaternion(out.quaternion)).T @ turntable.earth_rate_n(p.latitude)
        np.testing.assert_allclose(np.array(out.rate) - earth, (0.0, 5.0 * DEG, 0.0), atol=p.profile.tolerance)


def test_bits_do_not_depend_on_how_the_master_cuts_time() -> None:
    p = MOVING._replace(
        shaking=turntable.Shaking((0.1, 0.2, 0.3), lower_frequency=1.0),
        shock=turntable.Shock((1.0, 2.0, 3.0), 0.1234, 0.01, 2, 0.05, 0.5),
    )
    ends = []
    for step in (1e-3, 5e-3, 7.3e-3, 10e-3):
        run = Run(turntable.MODEL, p, INPUTS)
        for k in range(round(0.365 / step)):
            run.advance(INPUTS, (k + 1) * step)
        run.advance(INPUTS, 0.365)
        ends.append(run.snapshot())
    assert ends[0] == ends[1] == ends[2] == ends[3]


# --- profiles --------------------------------------------------------------------------------------------------------


def first(outs: list[Outputs], step: float, **wanted: float) -> float:
    """Time at which outputs have these values for the first time."""
    return next(k * step for k, out in enumerate(outs) if all(getattr(out, n) == v for n, v in wanted.items()))


def test_rows_follow_one_another_when_the_rest_is_over() -> None:
    step = 1e-2
    p = with_rows(PERFECT, move(middle=10.0, rest=2.0), move(inner=-5.0, rest=0.5), turn(outer=5.0, duration=1.0))
    outs = shown(p, 1000, step)
    begins = [first(outs, step, row=row) for row in (1, 2, 3, 4)]
    rests = [first(outs, step, row=row, resting=True) for row in (1, 2)]
    steady = first(outs, step, row=3, turning=True)
    # 10 deg at 10 deg/s and 10 deg/s^2 take 2 s, -5 deg and the middle axis's way back 2 s, 5 deg/s takes 0.5 s
    settling = 0.05
    assert begins[0] == step
    for begin, rest, travel in ((begins[0], rests[0], 2.0), (begins[1], rests[1], 2.0), (begins[2], steady, 0.5)):
        assert travel <= rest - begin < travel + settling
    assert np.subtract(begins[1:], [*rests, steady]) == pytest.approx([2.0, 0.5, 1.0])
    assert first(outs, step, finished=True) == begins[3]
    for k, out in enumerate(outs):
        assert out.resting == (rests[0] <= k * step < begins[1] or rests[1] <= k * step < begins[2])
        assert out.turning == (steady <= k * step < begins[3])


def test_results_taken_in_a_rest_are_at_its_angles() -> None:
    p = with_rows(PERFECT, move(20.0, -10.0, 43.5, rest=0.3))
    resting = [out for out in shown(p, 6000, 1e-3) if out.resting]
    assert len(resting) == 300
    wanted = np.array([20.0, -10.0, 43.5]) * DEG
    assert max(np.abs(np.array(out.axis_angle) - wanted).max() for out in resting) < p.profile.tolerance
    np.testing.assert_allclose(resting[-1].euler, wanted, atol=1e-14)


def test_a_move_may_be_slower_than_the_axis() -> None:
    slow = Row(KIND.value("move"), Axes(0.0, 0.0, 5.0 * DEG), Axes(0.0, 0.0, 1.0 * DEG), 0.1)
    outs = shown(with_rows(PERFECT, slow), 600, 1e-2)
    assert max(out.axis_rate.inner for out in outs) < 1.05 * DEG  # the servo's overshoot of a ramp
    assert first(outs, 1e-2, resting=True) == pytest.approx(5.0 + 0.1 + 0.01, abs=0.06)


def test_a_turn_that_the_profile_ends_with_is_stopped() -> None:
    outs = shown(with_rows(PERFECT, turn(outer=8.0, duration=0.2)), 300, 1e-2)
    assert outs[-1].finished
    assert outs[-1].axis_rate.outer == 0.0
    assert (outs[-1].resting, outs[-1].turning) == (False, False)


def test_rows_wait_for_the_chamber() -> None:
    warm = move(inner=1.0, rest=1.0, temperature=295.15)
    p = with_rows(PERFECT, warm)._replace(chamber=turntable.Chamber(293.15, 0.5, 1.0, 0.1))
    outs = shown(p, 1000, 1e-2)
    begin = first(outs, 1e-2, resting=True)
    assert outs[round(begin / 1e-2)].temperature == pytest.approx(295.05, abs=0.01)
    assert begin > 4.0  # 2 K at 0.5 K/s
    hasty = p._replace(chamber=p.chamber._replace(wait=False))
    assert first(shown(hasty, 200, 1e-2), 1e-2, resting=True) < 1.0


def test_the_last_row_of_all_ends_the_profile() -> None:
    p = with_rows(PERFECT, *[move(rest=0.01)] * ROWS)
    outs = shown(p, 300, 1e-2)
    assert (outs[-1].row, outs[-1].finished) == (ROWS + 1, True)


def test_inputs_drive_the_table_at_every_tick() -> None:
    p = driven(PERFECT)._replace(chamber=turntable.Chamber(ramp_limit=0.5, time_constant=1.0))
    run = Run(turntable.MODEL, p, INPUTS)
    spinning = told("rate", rate=Axes(3.0 * DEG, 0.0, 0.0))
    run.advance(spinning, 1.0)
    out = run.outputs()
    assert out.axis_rate.outer == pytest.approx(3.0 * DEG, rel=1e-9)
    assert (out.turning, out.resting, out.row) == (True, False, 0)
    there = told("position", Axes(-2.0 * DEG, 1.0 * DEG, 0.5 * DEG), temperature=300.0)
    run.advance(there, 5.0)
    out = run.outputs()
    assert out.euler == pytest.approx((-2.0 * DEG, 1.0 * DEG, 0.5 * DEG), abs=1e-14)
    assert 293.15 < out.temperature < 299.0
    assert not out.resting  # the chamber is on its way
    run.advance(there, 20.0)
    assert run.outputs().resting


def test_rates_beyond_an_axiss_limit_are_held_to_it() -> None:
    out = shown(driven(PERFECT), 1, 3.0, told("rate", rate=Axes(1.0, -1.0, 0.0)))[-1]
    assert out.axis_rate == pytest.approx((10.0 * DEG, -10.0 * DEG, 0.0), abs=1e-12)
    assert out.turning


# --- disturbances ----------------------------------------------------------------------------------------------------


def chi_square_bounds(samples: int) -> NDArray[np.float64]:
    """Of a variance that so many independent samples give, over the true one; 1e-6 beyond each."""
    bounds: NDArray[np.float64] = chi2.ppf([1e-6, 1.0 - 1e-6], samples) / samples
    return bounds


def test_shaking_is_felt_along_the_benchs_axes_with_its_rms() -> None:
    """White at ticks, so that every one counts; the plate is turned, the bench's axes are not."""
    rms = (0.3, 0.2, 0.1)
    p = axes_at(PERFECT, 0.0, 0.0, 0.5)._replace(shaking=turntable.Shaking(rms, 1e4, 1.0))
    force = vibrated(p, 10_000)[:, :3]
    C_nb = np.array(matrix_from_euler(Euler(0.0, 0.0, 0.5)))
    shaken = force @ C_nb.T - [0.0, 0.0, p.gravity]
    low, high = chi_square_bounds(10_000)
    ratio = np.mean(shaken**2, axis=0) / np.square(rms)
    assert low < ratio.min()
    assert ratio.max() < high


def test_shaking_reads_as_the_papers_tilt_noise() -> None:
    """1.36 deg rms of accelerometer angle at 50 Hz is 0.0237 g across, and no correlation from reading to reading."""
    rms = math.tan(1.36 * DEG) * PERFECT.gravity
    assert rms == pytest.approx(0.0237 * 9.80665, rel=2e-3)
    p = PERFECT._replace(shaking=turntable.Shaking((rms, 0.0, 0.0), 50.0, 0.7))
    force = vibrated(p, 40_000)[19::20]
    roll = np.degrees(np.arctan2(-force[:, 0], force[:, 2]))
    low, high = chi_square_bounds(2000)
    assert low < np.mean(roll**2) / 1.36**2 < high
    assert abs(np.mean(roll[1:] * roll[:-1])) < 1.36**2 * (4.0 / math.sqrt(2000) + math.exp(-0.7 * 2.0 * PI))


def test_tilt_turns_the_bench_about_its_axes_with_its_rms() -> None:
    """Of samples 0.3 s apart, which a resonance of 10 Hz and damping 0.5 has long forgotten."""
    rms = (1e-3, 2e-3, 3e-3)
    p = PERFECT._replace(tilt=turntable.Tilt(rms, 10.0, 0.5), period=0.01)
    yaw, pitch, roll = vibrated(p, 30_000)[29::30, 6:].T
    low, high = chi_square_bounds(1000)
    ratio = np.mean(np.square([pitch, roll, -yaw]), axis=1) / np.square(rms)
    assert low < ratio.min()
    assert ratio.max() < high


def test_shocks_hand_over_their_speed() -> None:
    """Sum of the specific force over all ticks: 2/pi peak duration along the bench's axes."""
    shock = turntable.Shock((20.0, -10.0, 5.0), 0.0213, 2.7e-3, 3, 0.05)
    p = with_rows(PERFECT)._replace(shock=shock)
    felt = np.array([out.specific_force for out in shown(p, 300)]) - (0.0, 0.0, p.gravity)
    expected = np.array(shock.peak) * (2.0 / PI * 2.7e-3 * 3)
    np.testing.assert_allclose(felt.sum(axis=0) * 1e-3, expected, rtol=1e-9)


def test_a_bench_held_in_its_place_is_given_back_its_speed() -> None:
    """Velocity by the specific force, from many starts: free, it is a random walk; held at 2 Hz, it is not."""
    rms, lasting, starts = 0.2, 2000, 20
    speeds = {}
    for lower in (0.0, 2.0):
        p = PERFECT._replace(shaking=turntable.Shaking((rms, 0.0, 0.0), 50.0, 0.7, lower))
        speeds[lower] = [1e-3 * np.sum(vibrated(p, lasting, seed)[:, 0]) for seed in range(starts)]
    # by a density of 2 zeta rms^2/(pi f), two-sided: density T, and density/(2 sqrt(2) w); chi-square of 20 starts
    density = 2.0 * 0.7 * rms**2 / (PI * 50.0)
    low, high = chi_square_bounds(starts)
    assert low < np.mean(np.square(speeds[0.0])) / (density * 2.0) < high
    assert low < np.mean(np.square(speeds[2.0])) / (density / (2.0 * math.sqrt(2.0) * 4.0 * PI)) < high


def test_without_vibration_nothing_is_drawn() -> None:
    run = Run(turntable.MODEL, DEFAULT, INPUTS)
    run.advance(INPUTS, 0.02)
    assert run.state.tilt == turntable.QUIET
    assert run.state.shaking == turntable.QUIET


# --- what is refused -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changed", "name"),
    [
        (DEFAULT._replace(shock=turntable.Shock(duration=0.1, pulses=2, period=0.05)), "shock.period"),
        (DEFAULT._replace(shock=turntable.Shock(duration=0.1, pulses=2, period=0.15, rebound=0.5)), "shock.period"),
        (DEFAULT._replace(chamber=turntable.Chamber(initial_temperature=20.0)), "chamber.initial_temperature"),
        (DEFAULT._replace(profile=Profile(row=(move(rest=-1.0), *[Row()] * (ROWS - 1)))), r"profile.row\[1\].duration"),
    ],
)
def test_impossible_parameters_are_refused_by_name(changed: Parameters, name: str) -> None:
    with pytest.raises(ValueRefusedError, match=rf"rig\.{name}"):
        Run(turntable.MODEL, changed, INPUTS, name="rig")
