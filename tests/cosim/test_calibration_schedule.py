"""Schedules on the turntable: what they ask of the table, and what its encoders say about the truth."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from attitude_fmu.cosim.calibration_schedule import (
    FULL,
    QUICK,
    Schedule,
    calibration_profile,
    encoder_truth,
    verification_profile,
)
from attitude_fmu.models import turntable
from attitude_fmu.models.attitude.rotations import STANDARD_GRAVITY
from attitude_fmu.models.plants.turntable_axes import Harmonic, NonOrthogonality, PositionError, Wobble
from attitude_fmu.models.plants.turntable_profile import ROWS, Axes
from attitude_fmu.models.plants.turntable_servo import AxisMotion

TRUE_AXIS = turntable.Axis(
    position_error=PositionError(0.0, Harmonic(), Harmonic()), wobble=Wobble(Harmonic(), Harmonic())
)
FLAWLESS = turntable.Parameters(
    axis=turntable.EveryAxis(TRUE_AXIS, TRUE_AXIS, TRUE_AXIS), nonorthogonality=NonOrthogonality(0.0, 0.0)
)


def test_encoders_of_a_flawless_table_tell_the_truth() -> None:
    random = np.random.default_rng(1)
    encoders = random.uniform(-3.0, 3.0, (6, 20))
    rates, forces = encoder_truth(encoders)
    c = turntable.coefficients(FLAWLESS)
    state = turntable.initial_state(FLAWLESS, c, turntable.Inputs())
    for column, rate, force in zip(encoders.T, rates, forces, strict=True):
        axes = [AxisMotion(angle, speed, 0.0) for angle, speed in zip(column[:3], column[3:], strict=True)]
        shown = turntable.outputs(state._replace(axis=(axes[0], axes[1], axes[2])), FLAWLESS, c)
        assert shown.rate == pytest.approx(tuple(rate), abs=1e-13)
        assert shown.specific_force == pytest.approx(tuple(force), abs=1e-13)


def up_along(angle: Axes) -> np.ndarray:
    _, force = encoder_truth(np.array([[*angle, 0.0, 0.0, 0.0]]).T)
    return force[0] / STANDARD_GRAVITY


def test_positions_are_spread_evenly_over_all_directions() -> None:
    rows = [row for row in calibration_profile(20.0, 10.0).rows if row.kind == "move"]
    up = np.array([up_along(row.angle) for row in rows])
    assert len(np.unique(np.round(up, 9), axis=0)) == 26
    # as for the whole sphere: no direction prefers, none leans to another
    assert np.sum(up, axis=0) == pytest.approx(np.zeros(3), abs=1e-9)
    assert up.T @ up == pytest.approx(26.0 / 3.0 * np.eye(3), abs=1e-9)
    for row, direction in zip(rows, up, strict=True):
        for sign, axis in zip(row.label[:-3][::2], row.label[:-3][1::2], strict=True):
            assert direction["xyz".index(axis)] * float(f"{sign}1") > 0.5


def test_turns_go_once_round_each_way_about_every_axis() -> None:
    rows = calibration_profile(20.0, 10.0).rows
    assert len(rows) <= ROWS
    seen = []
    for before, row in itertools.pairwise(rows):
        if row.kind == "turn":
            assert abs(row.rate.outer) * row.duration == pytest.approx(2.0 * math.pi)
            label = before.label if before.kind == "move" else before.label.partition(",")[0]
            assert row.label.startswith(label)
            seen.append((label, round(math.degrees(row.rate.outer))))
    assert sorted(seen) == sorted(
        (f"{sign}{axis} up", way * rate) for sign, rate in (("+", 60), ("-", 20)) for axis in "xyz" for way in (1, -1)
    )


@pytest.mark.parametrize("schedule", [FULL, QUICK])
def test_verification_is_where_the_calibration_was_not(schedule: Schedule) -> None:
    assert not set(schedule.calibrated) & set(schedule.verified)
    assert (min(schedule.verified), max(schedule.verified)) == (0.0, 60.0)
    assert min(schedule.calibrated) < 0.0
    assert max(schedule.calibrated) > 60.0
    positions = [up_along(row.angle) for row in calibration_profile(20.0, 10.0).rows if row.kind == "move"]
    verified = verification_profile(20.0, 5.0).rows
    assert {round(math.degrees(max(row.angle, key=abs))) for row in verified} >= {-40, 40}
    for row in verified:
        # more than 4 deg from every position of the calibration
        assert max(np.dot(up_along(row.angle), position) for position in positions) < math.cos(math.radians(4.0))
