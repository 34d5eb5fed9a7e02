"""The stabilised head's parts as linear models: plant in gusts, friction on the move, sensor with its noise.

Everything is computed from the models at their operating points. What a name of theirs is here, it is once.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg  # type: ignore[import-untyped]

from attitude_fmu.models.record import flatten, leaves, unflatten

from ..errors import LinearisationRefusedError
from .conditioning import Array
from .equivalent_friction import EquivalentFriction, equivalent_friction
from .linear import model_ss
from .noise import ModelNoise, model_noise
from .operating_point import OperatingPoint, operating_point
from .responses import Complex, density, response
from .stepping import CLOCK_TOLERANCE, model_called, parameters_with

AXES = ("yaw", "pitch", "roll")
PLANT, HOLD = "TripodGimbal", "GimbalController"
RATE, FORCE, JOINT, JOINT_RATE, LINE = (slice(3 * i, 3 * i + 3) for i in range(5))
PLANT_OUTPUTS = ("rate", "specific_force", "joint", "joint_rate", "euler")
TORQUE, READINGS = "motor_torque", ("rate_measured", "specific_force_measured")
BODY_RATES = ((2, -1.0), (0, 1.0), (1, 1.0))
"""Element and sign of the body's rate that each joint turns, the head level: yaw about -z, pitch x, roll y."""

_WIND = "wind."
_PLANT_STEP = 1e-3

_SPREAD = 5e-2
"""Part of the widest gust's variance below which a direction of the wind's states is left at its mean."""

IN_MOTION: Mapping[str, float] = {"solver.fusion.rest_bias": 0.0}
"""The sensor does not take a stabilised head's slow turning for bias."""


class Clocks(NamedTuple):
    """Sampling time of sensor and controller, and the plant's step, s."""

    period: float
    solver_period: float

    @property
    def plant(self) -> dict[str, float]:
        """The plant's parameters: its gusts step with it."""
        return {"solver_period": self.solver_period, "wind.period": self.solver_period}

    @property
    def sensor(self) -> dict[str, float]:
        """The sensor's parameters."""
        return {"processor.period": self.period}

    @property
    def hold(self) -> dict[str, float]:
        """The holding controller's parameters."""
        return {"period": self.period}


def clocks_of(sensor: str, parameters: Mapping[str, float | str]) -> Clocks:
    """Clocks of a head with this sensor: the processor's, or the gyros' words' where the processor's does not fit them.

    The plant steps every 1 ms or a little faster, a whole number of times.
    """
    model = model_called(sensor)
    values = parameters_with(model, parameters)
    word, period = model.coefficients(values).gyro.word_period[0], values.processor.period
    words = max(round(period / word), 1)
    if abs(period / word - words) > CLOCK_TOLERANCE * words:
        period = word
    return Clocks(period, period / np.ceil(period / _PLANT_STEP - 1e-9))


class PlantModel(NamedTuple):
    """The plant about its operating point, and at states of the gusts whose mean square is that of all."""

    point: OperatingPoint
    mean: ModelNoise
    gusts: tuple[ModelNoise, ...]


class SensorModel(NamedTuple):
    """The sensor as a linear system with noise; stepped after the plant, it has the newest motion."""

    noise: ModelNoise
    name: str


def plant_model(clocks: Clocks, parameters: Mapping[str, float]) -> PlantModel:
    """The plant, its joints held at zero by constant torques, in the mean wind and in its gusts.

    Drag goes with the square of the wind, so that gusts act the more the stronger they are. The models of `gusts` are
    linear at points that have the mean and covariance of the wind's own distribution: the mean of their powers is exact
    for forces that are quadratic in the wind.
    """
    values = {**parameters, **clocks.plant}
    point = operating_point(PLANT, clocks.period, values, hold={"joint": 0.0}, free=TORQUE)
    mean = _plant_noise(point)
    s = mean.system
    wind = [i for i, label in enumerate(s.state_labels) if label.startswith(_WIND)]
    points = [_with_wind(point, [s.state_labels[i] for i in wind], gust) for gust in _sigma_points(mean, wind)]
    return PlantModel(point, mean, tuple(_plant_noise(one, allow_drift=True) for one in points) or (mean,))


def _plant_noise(point: OperatingPoint, allow_drift: bool = False) -> ModelNoise:
    return model_noise(
        PLANT, point.dt, operating_point=point, inputs=TORQUE, outputs=PLANT_OUTPUTS, allow_drift=allow_drift
    )


def _sigma_points(noise: ModelNoise, wind: list[int]) -> list[Array]:
    """Deviations of the wind's states: +-1 standard deviation along each principal direction of their covariance.

    Signs are those of a Hadamard matrix and its negative, so that mean and covariance of the points are exact.
    """
    if not wind:
        return []
    A, G = noise.system.A[np.ix_(wind, wind)], noise.G[wind]
    values, vectors = np.linalg.eigh(linalg.solve_discrete_lyapunov(A, G @ noise.QN @ G.T))
    wide = values > _SPREAD * values[-1]
    directions = vectors[:, wide] * np.sqrt(values[wide])
    signs = linalg.hadamard(1 << (int(wide.sum()) - 1).bit_length())[:, : wide.sum()]
    return list(np.vstack([signs, -signs]) @ directions.T)


def _with_wind(point: OperatingPoint, labels: list[str], change: Array) -> OperatingPoint:
    kind: Any = type(point.state)
    names = [leaf.name for leaf in leaves(kind)]
    values = np.array(flatten(point.state), float)
    values[[names.index(label) for label in labels]] += change
    return point._replace(state=unflatten(kind, values.tolist()))


def sensor_model(sensor: str, clocks: Clocks, parameters: Mapping[str, float | str], at: OperatingPoint) -> SensorModel:
    """The sensor on the head: true rate and specific force to what the processor reads."""
    felt = dict(zip([f"specific_force[{i}]" for i in (1, 2, 3)], at.outputs.specific_force, strict=True))
    noise = model_noise(
        sensor,
        clocks.period,
        {**IN_MOTION, **parameters, **clocks.sensor},
        operating_point=felt,
        inputs=("rate", "specific_force"),
        outputs=READINGS,
    )
    return SensorModel(noise, sensor)


def hold_response(clocks: Clocks, frequencies: Array) -> Complex:
    """Torques of the holding controller by joint angles and rates: frequencies x 3 x 6."""
    hold = model_ss(
        HOLD,
        clocks.period,
        {"mode": "hold_joints", **clocks.hold},
        inputs=("joint", "joint_rate"),
        outputs=TORQUE,
        coupling_delay=0,
    )
    return response(hold.A, hold.B, hold.C, hold.D, frequencies, clocks.period)


class Driven(NamedTuple):
    """Responses of outputs by torques, and by white noise of unit variance a step."""

    torque: Complex
    wind: Complex


def driven(noise: ModelNoise, frequencies: Array) -> Driven:
    """The plant's responses, frequencies x outputs x inputs."""
    s = noise.system
    inputs = np.hstack([s.B, noise.G @ np.sqrt(noise.QN)])
    H = response(s.A, inputs, s.C, 0.0, frequencies, s.dt)
    return Driven(H[:, :, : s.ninputs], H[:, :, s.ninputs :])


def sensor_responses(model: SensorModel, frequencies: Array) -> tuple[Complex, Complex]:
    """Readings by motion, with the newest motion read, and by the noise in units of its standard deviation."""
    noise, s = model.noise, model.noise.system
    H = response(s.A, np.hstack([s.B, noise.G @ np.sqrt(noise.QN)]), s.C, 0.0, frequencies, s.dt)
    newest = np.exp(2j * np.pi * frequencies * s.dt)[:, None, None]
    return H[:, :, : s.ninputs] * newest, H[:, :, s.ninputs :]


def held_motion(plant: PlantModel, clocks: Clocks, frequencies: Array) -> Array:
    """One-sided densities of yaw, pitch and roll (rad2/Hz) with the joints held by the holding controller."""
    K = hold_response(clocks, frequencies)
    held = slice(JOINT.start, JOINT_RATE.stop)
    found = []
    for gust in plant.gusts:
        U, W = driven(gust, frequencies)
        torque = np.linalg.solve(np.eye(3) - K @ U[:, held], K @ W[:, held])
        found.append(density(W[:, LINE] + U[:, LINE] @ torque, np.eye(W.shape[2]), clocks.period))
    return np.asarray(np.mean(found, axis=0))


class Friction(NamedTuple):
    """Plant parameters that make the joints' friction linear for a motion, and what is left of it on each joint."""

    parameters: dict[str, float]
    equivalents: tuple[EquivalentFriction | None, ...]

    @property
    def rms(self) -> Array:
        """Of those torques, N.m."""
        return np.array([0.0 if one is None else one.rms for one in self.equivalents])

    @property
    def corner(self) -> Array:
        """Of first-order low-passes that stand for their spectra, Hz."""
        return np.array([1.0 if one is None else one.corner for one in self.equivalents])

    def rest_at(self, frequencies: Array) -> Array:
        """One-sided densities of the torques (N2.m2/Hz) that the linear friction leaves: frequencies x joints."""
        none = np.zeros(len(frequencies))
        rests = [none if one is None else one.rest_at(frequencies) for one in self.equivalents]
        return np.stack(rests, axis=1)


def moving_friction(point: OperatingPoint, frequencies: Array, motion: Array) -> Friction:
    """The joints' friction for a motion of these densities, frequencies x joints.

    Raises `LinearisationRefusedError` where the friction drives the joint rather than holding it.
    """
    constants = point.model.coefficients(point.parameters).friction
    parameters: dict[str, float] = {}
    found: list[EquivalentFriction | None] = []
    for number, axis in enumerate(AXES):
        friction, given = constants[number], getattr(point.parameters.friction, axis)
        if friction.coulomb == 0.0:
            found.append(None)
            continue
        one = equivalent_friction(friction, frequencies, motion[:, number], seed=number)
        if not (one.stiffness > 0.0 and one.damping > friction.viscous):
            raise LinearisationRefusedError(
                f"{PLANT}: the friction of {axis} has no linear equivalent at this motion; choose a "
                "wind.speed at which the head moves"
            )
        parameters |= _as_parameters(f"friction.{axis}", friction, given.damping_ratio, one)
        found.append(one)
    return Friction(parameters, tuple(found))


def _as_parameters(name: str, friction: Any, ratio: float, one: EquivalentFriction) -> dict[str, float]:
    """Bristles as stiff and as damped: sigma0 = Tc/presliding, sigma1 = 2 zeta sqrt(sigma0 J)."""
    softer = one.stiffness / friction.stiffness
    damped = (one.damping - friction.viscous) / friction.damping if friction.damping else 0.0
    return {
        f"{name}.presliding": friction.coulomb / one.stiffness,
        f"{name}.damping_ratio": ratio * damped / float(np.sqrt(softer)),
    }
