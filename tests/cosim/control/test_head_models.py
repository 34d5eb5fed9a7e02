"""The head's parts: clocks that fit each other, gusts of the wind's own covariance, friction as the plant has it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import linalg

from attitude_fmu.cosim.control.head_models import (
    AXES,
    JOINT,
    Clocks,
    PlantModel,
    _sigma_points,
    clocks_of,
    driven,
    moving_friction,
    plant_model,
)
from attitude_fmu.cosim.control.noise import ModelNoise, model_noise
from attitude_fmu.cosim.errors import LinearisationRefusedError

CALM = {"wind.speed": 0.0}
CLOCKS = Clocks(0.002, 0.001)


@pytest.fixture(scope="module")
def calm() -> PlantModel:
    return plant_model(CLOCKS, CALM)


@pytest.mark.parametrize("period", [0.002, 0.004])
def test_ideal_sensor_keeps_its_processors_clock(period: float) -> None:
    clocks = clocks_of("AttitudeSensor", {"ideal": True, "processor.period": period})
    assert clocks.period == pytest.approx(period)
    steps = clocks.period / clocks.solver_period
    assert steps == pytest.approx(round(steps))
    assert 0.5e-3 < clocks.solver_period <= 1e-3 * (1.0 + 1e-9)


def test_sensor_whose_words_do_not_fit_its_processor_sets_the_clock() -> None:
    # its words come at 819.2 Hz
    clocks = clocks_of("AttitudeSensor_ADIS16354_150", {})
    words = clocks.period * 819.2
    assert words == pytest.approx(round(words), rel=1e-6)
    assert clocks.sensor == {"processor.period": clocks.period}
    assert clocks.plant == {"solver_period": clocks.solver_period, "wind.period": clocks.solver_period}


def test_gusts_have_mean_and_covariance_of_the_wind() -> None:
    noise: ModelNoise = model_noise(
        "TripodGimbal",
        CLOCKS.period,
        {"wind.speed": 10.0, **CLOCKS.plant},
        inputs=(),
        outputs=("rate",),
    )
    wind = [i for i, label in enumerate(noise.system.state_labels) if label.startswith("wind.")]
    points = np.array(_sigma_points(noise, wind))
    assert np.allclose(points.mean(axis=0), 0.0, atol=1e-12)
    A, G = noise.system.A[np.ix_(wind, wind)], noise.G[wind]
    covariance = linalg.solve_discrete_lyapunov(A, G @ noise.QN @ G.T)
    # what is left out are directions of less than 5 % of the widest one's variance
    left = covariance - points.T @ points / len(points)
    assert np.linalg.eigvalsh(left).max() <= 0.05 * np.linalg.eigvalsh(covariance).max()
    assert np.linalg.eigvalsh(left).min() > -1e-9


def test_no_wind_has_no_gusts(calm: PlantModel) -> None:
    assert calm.gusts == (calm.mean,)


def test_plant_with_the_equivalent_friction_holds_its_joints_by_that_stiffness(calm: PlantModel) -> None:
    f = np.linspace(0.02, 20.0, 500)
    motion = np.where((f > 3.0) & (f < 9.0), (3e-4) ** 2 / 6.0, 0.0)[:, None] * np.ones(3)
    friction = moving_friction(calm.point, f, motion)
    plant = plant_model(CLOCKS, {**CALM, **friction.parameters})
    softer, resting = (
        1.0 / np.abs(np.diag(driven(one, np.array([0.02])).torque[0, JOINT])) for one in (plant.mean, calm.mean)
    )
    at_rest = calm.point.model.coefficients(calm.point.parameters).friction
    for number, _ in enumerate(AXES):
        one = friction.equivalents[number]
        assert one is not None
        # cables, gravity and motor act beside it all the same; what the tripod gives way is a few parts in a hundred
        change = at_rest[number].stiffness - one.stiffness
        assert resting[number] - softer[number] == pytest.approx(change, rel=0.05)
    # softer than at rest, and something is left
    assert all(one is not None and one.stiffness < 4.0 for one in friction.equivalents)
    assert (friction.rms > 0.0).all()
    assert (friction.rest_at(f) >= 0.0).all()


def test_joint_without_friction_needs_no_equivalent() -> None:
    free = {f"friction.{axis}.coulomb": 0.0 for axis in AXES}
    still = plant_model(CLOCKS, {**CALM, **free}).point
    f = np.linspace(0.02, 20.0, 50)
    friction = moving_friction(still, f, np.ones((50, 3)))
    assert friction.parameters == {}
    assert friction.rms.tolist() == [0.0, 0.0, 0.0]
    assert friction.corner.tolist() == [1.0, 1.0, 1.0]


def test_head_that_does_not_move_has_no_linear_friction(calm: PlantModel) -> None:
    f = np.linspace(0.02, 20.0, 50)
    with pytest.raises(LinearisationRefusedError, match=r"the friction of yaw has no linear equivalent .* choose"):
        moving_friction(calm.point, f, np.zeros((50, 3)))
