"""The stabilised head's loop: margins, disturbance rejection, and the jitter of its line of sight by cause.

    y = (readings of the sensor, joint angles),   torque u = K y,   L = -K P_yu at the motors

All from frequency responses of plant, sensor and controller.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..errors import LinearisationRefusedError
from ..report import EXPOSURE
from .conditioning import Array
from .folding import closure
from .head_models import (
    FORCE,
    JOINT,
    LINE,
    RATE,
    Clocks,
    Driven,
    Friction,
    PlantModel,
    SensorModel,
    driven,
    sensor_responses,
)
from .margins import Margins, disk_margin, loop_at_a_time, margins, sensitivity
from .noise import ModelNoise
from .responses import Complex, density, jitter_of, response

_SLOWEST = 0.01
"""Hz; slower motion counts for nothing within an exposure of a second."""

_AT_REST = 1e-6
"""Hz; where an integrator's gain is still finite."""

_FINE = (3.0, 30.0)
"""Hz, where tripods and vortices resonate."""

MOTION = slice(RATE.start, FORCE.stop)
"""What of the plant's outputs the sensor feels."""

CAUSES = ("wind", "friction", "gyro noise", "accelerometer noise", "rounding")


class Head(NamedTuple):
    """Plant, sensor and what friction leaves, with responses at `frequencies` (Hz).

    `mean` and `gusts` are the plant's, `readings` and `noises` the sensor's by motion and by noise, `friction` the
    densities (N2.m2/Hz) of torques that the linear friction leaves.
    """

    clocks: Clocks
    plant: PlantModel
    sensor: SensorModel
    frequencies: Array
    mean: Driven
    gusts: tuple[Driven, ...]
    readings: Complex
    noises: Complex
    friction: Array

    def thinned(self, every: int) -> Head:
        """The head at every so many frequencies, in the mean wind only."""
        mean = Driven(*[H[::every] for H in self.mean])
        return self._replace(
            frequencies=self.frequencies[::every],
            mean=mean,
            gusts=(mean,),
            readings=self.readings[::every],
            noises=self.noises[::every],
            friction=self.friction[::every],
        )


class Controller(NamedTuple):
    """x+ = A x + B y, u = C x + D y, and the gain that leads x where a limit cuts u."""

    A: Array
    B: Array
    C: Array
    D: Array
    anti_windup: Array | str


class Controlled(NamedTuple):
    """Responses of a closed loop: K; S at the motors; yaw, pitch and roll by torque at the motors, and by readings."""

    controller: Complex
    sensitivity: Complex
    by_torque: Complex
    by_reading: Complex


class Loop(NamedTuple):
    """A closed loop: responses, each motor's gain with the others closed, margins, densities by cause (rad2/Hz).

    `disk` is the disk margin at each frequency, `radius` the largest magnitude of the loop's eigenvalues.
    """

    head: Head
    responses: Controlled
    single: Complex
    margins: tuple[Margins, ...]
    disk: Array
    spectra: Mapping[str, Array]
    radius: float

    @property
    def spectrum(self) -> Array:
        """All causes together."""
        return np.asarray(sum(self.spectra.values()))

    def jitter(self, cause: str | None = None) -> Array:
        """Rms of yaw, pitch and roll within exposures, rad."""
        return exposure_jitter(self.spectrum if cause is None else self.spectra[cause], self.head)


def exposure_jitter(spectrum: Array, head: Head) -> Array:
    """Rms of yaw, pitch and roll within exposures (rad) of densities."""
    return jitter_of(spectrum, head.frequencies, EXPOSURE, head.clocks.period)


def line_of_sight(jitter: Array) -> float:
    """Rms of the line of sight, which yaw and pitch move and roll does not."""
    return float(np.hypot(jitter[0], jitter[1]))


def grid(clocks: Clocks) -> Array:
    """Frequencies (Hz) from next to rest to Nyquist's, denser where tripods resonate."""
    nyquist = 0.5 / clocks.period
    middle = np.geomspace(_SLOWEST, 0.9995 * nyquist, 700)
    return np.unique(np.concatenate([[_AT_REST], middle, np.linspace(*_FINE, 200), [nyquist]]))


def head_of(plant: PlantModel, sensor: SensorModel, clocks: Clocks, friction: Friction) -> Head:
    """The head with all its responses."""
    f = grid(clocks)
    gusts = tuple(driven(gust, f) for gust in plant.gusts)
    readings, noises = sensor_responses(sensor, f)
    return Head(clocks, plant, sensor, f, driven(plant.mean, f), gusts, readings, noises, friction.rest_at(f))


def _measured(motion: Complex, readings: Complex) -> Complex:
    """What the controller sees of the plant's outputs."""
    return np.concatenate([readings @ motion[:, MOTION], motion[:, JOINT]], axis=1)


def controlled(head: Head, K: Complex, plant: Driven | None = None) -> Controlled:
    """The loop closed by a controller of the response K, in the mean wind or about another point of the plant."""
    plant = head.mean if plant is None else plant
    seen, line = _measured(plant.torque, head.readings), plant.torque[:, LINE]
    S = sensitivity(-K @ seen)
    by_torque = line @ S
    return Controlled(K, S, by_torque, by_torque @ K)


def single_loops(loop: Controlled) -> Complex:
    """Each motor's loop gain with the others closed."""
    return loop_at_a_time(loop.sensitivity)


def spectra(head: Head, loop: Controlled) -> dict[str, Array]:
    """Densities of yaw, pitch and roll (rad2/Hz) by cause."""
    found = {"wind": np.mean([_wind(head, loop.controller, plant) for plant in head.gusts], axis=0)}
    found["friction"] = np.einsum("fij,fj->fi", np.abs(loop.by_torque) ** 2, head.friction)
    for cause, chosen in _noises(head.sensor.noise.names).items():
        H = loop.by_reading[:, :, : head.readings.shape[1]] @ head.noises[:, :, chosen]
        found[cause] = density(H, np.eye(len(chosen)), head.clocks.period)
    return found


def jitter_of_parts(head: Head, loop: Controlled) -> Array:
    """Rms of yaw, pitch and roll within exposures, rad."""
    return exposure_jitter(np.asarray(sum(spectra(head, loop).values())), head)


def closed_loop(head: Head, controller: Controller) -> Loop:
    """The loop of a head and a controller of the nine signals: readings of gyros and accelerometers, joint angles."""
    A, B, C, D, _ = controller
    loop = controlled(head, response(A, B, C, D, head.frequencies, head.clocks.period))
    single = single_loops(loop)
    return Loop(
        head,
        loop,
        single,
        tuple(margins(single[:, i], head.frequencies) for i in range(single.shape[1])),
        disk_margin(loop.sensitivity),
        spectra(head, loop),
        radius(head, controller),
    )


def _wind(head: Head, K: Complex, plant: Driven) -> Array:
    loop = controlled(head, K, plant)
    line = plant.wind[:, LINE] + loop.by_reading @ _measured(plant.wind, head.readings)
    return density(line, np.eye(line.shape[2]), head.clocks.period)


def _noises(names: list[str]) -> dict[str, list[int]]:
    """Places of the sensor's noises by cause."""
    found: dict[str, list[int]] = {cause: [] for cause in CAUSES[2:]}
    for place, name in enumerate(names):
        part = "accelerometer noise" if "accelerometer" in name else "gyro noise"
        found["rounding" if "rounding" in name else part].append(place)
    return found


def radius(head: Head, controller: Controller, plant: ModelNoise | None = None) -> float:
    """Largest magnitude of the closed loop's eigenvalues, in the mean wind or about another point of the plant.

    The states of the sensor that motion does not reach, those of its noise, are no part of the loop.
    """
    p, s = (plant or head.plant.mean).system, head.sensor.noise.system
    A, B, C, D, _ = controller
    moved_by = closure(s.A != 0.0, np.any(s.B != 0.0, axis=1))
    own, felt, read = s.A[np.ix_(moved_by, moved_by)], s.B[moved_by], s.C[:, moved_by]
    n, m = p.nstates, len(own)
    moved = felt @ p.C[MOTION]
    open_loop = np.block([[p.A, np.zeros((n, m))], [moved @ p.A, own]])
    drive = np.vstack([p.B, moved @ p.B])
    seen = np.block([[np.zeros((s.noutputs, n)), read], [p.C[JOINT], np.zeros((3, m))]])
    poles = np.linalg.eigvals(np.block([[open_loop + drive @ D @ seen, drive @ C], [B @ seen, A]]))
    return float(np.abs(poles).max())


def check_gusts(head: Head, controller: Controller) -> None:
    """Raise `LinearisationRefusedError` where a loop that is stable in the mean wind is not in its gusts."""
    largest = max(radius(head, controller, gust) for gust in head.plant.gusts)
    if largest >= 1.0:
        raise LinearisationRefusedError(
            f"the loop is unstable in gusts of one standard deviation (radius {largest:.7g}): choose a lower "
            "plant.wind.speed or plant.wind.turbulence"
        )
