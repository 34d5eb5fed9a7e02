"""What a calibration does on the turntable: schedules of rests and turns, their runs, and the means taken of each.

Calibration: at each temperature the 26 directions from a cube's middle to its faces, edges and corners point up, one
after the other, and on each face the table turns about the vertical, once round each way: at 60 deg/s with an axis up,
at 20 deg/s with it down. The table's encoders are the truth, as on a real bench: its own errors of some arcseconds are
not known, and stay in the result.

Verification: rests at other angles, over +-40 deg of pitch and roll, and other temperatures, against the true attitude.

The table goes at 60 deg/s and 60 deg/s^2, not at paper A's 10: the error of a scale found is that of the mean rate over
the rate, and 60 deg/s is within the range of every device (the smallest is 75). At each power-up the device has been
on for long at the run's temperature.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..models.attitude.rotations import REFERENCE_LATITUDE, STANDARD_GRAVITY, earth_rate_n
from ..models.attitude_sensor import SOLVER, Parameters
from ..models.plants.turntable_profile import NO_AXES, Axes
from ..models.scalar import PI
from ..models.sensors.datasheet import REFERENCE_TEMPERATURE
from ..models.sensors.thermal import ThermometerParameters, thermometer_reading
from .angle_figures import error_degrees
from .calibration import Readings
from .devices import device_parameters
from .interface import Value
from .monte_carlo import Figures, Trial
from .profiles import Profile, ProfileRow, labelled_intervals, move, profile_parameters, turn
from .recording import Results
from .system import Component, ParameterSet, System, connect

Array = NDArray[np.float64]

FMUS = ("Turntable", "AttitudeSensor")

_DEG = PI / 180.0
_RATE_LIMIT, _ACCELERATION_LIMIT = 60.0 * _DEG, 60.0 * _DEG
_FAST, _SLOW = 60.0 * _DEG, 20.0 * _DEG
TABLE_ERROR = 5.0 / 3600.0 * _DEG
"""rad, of the attitude that the encoders tell: the tolerances of axes and encoders together (engineering judgement)."""

_SETTLING = 0.2
"""s at the start of an interval in which the filters of the parts run empty; the slowest takes 0.04 s."""

_STEP = 5e-3
"""s between readings recorded: a mean over 200 Hz has the noise of one over every word, within 5 %."""

_AXES = range(1, 4)
_VERIFIED = (-40.0, -24.0, -8.0, 8.0, 24.0, 40.0)
"""deg of pitch and of roll."""


class Schedule(NamedTuple):
    """Temperatures (degC), how often the device is switched on at each of the first, the seed of all noise, and how
    long (s) it rests in each position of the calibration and of the verification."""

    calibrated: tuple[float, ...] = (-5.0, 5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0)
    verified: tuple[float, ...] = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
    power_ups: int = 2
    seed: int = 1
    rest: float = 10.0
    verified_rest: float = 5.0


FULL = Schedule()
QUICK = Schedule((-5.0, 18.0, 42.0, 65.0), (0.0, 30.0, 60.0), 1)


class Piece(NamedTuple):
    """The sensor to be calibrated: piece `specimen` of a device, with these settings of its own parameters."""

    device: str
    specimen: int
    settings: Mapping[str, Value] = {}

    def parameters(self, component: str = "sensor") -> dict[str, Value]:
        """What the device and the settings say about the sensor that is called `component`."""
        prefix = f"{component}." if component else ""
        own = {f"{prefix}{name}": value for name, value in self.settings.items()}
        return {**device_parameters(self.device, self.specimen, component).values, **own}


# --- calibration -----------------------------------------------------------------------------------------------------


def _toward(x: float, y: float, z: float) -> Axes:
    """Table angles at which the direction (x, y, z) of the sensor points up."""
    return Axes(0.0, math.atan2(y, math.hypot(x, z)), math.atan2(-x, z))


def _direction(signs: tuple[int, ...]) -> str:
    return "".join(f"{'+' if sign > 0 else '-'}{axis}" for sign, axis in zip(signs, "xyz", strict=True) if sign) + " up"


def calibration_profile(celsius: float, rest: float) -> Profile:
    """Rests and turns at one temperature of the chamber."""
    rows: list[ProfileRow] = []
    for signs in itertools.product((0, 1, -1), repeat=3):
        if not any(signs):
            continue
        label = _direction(signs)
        rows.append(move(label, _toward(*signs), rest, temperature=celsius + 273.15))
        if sum(map(abs, signs)) == 1:
            rate = _FAST if sum(signs) > 0 else _SLOW
            for way, about in ((1.0, "clockwise"), (-1.0, "back")):
                name = f"{label}, {rate / _DEG:.0f} deg/s {about}"
                rows.append(turn(name, Axes(way * rate, 0.0, 0.0), 2.0 * PI / rate))
    return Profile(f"calibration {celsius:g} degC", tuple(rows))


def calibration_trials(dist: Path, piece: Piece, schedule: Schedule) -> list[Trial]:
    """A run for each temperature and power-up, each with noise of its own."""
    trials = []
    for number, (celsius, again) in enumerate(itertools.product(schedule.calibrated, range(schedule.power_ups))):
        profile = calibration_profile(celsius, schedule.rest)
        system = _bench(dist, piece, profile, schedule.seed + number)
        name = f"calibration/{celsius:g}_degC_{again + 1}"
        trials.append(_trial(name, system, profile, partial(calibration_means, profile), _CALIBRATION_RECORD))
    return trials


def _vector(name: str) -> tuple[str, ...]:
    return tuple(f"{name}[{i}]" for i in _AXES)


_CODES = ("sensor.register.gyro_temperature", "sensor.register.accelerometer_temperature")
_ENCODERS = tuple(f"table.{name}.{axis}" for name in ("axis_angle", "axis_rate") for axis in Axes._fields)
_READ = (*_vector("sensor.rate_measured"), *_vector("sensor.specific_force_measured"))
_WHERE = ("table.row", "table.resting", "table.turning")
_CALIBRATION_RECORD = (*_READ, *_CODES, *_ENCODERS, *_WHERE)


def calibration_means(profile: Profile, results: Results) -> dict[str, Array]:
    """Means over each rest and turn: what the parts read, and what the encoders say they should have read."""
    found = []
    for interval in labelled_intervals(profile, results):
        taken = interval._replace(start=interval.start + _SETTLING).of(results)
        rate, force = encoder_truth(_columns(taken, _ENCODERS))
        read = np.mean(_columns(taken, (*_READ, *_CODES)), axis=1)
        resting = 1.0 if interval.kind == "move" else 0.0
        found.append(
            np.concatenate((np.mean(rate, axis=0), np.mean(force, axis=0), read, [resting, len(taken) * _STEP]))
        )
    means = np.array(found)
    names = {"true_rate": 3, "true_force": 3, "rate": 3, "force": 3, "codes": 2, "resting": 1, "duration": 1}
    return dict(zip(names, np.split(means, np.cumsum(list(names.values()))[:-1], axis=1), strict=True))


def _columns(results: Results, names: Sequence[str]) -> Array:
    return np.array([results[name] for name in names], dtype=np.float64)


def encoder_truth(encoders: Array, latitude: float = REFERENCE_LATITUDE) -> tuple[Array, Array]:
    """w_ib_b and f_b (n, 3) on a flawless table whose encoders tell angles and rates of the three axes (6, n).

    w = Ry(-i) (Rx(-m) ((0, 0, -o') + Rz(o) w_ie) + (m', 0, 0)) + (0, i', 0), and f likewise from (0, 0, g).
    """
    outer, middle, inner, outer_rate, middle_rate, inner_rate = encoders
    _, north, up = earth_rate_n(latitude)
    still = np.zeros_like(outer)
    rate = np.array((-north * np.sin(outer), north * np.cos(outer), up - outer_rate))
    rate = _turned(rate, 0, middle) + np.array((middle_rate, still, still))
    rate = _turned(rate, 1, inner) + np.array((still, inner_rate, still))
    force = np.array((still, still, still + STANDARD_GRAVITY))
    return rate.T, _turned(_turned(force, 0, middle), 1, inner).T


def _turned(vector: Array, axis: int, angle: Array) -> Array:
    """Components (3, n) in a frame that is turned by `angle` about x, y or z (0, 1, 2)."""
    j, k = (axis + 1) % 3, (axis + 2) % 3
    after = vector.copy()
    after[j] = np.cos(angle) * vector[j] + np.sin(angle) * vector[k]
    after[k] = np.cos(angle) * vector[k] - np.sin(angle) * vector[j]
    return after


def readings_of(figures: Sequence[Figures], p: Parameters) -> tuple[Readings, Readings]:
    """What the runs, each a power-up of its own, say about the gyros and about the accelerometers.

    The accelerometers' are rests only: turning, they would feel how far they sit from the axis.
    """
    power_up = np.repeat(np.arange(len(figures)), [len(one["rate"]) for one in figures])
    column = {name: np.concatenate([one[name] for one in figures]) for name in figures[0]}
    rest = column["resting"][:, 0] > 0.5
    force, duration, codes = column["true_force"], column["duration"][:, 0], column["codes"]
    gyro_warmth, warmth = _warmth(p.gyro.thermometer, codes[:, 0]), _warmth(p.accelerometer.thermometer, codes[:, 1])
    gyro = Readings(column["true_rate"], column["rate"], force, gyro_warmth, duration, power_up)
    part = Readings(force, column["force"], force, warmth, duration, power_up)
    return gyro, Readings._make(values[rest] for values in part)


def _warmth(thermometer: ThermometerParameters, codes: Array) -> Array:
    """What the thermometer reads above 25 degC, K, as the processor makes it of the codes."""
    return np.array([thermometer_reading(thermometer, code) for code in codes]) - REFERENCE_TEMPERATURE


# --- verification ----------------------------------------------------------------------------------------------------

Case = Literal["before", "after", "repeatable"]
CASES: tuple[Case, ...] = ("before", "after", "repeatable")
"""Without compensation, with it, and with it in a world where nothing is random: no noise, flicker, turn-on bias."""

_RANDOM = ("noise_density", "bias_instability", "rate_random_walk", "turn_on_bias")
_REPEATABLE: dict[str, Value] = {f"sensor.{part}.{name}": 0.0 for part in ("gyro", "accelerometer") for name in _RANDOM}
_VERIFICATION_RECORD = (
    *(f"{component}.euler.{angle}" for component in ("sensor", "table") for angle in ("pitch", "roll")),
    *_vector("sensor.rate_measured"),
    *_vector("table.rate"),
    *_WHERE,
)


def verification_profile(celsius: float, rest: float) -> Profile:
    """Rests over +-40 deg of pitch and roll at one temperature."""
    rows = [
        move(f"pitch {pitch:g} deg, roll {roll:g} deg", Axes(0.0, pitch * _DEG, roll * _DEG), rest)
        for pitch in _VERIFIED
        for roll in (_VERIFIED if _VERIFIED.index(pitch) % 2 == 0 else _VERIFIED[::-1])
    ]
    return Profile(f"verification {celsius:g} degC", (rows[0]._replace(temperature=celsius + 273.15), *rows[1:]))


def verification_trials(
    dist: Path, piece: Piece, schedule: Schedule, values: Mapping[str, Value]
) -> dict[Case, list[Trial]]:
    """A run for each case and temperature, each temperature a power-up that the calibration has not seen.

    `values` are the sensor's parameters that the calibration gave.
    """
    compensated = {f"sensor.{name}": value for name, value in values.items()}
    given: dict[Case, Mapping[str, Value]] = {
        "before": {},
        "after": compensated,
        "repeatable": {**compensated, **_REPEATABLE},
    }
    trials: dict[Case, list[Trial]] = {case: [] for case in CASES}
    for number, celsius in enumerate(schedule.verified):
        profile = verification_profile(celsius, schedule.verified_rest)
        for case in CASES:
            system = _bench(dist, piece, profile, schedule.seed + 100_000 + number).with_values(case, given[case])
            take = partial(verification_errors, profile)
            trials[case].append(_trial(f"{case}/{celsius:g}_degC", system, profile, take, _VERIFICATION_RECORD))
    return trials


def verification_errors(profile: Profile, results: Results) -> dict[str, Array]:
    """Of each rest: true pitch and roll (deg), the errors of the mean (deg), those of the mean rates (deg/s)."""
    angles, tilts, rates = [], [], []
    for interval in labelled_intervals(profile, results):
        taken = interval._replace(start=interval.start + _SETTLING).of(results)
        angles.append([np.degrees(np.mean(taken[f"table.euler.{angle}"])) for angle in ("pitch", "roll")])
        off = [error_degrees(taken, f"sensor.euler.{angle}", f"table.euler.{angle}") for angle in ("pitch", "roll")]
        tilts.append(np.mean(off, axis=1))
        rates.append(
            [np.degrees(np.mean(taken[f"sensor.rate_measured[{i}]"] - taken[f"table.rate[{i}]"])) for i in _AXES]
        )
    return {"angles": np.array(angles), "tilt_errors": np.array(tilts), "rate_errors": np.array(rates)}


# --- the bench -------------------------------------------------------------------------------------------------------


def _bench(dist: Path, piece: Piece, profile: Profile, seed: int) -> System:
    """The piece on the table that runs `profile`, levelled from every reading, without alignment."""
    run: dict[str, Value] = {
        "sensor.seed": seed,
        "sensor.solver.kind": SOLVER.value("levelling"),
        "sensor.alignment.duration": 0.0,
        "table.period": _STEP,
        **{f"table.axis.{axis}.rate_limit": _RATE_LIMIT for axis in Axes._fields},
        **{f"table.axis.{axis}.acceleration_limit": _ACCELERATION_LIMIT for axis in Axes._fields},
    }
    return System(
        "calibration",
        tuple(Component(name, dist / f"{fmu}.fmu") for name, fmu in zip(("table", "sensor"), FMUS, strict=True)),
        connect("table", "sensor", "rate[:3]", "specific_force[:3]", "angular_acceleration[:3]", "temperature"),
        (ParameterSet("piece", piece.parameters()), profile_parameters(profile), ParameterSet("run", run)),
        description="An attitude sensor on a turntable in a temperature chamber",
    )


def _trial(name: str, system: System, profile: Profile, take: Any, record: tuple[str, ...]) -> Trial:
    return Trial(name, system, take, _span(profile), record, _STEP, order="gauss-seidel")


def _span(profile: Profile) -> float:
    """s that a run takes, and some: every row at its axes' limits, with what servo and sequencer need to settle."""
    ramp = _RATE_LIMIT / _ACCELERATION_LIMIT
    angle, total = NO_AXES, 1.0
    for row in profile.rows:
        if row.kind == "move":
            way = max(abs(to - now) for to, now in zip(row.angle, angle, strict=True))
            angle, moving = row.angle, way / _RATE_LIMIT + ramp
        else:
            # both ways, one after the other, end where they began, but for a ramp
            moving = 2.0 * ramp
        total += moving + row.duration + 0.3
    return math.ceil(total)
