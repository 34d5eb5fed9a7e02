"""All that `attitude-fmu sensor` measures of a device, stage by stage."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from attitude_fmu.models.attitude.rotations import STANDARD_GRAVITY

from .bench import Array
from .characteristics import (
    PARTS,
    AtRest,
    Axes,
    Calibration,
    Codes,
    Estimate,
    Part,
    Sensor,
    Setting,
    StepResponse,
    TemperatureDrift,
    at_rest,
    calibration,
    clockwork,
    deviation_at,
    filter_settings,
    frequency_response,
    perfect,
    register_codes,
    step_response,
    temperature_drift,
    thermometer_codes,
    wander_alone,
    white_density,
    white_noise_alone,
    word_rate,
)
from .errors import SystemRefusedError
from .filter_claims import FilterClaim, bartlett_gain, filter_claim
from .sheet_claims import SheetClaims

WALK_TAU = 1.0
"""s, cluster time at which the rate random walk is judged."""

_WINDOWS = 200
"""Words in a window of the noise's rms, so that what wanders slowly stays out of it."""

_UNITS: dict[Part, float] = {"gyro": np.pi / 180.0, "accelerometer": STANDARD_GRAVITY}
"""SI units in the sheets' deg/s and g."""


_FEWEST_LINES = 10.0
"""Lines of the spectrum in the band that the filter leaves flat: three axes know the density to 9 %."""


class Effort(NamedTuple):
    """How long to measure (s), and whether at every setting of the filters."""

    at_rest: float
    white: float
    wander: float
    instability_tau: float
    every_setting: bool


FULL = Effort(3600.0, 400.0, 3600.0, 10.0, True)
QUICK = Effort(120.0, 100.0, 1800.0, 3.0, False)


class Claims(NamedTuple):
    """What the sheet says of the filter at the nominal clock, and at those that the axes were found to have."""

    nominal: FilterClaim
    x: FilterClaim
    y: FilterClaim
    z: FilterClaim

    @property
    def own(self) -> tuple[FilterClaim, FilterClaim, FilterClaim]:
        """Those of the axes."""
        return self[1:]


class SettingFound(NamedTuple):
    """The responses of the axes at one setting of the filter, beside what the sheet says of it."""

    setting: Setting
    claims: Claims
    responses: Axes


class Findings(NamedTuple):
    """What was measured of one part, in SI units.

    `folded` is what the filter leaves of the power of white noise (frequency in Hz, share), with what is folded down
    from above half the word rate, at the nominal clock; `settings` are all of the filter's, or none were asked for.
    The codes of both registers were measured at the inputs of `sheet`.
    """

    part: Part
    sheet: SheetClaims
    claims: Claims
    at_rest: AtRest
    noise_rms: float
    white: Estimate
    instability: Estimate | None
    walk: Estimate | None
    responses: Axes
    folded: tuple[Array, Array]
    settings: tuple[SettingFound, ...]
    step: StepResponse
    calibration: Calibration
    drift: TemperatureDrift
    codes: Codes
    thermometer: Codes
    word_rate: Array

    @property
    def clocks(self) -> Array:
        """How fast the clock of each axis was found to go, of the nominal rate (3,)."""
        return self.word_rate / self.claims.nominal.word_rate


Stage = Callable[[str, float], None]
"""Called when a stage begins: what it does and how many seconds it will simulate (0: not known, but few)."""


def findings(sensor: Sensor, sheets: Mapping[Part, SheetClaims], effort: Effort, stage: Stage) -> dict[Part, Findings]:
    """Measure both parts of a sensor, their registers at the inputs of the sheets' examples.

    Raises `SystemRefusedError` for a filter too slow to be measured in such records.
    """
    claims = {part: filter_claim(sensor, part) for part in PARTS}
    stage(f"at rest, {effort.at_rest:g} s", effort.at_rest)
    rest = at_rest(sensor, effort.at_rest)
    white = _white(sensor, effort, claims, stage)
    instability = _wander(sensor, "bias_instability", effort, effort.instability_tau, stage)
    walk = _wander(sensor, "rate_random_walk", effort, WALK_TAU, stage)
    found = {}
    for part in PARTS:
        stage(f"{part}: responses", 0.0)
        responses = frequency_response(sensor, part, claims[part].reference)
        folded = _folded(sensor, part, claims[part].reference)
        step = step_response(sensor, part)
        stage(f"{part}: calibration, temperature, registers", 0.0)
        sheet, words = sheets[part], word_rate(sensor, part)
        clocks = words / claims[part].word_rate
        inputs = _UNITS[part] * np.array([example.given for example in sheet.codes])
        temperatures = np.array([example.given for example in sheet.thermometer])
        found[part] = Findings(
            part,
            sheet,
            _claims(sensor, part, clocks),
            rest[part],
            _rms(rest[part]),
            white[part],
            instability.get(part),
            walk.get(part),
            responses,
            folded,
            _settings(sensor, part, clocks) if effort.every_setting else (),
            step,
            calibration(sensor, part),
            temperature_drift(sensor, part),
            register_codes(sensor, part, inputs),
            thermometer_codes(sensor, part, temperatures),
            words,
        )
    return found


def _white(sensor: Sensor, effort: Effort, claims: dict[Part, FilterClaim], stage: Stage) -> dict[Part, Estimate]:
    """Densities in the band where the filters let 99.5 % of the power pass; longer records for narrower bands."""
    narrowest = min(0.1 * claim.reference for claim in claims.values())
    duration = float(np.clip(effort.white * 6.0 / narrowest, effort.white, 10.0 * effort.white))
    if duration * narrowest < _FEWEST_LINES:
        raise SystemRefusedError(
            f"the filter passes {10.0 * narrowest:.3g} Hz: too little to find its noise in a record of {duration:g} s; "
            "take fewer taps, a smaller divider or a higher output data rate"
        )
    stage(f"white noise alone, {duration:g} s", duration)
    records = white_noise_alone(sensor, duration)
    return {part: white_density(records[part], 2.0 / duration, 0.1 * claims[part].reference) for part in PARTS}


def _wander(sensor: Sensor, term: str, effort: Effort, tau: float, stage: Stage) -> dict[Part, Estimate]:
    """Deviations at `tau` (s) of the parts that have this term."""
    present = [part for part in PARTS if sensor.number(f"{part}.{term}") > 0.0]
    if not present:
        return {}
    stage(f"{term.replace('_', ' ')} alone, {effort.wander:g} s", effort.wander)
    records = wander_alone(sensor, term, effort.wander)
    return {part: deviation_at(records[part], tau) for part in present}


def _claims(sensor: Sensor, part: Part, clocks: Array) -> Claims:
    return Claims(*[filter_claim(sensor, part, float(clock)) for clock in (1.0, *clocks)])


def _settings(sensor: Sensor, part: Part, clocks: Array) -> tuple[SettingFound, ...]:
    found = []
    for setting in filter_settings(sensor, part):
        chosen = sensor.but(setting.values)
        claims = _claims(chosen, part, clocks)
        found.append(SettingFound(setting, claims, frequency_response(chosen, part, claims.nominal.reference)))
    return tuple(found) if len(found) > 1 else ()


def _folded(sensor: Sensor, part: Part, reference: float) -> tuple[Array, Array]:
    """|H(f)|^2 + |H(word rate - f)|^2; of a Bartlett window its own, as noise enters it at its own samples."""
    nominal = perfect(sensor)
    _, is_window, taps = sensor.item(f"{part}.filter").partition("bartlett_")
    if is_window:
        turns = np.linspace(1e-6, 0.5, 50 * int(taps))
        return turns / clockwork(nominal, part).word, bartlett_gain(int(taps), turns) ** 2
    below = frequency_response(nominal, part, reference)[0]
    above = frequency_response(nominal, part, reference, folded=True)[0]
    return below.frequency, np.abs(below.gain) ** 2 + np.abs(above.gain[::-1]) ** 2


def _rms(rest: AtRest) -> float:
    """rms of the three axes about their mean in each window."""
    size = min(_WINDOWS * max(1, round(rest.rate / 50.0)), len(rest.readings))
    count = len(rest.readings) // size
    windows = rest.readings[: count * size].reshape(count, size, 3)
    return float(np.sqrt(np.mean(np.var(windows, axis=1))))
