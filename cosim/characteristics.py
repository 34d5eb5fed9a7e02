"""What a modelled sensor does, measured on its FMU: noise, frequency and step response, calibration, temperature.

Every measurement runs the FMU on a `bench` and reads the parts' registers, in rad/s and m/s^2. A `Sensor` is the FMU
with the parameter values of a device; `quiet` switches its errors off, all or all but the ones to be measured, and
`fine` makes the register's steps too small to be seen.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from attitude_fmu.models.attitude.rotations import STANDARD_GRAVITY

from .allan import AllanDeviation, allan_deviation, chi_squared_bounds, pooled
from .bench import FORCE, RATE, TEMPERATURE, Array, Bench, Benches, Record
from .errors import SystemRefusedError
from .interface import Value

Part = Literal["gyro", "accelerometer"]
PARTS: tuple[Part, ...] = ("gyro", "accelerometer")
INPUTS: dict[Part, tuple[str, ...]] = {"gyro": RATE, "accelerometer": FORCE}

ERRORS = (
    "noise_density",
    "bias_instability",
    "rate_random_walk",
    "turn_on_bias",
    "clock_error",
    "clock_jitter",
    "bias",
    "bias_temperature_slope",
    "bias_temperature_curve",
    "hysteresis",
    "supply_sensitivity",
    "scale_error",
    "scale_temperature_slope",
    "scale_temperature_curve",
    "nonlinearity",
    "cross_axis",
    "nonorthogonality",
    "misalignment",
    "g_sensitivity",
    "rectification",
    "thermal.self_heating",
    "thermometer.error",
)
"""Parameters of a part that are zero in a perfect one."""

NOISES = ("noise_density", "bias_instability", "rate_random_walk", "turn_on_bias", "clock_jitter")
"""Those of them that draw random numbers."""

_FINEST = 2**30
"""Codes to full scale where the register's steps are not to be seen."""

_SLOW_PERIOD = 0.1
"""s between steps of the model's temperatures and wandering offsets."""

_MOST_STEPS = 6_000_000
_LINES = 40
_BINS_TO_CUTOFF = 32
_FIRST_WORDS = 16
"""Words that the filters other than a Bartlett window take to forget."""

_FORGOTTEN = 16.0
"""Time constants of the analogue pole that leave 1e-7 of a step."""

CELSIUS_ZERO = 273.15


class Sensor(NamedTuple):
    """The FMU, and the parameter values of the device that it plays."""

    benches: Benches
    values: Mapping[str, Value]

    def number(self, name: str) -> float:
        """The value of a parameter as a number."""
        variable = self.benches.interface.variables[name]
        given = self.values.get(name, variable.start)
        return float(variable.value(0.0 if given is None else given))

    def item(self, name: str) -> str:
        """The name of the choice that an enumeration stands at."""
        chosen = self.number(name)
        return next(item.name for item in self.benches.interface.variables[name].items if item.value == chosen)

    def but(self, *changes: Mapping[str, Value]) -> Sensor:
        """The same sensor with other values here and there."""
        values = dict(self.values)
        for change in changes:
            values.update(change)
        return Sensor(self.benches, values)

    def bench(self) -> Bench:
        """A bench with this sensor, which is at rest in free fall until it is driven."""
        return self.benches.bench({**dict.fromkeys(FORCE, 0.0), **self.values})


def quiet(sensor: Sensor, *, but: Iterable[str] = ()) -> dict[str, Value]:
    """Zero for every error of the parts `but` those named, in whatever shape the FMU has them."""
    silenced = set(ERRORS) - set(but)
    stems = {f"{part}.{error}" for part in PARTS for error in silenced}
    return {name: 0.0 for name in sensor.benches.interface.variables if name.partition("[")[0] in stems}


def fine(sensor: Sensor) -> dict[str, Value]:
    """Registers of 2^30 codes to full scale."""
    values: dict[str, Value] = {}
    for part in PARTS:
        values[f"{part}.resolution"] = sensor.number(f"{part}.range") / _FINEST
        values[f"{part}.code_limit"] = 2**31 - 1
    return values


_STEADY: dict[str, Value] = {"accelerometer.high_pass": "none"}
"""The high-pass off, which would let nothing steady pass."""


def perfect(sensor: Sensor, *, but: Iterable[str] = ()) -> Sensor:
    """The sensor without errors `but` those named, high-pass and visible register steps; low-passes are left."""
    return sensor.but(quiet(sensor, but=but), fine(sensor), _STEADY)


def readings(sensor: Sensor, part: Part, record: Record) -> Array:
    """Register codes of a part as rad/s or m/s^2, (n, 3)."""
    codes = record.gyro if part == "gyro" else record.accelerometer
    return np.asarray(codes * sensor.number(f"{part}.resolution"), np.float64)


class Clockwork(NamedTuple):
    """A part's periods in s: of a sample that enters its filter, of a register word; `ticks` samples a word."""

    sample: float
    word: float

    @property
    def ticks(self) -> int:
        return round(self.word / self.sample)


def clockworks(sensor: Sensor, part: Part) -> tuple[Clockwork, Clockwork, Clockwork]:
    """Periods of the clock of each axis as the FMU calculates them; an accelerometer has one clock."""
    with sensor.bench() as bench:

        def of(axis: int) -> Clockwork:
            place = f"[{axis}]" if part == "gyro" else ""
            return Clockwork(*[bench.value(f"coefficient.{part}.{name}_period{place}") for name in ("sense", "word")])

        return of(1), of(2), of(3)


def clockwork(sensor: Sensor, part: Part) -> Clockwork:
    """Those of the first axis."""
    return clockworks(sensor, part)[0]


# --- at rest ---------------------------------------------------------------------------------------------------------


class AtRest(NamedTuple):
    """Readings of a part at rest, (n, 3) at `rate` (Hz)."""

    rate: float
    readings: Array

    @property
    def duration(self) -> float:
        return len(self.readings) / self.rate

    def allan(self, taus: Sequence[float] | None = None) -> list[AllanDeviation]:
        """Allan deviation of each axis."""
        return [allan_deviation(self.readings[:, axis], self.rate, taus) for axis in range(3)]

    def pooled_allan(self, taus: Sequence[float] | None = None) -> AllanDeviation:
        """Allan deviation of the three axes together."""
        return pooled(self.allan(taus))


def at_rest(sensor: Sensor, duration: float, period: float | None = None) -> dict[Part, AtRest]:
    """Readings of both parts, level and without rotation, for so long (s).

    Read every `period` (s), else at each part's nominal word rate; parts of different word rates in runs of their own.
    """
    level = sensor.but({FORCE[2]: STANDARD_GRAVITY})
    if period is not None:
        return _rested(level, duration, period, PARTS)
    nominal = sensor.but(quiet(sensor, but=set(ERRORS) - {"clock_error"}))
    words = {part: clockwork(nominal, part).word for part in PARTS}
    if math.isclose(words["gyro"], words["accelerometer"], rel_tol=1e-6):
        return _rested(level, duration, words["gyro"], PARTS)
    return {part: _rested(level, duration, words[part], (part,))[part] for part in PARTS}


def _rested(sensor: Sensor, duration: float, period: float, parts: Sequence[Part]) -> dict[Part, AtRest]:
    steps = min(max(100, round(duration / period)), _MOST_STEPS)
    with sensor.bench() as bench:
        record = bench.record(period, steps)
    return {part: AtRest(1.0 / period, readings(sensor, part, record)) for part in parts}


class Estimate(NamedTuple):
    """A measured number and the limits of its 95 % interval."""

    value: float
    low: float
    high: float


def white_density(rest: AtRest, low: float, high: float) -> Estimate:
    """D^2 = <2 |X(f)|^2/(n rate)>: one-sided density of the three axes in the band (Hz), by periodograms (unit/Hz^0.5).

    Each line of each axis has two degrees of freedom.
    """
    count = len(rest.readings)
    frequency = np.fft.rfftfreq(count, 1.0 / rest.rate)
    band = (frequency >= low) & (frequency <= high)
    lines = np.abs(np.fft.rfft(rest.readings - np.mean(rest.readings, axis=0), axis=0)[band]) ** 2
    density = 2.0 * float(np.mean(lines)) / (count * rest.rate)
    return _rooted(density, 2.0 * lines.size)


def _rooted(variance: float, freedom: float) -> Estimate:
    least, most = chi_squared_bounds(freedom, 0.95)
    return Estimate(
        math.sqrt(variance), math.sqrt(variance * freedom / float(most)), math.sqrt(variance * freedom / float(least))
    )


def deviation_at(rest: AtRest, tau: float) -> Estimate:
    """Allan deviation of the three axes together at one cluster time (s)."""
    found = rest.pooled_allan((tau,))
    return Estimate(float(found.deviation[0]), float(found.low[0]), float(found.high[0]))


def white_noise_alone(sensor: Sensor, duration: float) -> dict[Part, AtRest]:
    """At rest with white noise and no other error."""
    return at_rest(perfect(sensor, but=("noise_density",)), duration)


def wander_alone(sensor: Sensor, term: str, duration: float) -> dict[Part, AtRest]:
    """At rest with bias instability or rate random walk (`term`) and no other error, read as often as it changes."""
    return at_rest(perfect(sensor, but=(term,)), duration, _SLOW_PERIOD)


# --- responses -------------------------------------------------------------------------------------------------------


class Response(NamedTuple):
    """From the input to its register word: frequencies (Hz), complex gain, -3 dB frequency (Hz, NaN if it lies beyond
    the highest) and delay at low frequencies (s)."""

    frequency: Array
    gain: NDArray[np.complex128]
    cutoff: float
    delay: float

    @property
    def decibels(self) -> Array:
        """20 log10 |gain|."""
        return np.asarray(20.0 * np.log10(np.maximum(np.abs(self.gain), 1e-12)))

    @property
    def delays(self) -> Array:
        """-phase/(2 pi f) in s, the phase followed from one frequency to the next."""
        # turned back by the delay at low frequencies, little is left to follow
        late = np.exp(2j * np.pi * self.frequency * self.delay)
        return np.asarray(self.delay - np.unwrap(np.angle(self.gain * late)) / (2.0 * np.pi * self.frequency))

    def frequency_of(self, decibels: float) -> float:
        """The lowest frequency (Hz) at which the gain has fallen so far, NaN if it never does."""
        shown = self.decibels
        below = np.flatnonzero(shown <= decibels)
        if not len(below) or below[0] == 0:
            return math.nan
        last = int(below[0])
        pair = slice(last - 1, last + 1)
        return float(np.interp(-decibels, -shown[pair], self.frequency[pair]))


Axes = tuple[Response, Response, Response]


def frequency_response(sensor: Sensor, part: Part, reference: float, *, folded: bool = False) -> Axes:
    """H(f) = Y(f)/U(f) of one multi-sine, of each axis at its own clock, without other errors than that of the clock.

    `reference` (Hz) is about the cutoff at the nominal clock. Each sine is a whole number of turns in the record; each
    word counts at the tick at which it can be read first. With `folded` the frequencies are the word rate less these:
    what words show at the same frequencies as they do.

    Raises `SystemRefusedError` for a reference that is no frequency.
    """
    if not (math.isfinite(reference) and reference > 0.0):
        raise SystemRefusedError(f"reference = {reference} Hz: wanted is a positive frequency, about the cutoff")
    clean = perfect(sensor, but=("clock_error",))
    clocks = clockworks(clean, part)
    nominal = clockwork(perfect(sensor), part).word
    records = {clock: _swept(clean, part, clock, reference * nominal / clock.word, folded) for clock in set(clocks)}
    x, y, z = (records[clock][axis] for axis, clock in enumerate(clocks))
    return x, y, z


def _swept(clean: Sensor, part: Part, clock: Clockwork, reference: float, folded: bool) -> list[Response]:
    """The responses of all axes in one record at this clock; only of those axes that have it are they right."""
    words = max(64, round(_BINS_TO_CUTOFF / (reference * clock.word)))
    bins = words - _bins(words)[::-1] if folded else _bins(words)
    ticks = clock.ticks
    first = _settling_words(clean, part) * ticks
    phase = np.arange(1, first + words * ticks + ticks + 1) / (words * ticks)
    amplitude = 0.4 * clean.number(f"{part}.range")
    # Schroeder's phases keep the sum low
    start = -np.pi * np.arange(len(bins)) ** 2 / len(bins)
    wave = np.zeros(len(phase))
    for number, turn in zip(bins, start, strict=True):
        wave += np.cos(2.0 * np.pi * number * phase + turn)
    peak = float(np.max(np.abs(wave)))
    driven = _driven(clean, part, clock, amplitude / peak * wave)
    frequency = bins / (words * clock.word)
    found = []
    for axis in range(3):
        rows = _word_rows(driven[:, axis], ticks, first, words)
        turned = np.exp(-2j * np.pi * np.outer(bins, phase[rows]))
        gain = (turned @ driven[rows, axis]) * (2.0 * peak / (amplitude * words)) * np.exp(-1j * start)
        plain = Response(frequency, gain, math.nan, math.nan)
        found.append(plain if folded else _response(frequency, gain, reference))
    return found


def _bins(words: int) -> NDArray[np.int64]:
    """Turns of each sine in the record: dense where the cutoff is looked for, all below half the word rate."""
    highest = (words - 1) // 2
    spread = np.geomspace(1, min(highest, 4 * _BINS_TO_CUTOFF), _LINES)
    near = np.arange(_BINS_TO_CUTOFF - 6, _BINS_TO_CUTOFF + 7)
    bins = np.unique(np.round(np.concatenate((spread, near))).astype(np.int64))
    return bins[bins <= highest]


def _response(frequency: Array, gain: NDArray[np.complex128], reference: float) -> Response:
    low = frequency <= 0.1 * reference
    phase = np.unwrap(np.angle(gain[low]))
    phase -= 2.0 * np.pi * round(phase[0] / (2.0 * np.pi))
    delay = -float(phase @ frequency[low]) / (2.0 * np.pi * float(frequency[low] @ frequency[low]))
    found = Response(frequency, gain, math.nan, delay)
    return found._replace(cutoff=found.frequency_of(-10.0 * math.log10(2.0)))


def _settling_words(sensor: Sensor, part: Part) -> int:
    kind = sensor.item(f"{part}.filter")
    _, is_window, taps = kind.partition("bartlett_")
    words = 2 * int(taps) + 8 if is_window else _FIRST_WORDS
    if kind == "decimator":
        return words
    pole = _FORGOTTEN / (2.0 * math.pi * sensor.number(f"{part}.bandwidth"))
    return words + math.ceil(pole / clockwork(sensor, part).word)


def _driven(sensor: Sensor, part: Part, clock: Clockwork, wave: Array) -> Array:
    """Readings (n, 3) after each sample of the part's clock, all axes having been given the wave (n,)."""
    with sensor.bench() as bench:
        record = bench.record(clock.sample, len(wave), INPUTS[part], np.repeat(wave[:, None], 3, axis=1))
    return readings(sensor, part, record)


def _word_rows(driven: Array, ticks: int, first: int, words: int) -> NDArray[np.int64]:
    """The rows of an axis at which a new word appeared, `words` of them from row `first` or soon after on."""
    changed = np.flatnonzero(np.diff(driven[first:]) != 0.0) + 1
    fresh = int(np.argmax(np.bincount(changed % ticks, minlength=ticks)))
    return first + fresh + ticks * np.arange(words)


class StepResponse(NamedTuple):
    """Time since the step (s) and share of it that a word read then shows; by many steps, as words come but now and
    then. `half` is the time at which half of the step is passed."""

    time: Array
    share: Array

    @property
    def half(self) -> float:
        return float(np.interp(0.5, self.share, self.time))


def step_response(sensor: Sensor, part: Part, edges: int = 16) -> StepResponse:
    """Of the first axis: a square wave whose edges fall at ever other moments between two words, at its own clock."""
    clean = perfect(sensor, but=("clock_error",))
    clock = clockwork(clean, part)
    shift = max(1, 2 * clock.ticks // edges)
    half = _settling_words(clean, part) * clock.ticks + shift
    size = 0.25 * clean.number(f"{part}.range")
    wave = np.tile(np.repeat([0.0, size], half), edges // 2 + 1)
    driven = _driven(clean, part, clock, wave)[:, 0] / size
    fresh = np.flatnonzero(np.diff(driven) != 0.0) + 1
    edge = half * (fresh // half)
    kept = edge > 0
    fresh, edge = fresh[kept], edge[kept]
    rising = wave[edge] > 0.0
    # the step was somewhere between two samples: half a period before the first that shows it
    time = np.asarray((fresh - edge + 0.5) * clock.sample, np.float64)
    share = np.where(rising, driven[fresh], 1.0 - driven[fresh])
    order = np.argsort(time, kind="stable")
    return StepResponse(time[order], np.maximum.accumulate(share[order]))


class Setting(NamedTuple):
    """One setting of a part's digital filter: what a sheet calls it, and the values that choose it."""

    label: str
    values: Mapping[str, Value]


def filter_settings(sensor: Sensor, part: Part) -> tuple[Setting, ...]:
    """Every setting of the part's digital filter: output data rates, or taps; one alone where there is no choice."""
    interface = sensor.benches.interface
    kind = sensor.item(f"{part}.filter")
    if kind == "decimator":
        items = interface.variables[f"{part}.output_data_rate"].items
        return tuple(Setting(item.name.replace("_", "."), {f"{part}.output_data_rate": item.name}) for item in items)
    if kind.startswith("bartlett_"):
        items = interface.variables[f"{part}.filter"].items
        names = [item.name for item in items if item.name.startswith("bartlett_")]
        # the widest range goes with all taps, and the parts have their taps in common
        widest: dict[str, Value] = {"gyro.range": math.radians(300.0)}
        return tuple(
            Setting(name.removeprefix("bartlett_"), {**widest, **{f"{each}.filter": name for each in PARTS}})
            for name in names
        )
    return (Setting(kind, {}),)


# --- held inputs -----------------------------------------------------------------------------------------------------


class Held(NamedTuple):
    """Settled readings of both parts, (n, 3), and of the two thermometers in codes, (n, 2), at held inputs."""

    gyro: Array
    accelerometer: Array
    thermometers: NDArray[np.int32]

    def of(self, part: Part) -> Array:
        """The readings of a part."""
        return self.gyro if part == "gyro" else self.accelerometer


def held(sensor: Sensor, names: tuple[str, ...], levels: Array) -> Held:
    """What the registers show when the inputs `names` have been held at each row of `levels` until all has settled."""
    sensor = sensor.but(_STEADY)
    step = 2.5 * _SLOW_PERIOD
    for part in PARTS:
        step += _settling_words(sensor, part) * clockwork(sensor, part).word
    with sensor.bench() as bench:
        record = bench.record(step, len(levels), names, levels)
    return Held(readings(sensor, "gyro", record), readings(sensor, "accelerometer", record), record.thermometers)


class Calibration(NamedTuple):
    """A part at 25 degC on a rate table or a dividing head, in SI units.

    `offset` (3,), `matrix` (3, 3): reading of the row by input of the column; for gyros `g_sensitivity` (3, 3) by
    specific force and `rectification` (3,) by its square; rms and largest deviation from the best straight line over
    the full scale, as shares of it.
    """

    offset: Array
    matrix: Array
    g_sensitivity: Array
    rectification: Array
    nonlinearity_rms: float
    nonlinearity_largest: float


def calibration(sensor: Sensor, part: Part) -> Calibration:
    """y = b + S u + G f + r f^2: each axis driven both ways, without noise."""
    # a sheet's scale is that of the best straight line over the full range, which the nonlinearity does not tilt
    silent = {*NOISES, "thermal.self_heating", "nonlinearity"}
    still = sensor.but(quiet(sensor, but=set(ERRORS) - silent), fine(sensor))
    names = (*RATE, *FORCE)
    sizes = np.array([0.5 * still.number("gyro.range")] * 3 + [STANDARD_GRAVITY] * 3)
    levels = np.vstack((np.zeros(6), np.diag(sizes), -np.diag(sizes)))
    found = held(still, names, levels).of(part)
    offset, there, back = found[0], found[1:7], found[7:13]
    slope = ((there - back) / (2.0 * sizes[:, None])).T
    bend = ((0.5 * (there + back) - offset) / sizes[:, None] ** 2)[3:]
    own = slope[:, :3] if part == "gyro" else slope[:, 3:]
    pushed = slope[:, 3:] if part == "gyro" else np.zeros((3, 3))
    rms, largest = _nonlinearity(sensor, part)
    return Calibration(offset, own, pushed, np.mean(bend, axis=0), rms, largest)


_BENT_RANGE = 0.98
"""Share of full scale over which the nonlinearity is measured: a bent reading may leave the range at its ends."""


def _nonlinearity(sensor: Sensor, part: Part) -> tuple[float, float]:
    """rms and largest deviation, of full scale; a cubic's, which it is, grows with the cube of the range."""
    bent = perfect(sensor, but=("nonlinearity",))
    scale = bent.number(f"{part}.range")
    given = _BENT_RANGE * scale * np.linspace(-1.0, 1.0, 201)
    names = (INPUTS[part][0],)
    found = held(bent, names, given[:, None]).of(part)[:, 0]
    away = (found - np.polyval(np.polyfit(given, found, 1), given)) / (scale * _BENT_RANGE**3)
    return float(np.sqrt(np.mean(away**2))), float(np.max(np.abs(away)))


class TemperatureDrift(NamedTuple):
    """Ambient temperatures (degC, up and down again), offset (n, 3) and relative change of scale (n, 3) there."""

    temperature: Array
    offset: Array
    scale: Array

    @property
    def warming(self) -> slice:
        """The rows on the way up."""
        return slice(0, len(self.temperature) // 2)

    @property
    def hysteresis(self) -> Array:
        """Offset on the way up less that on the way down at the same temperatures (n/2, 3)."""
        up = self.offset[self.warming]
        return np.asarray(up - self.offset[len(up) :][::-1])

    def slope(self, values: Array) -> Array:
        """Change by kelvin (3,): straight line through all rows."""
        return np.asarray(np.polyfit(self.temperature, values, 1)[0])


def temperature_drift(
    sensor: Sensor, part: Part, lowest: float = -40.0, highest: float = 85.0, step: float = 5.0
) -> TemperatureDrift:
    """Offset and scale at ambient temperatures (degC) that are reached in steps, up and down, each in equilibrium."""
    still = sensor.but(
        quiet(sensor, but=set(ERRORS) - set(NOISES)),
        fine(sensor),
        {"gyro.thermal.warm_up": 1e-3, "accelerometer.thermal.warm_up": 1e-3},
    )
    up = np.arange(lowest, highest + 0.5 * step, step)
    ambient = np.concatenate((up, up[::-1]))
    size = 0.5 * still.number(f"{part}.range")
    names = (*INPUTS[part], *TEMPERATURE)
    sides = []
    for rate in (0.0, size):
        levels = np.column_stack((np.full((len(ambient), 3), rate), ambient + CELSIUS_ZERO))
        begun = still.but({TEMPERATURE[0]: lowest + CELSIUS_ZERO})
        sides.append(held(begun, names, levels).of(part))
    gain = sides[1] - sides[0]
    reference = gain[int(np.argmin(np.abs(up - 25.0)))]
    return TemperatureDrift(ambient, sides[0], gain / reference - 1.0)


# --- registers -------------------------------------------------------------------------------------------------------


class Codes(NamedTuple):
    """Inputs (rad/s, m/s^2; degC for a thermometer) and the codes in the register at them, (n,) or (n, 3)."""

    given: Array
    codes: NDArray[np.int64]


def register_codes(sensor: Sensor, part: Part, given: Array) -> Codes:
    """The codes of inputs (n,) on all axes, without errors."""
    clean = sensor.but(quiet(sensor))
    levels = np.repeat(np.asarray(given)[:, None], 3, axis=1)
    found = held(clean, INPUTS[part], levels).of(part) / clean.number(f"{part}.resolution")
    return Codes(given, np.round(found).astype(np.int64))


def thermometer_codes(sensor: Sensor, part: Part, given: Array) -> Codes:
    """The thermometer's codes at ambient temperatures (n,) in degC, the die as warm as they are."""
    clean = sensor.but(quiet(sensor), {"gyro.thermal.warm_up": 1e-3, "accelerometer.thermal.warm_up": 1e-3})
    found = held(clean, TEMPERATURE, np.asarray(given)[:, None] + CELSIUS_ZERO).thermometers
    return Codes(given, found[:, PARTS.index(part)].astype(np.int64))


def word_rate(sensor: Sensor, part: Part, duration: float = 2.0) -> Array:
    """Register words a second on each axis (3,), counted where noise makes each one new; clock errors are left."""
    noisy = sensor.but(quiet(sensor, but=("clock_error", "noise_density")), fine(sensor))
    noisy = noisy.but({f"{part}.noise_density": max(noisy.number(f"{part}.noise_density"), 1e-5)})
    word = clockwork(noisy, part).word
    steps = round(max(duration, 200.0 * word) * 8.0 / word)
    with noisy.bench() as bench:
        found = readings(noisy, part, bench.record(word / 8.0, steps))
    rates = []
    for axis in range(3):
        fresh = np.flatnonzero(np.diff(found[:, axis]) != 0.0)
        rates.append((len(fresh) - 1) / ((fresh[-1] - fresh[0]) * word / 8.0))
    return np.array(rates)
