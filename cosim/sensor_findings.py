"""All that `attitude-fmu sensor` measures of a device, stage by stage."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .bench import Array
from .characteristics import (
    PARTS,
    AtRest,
    Calibration,
    Codes,
    Estimate,
    Part,
    Response,
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
from .filter_claims import FilterClaim, bartlett_gain, filter_claim

WALK_TAU = 1.0
"""s, cluster time at which the rate random walk is judged."""

_WINDOWS = 200
"""Words in a window of the noise's rms, so that what wanders slowly stays out of it."""

_THERMOMETER_GIVEN = np.array([-40.0, 0.0, 25.0, 45.0, 85.0])


class Effort(NamedTuple):
    """How long to measure (s), and whether at every setting of the filters."""

    at_rest: float
    white: float
    wander: float
    instability_tau: float
    every_setting: bool


FULL = Effort(3600.0, 400.0, 3600.0, 10.0, True)
QUICK = Effort(120.0, 100.0, 1800.0, 3.0, False)


class SettingFound(NamedTuple):
    """The response at one setting of the filter, beside what the sheet says of it."""

    setting: Setting
    claim: FilterClaim
    response: Response


class Findings(NamedTuple):
    """What was measured of one part, in SI units.

    `folded` is what the filter leaves of the power of white noise (frequency in Hz, share), with what is folded down
    from above half the word rate; `settings` are all of the filter's, or none were asked for.
    """

    part: Part
    claim: FilterClaim
    at_rest: AtRest
    noise_rms: float
    white: Estimate
    instability: Estimate | None
    walk: Estimate | None
    response: Response
    folded: tuple[Array, Array]
    settings: tuple[SettingFound, ...]
    step: StepResponse
    calibration: Calibration
    drift: TemperatureDrift
    codes: Codes
    expected_codes: Array
    thermometer: Codes
    word_rate: Array

    @property
    def clock(self) -> float:
        """How fast the piece's clocks go, of the nominal rate."""
        return float(np.mean(self.word_rate)) / self.at_rest.rate


Stage = Callable[[str, float], None]
"""Called when a stage begins: what it does and how many seconds it will simulate (0: not known, but few)."""


def findings(sensor: Sensor, effort: Effort, stage: Stage) -> dict[Part, Findings]:
    """Measure both parts of a sensor."""
    claims = {part: filter_claim(sensor, part) for part in PARTS}
    stage(f"at rest, {effort.at_rest:g} s", effort.at_rest)
    rest = at_rest(sensor, effort.at_rest)
    white = _white(sensor, effort, claims, stage)
    instability = _wander(sensor, "bias_instability", effort, effort.instability_tau, stage)
    walk = _wander(sensor, "rate_random_walk", effort, WALK_TAU, stage)
    found = {}
    for part in PARTS:
        stage(f"{part}: responses", 0.0)
        response = frequency_response(sensor, part, claims[part].frequency)
        step = step_response(sensor, part)
        settings = _settings(sensor, part) if effort.every_setting else ()
        stage(f"{part}: calibration, temperature, registers", 0.0)
        given = _inputs_for_codes(sensor, part)
        found[part] = Findings(
            part,
            claims[part],
            rest[part],
            _rms(rest[part]),
            white[part],
            instability.get(part),
            walk.get(part),
            response,
            _folded(sensor, part, response, claims[part].frequency),
            settings,
            step,
            calibration(sensor, part),
            temperature_drift(sensor, part),
            register_codes(sensor, part, given),
            _expected_codes(sensor, part, given),
            thermometer_codes(sensor, part, _THERMOMETER_GIVEN),
            word_rate(sensor, part),
        )
    return found


def _white(sensor: Sensor, effort: Effort, claims: dict[Part, FilterClaim], stage: Stage) -> dict[Part, Estimate]:
    """Densities in the band where the filters let 99.5 % of the power pass; longer records for narrower bands."""
    narrowest = min(0.1 * claim.frequency for claim in claims.values())
    duration = float(np.clip(effort.white * 6.0 / narrowest, effort.white, 10.0 * effort.white))
    stage(f"white noise alone, {duration:g} s", duration)
    records = white_noise_alone(sensor, duration)
    return {part: white_density(records[part], 2.0 / duration, 0.1 * claims[part].frequency) for part in PARTS}


def _wander(sensor: Sensor, term: str, effort: Effort, tau: float, stage: Stage) -> dict[Part, Estimate]:
    """Deviations at `tau` (s) of the parts that have this term."""
    present = [part for part in PARTS if sensor.number(f"{part}.{term}") > 0.0]
    if not present:
        return {}
    stage(f"{term.replace('_', ' ')} alone, {effort.wander:g} s", effort.wander)
    records = wander_alone(sensor, term, effort.wander)
    return {part: deviation_at(records[part], tau) for part in present}


def _settings(sensor: Sensor, part: Part) -> tuple[SettingFound, ...]:
    found = []
    for setting in filter_settings(sensor, part):
        chosen = sensor.but(setting.values)
        claim = filter_claim(chosen, part)
        found.append(SettingFound(setting, claim, frequency_response(chosen, part, claim.frequency)))
    return tuple(found) if len(found) > 1 else ()


def _folded(sensor: Sensor, part: Part, response: Response, reference: float) -> tuple[Array, Array]:
    """|H(f)|^2 + |H(word rate - f)|^2; of a Bartlett window its own, as noise enters it at its own samples."""
    frequency = response.frequency
    _, is_window, taps = sensor.item(f"{part}.filter").partition("bartlett_")
    if is_window:
        return frequency, bartlett_gain(int(taps), frequency * clockwork(perfect(sensor), part).word) ** 2
    above = frequency_response(sensor, part, reference, folded=True)
    return frequency, np.abs(response.gain) ** 2 + np.abs(above.gain[::-1]) ** 2


def _rms(rest: AtRest) -> float:
    """rms of the three axes about their mean in each window."""
    size = min(_WINDOWS * max(1, round(rest.rate / 50.0)), len(rest.readings))
    count = len(rest.readings) // size
    windows = rest.readings[: count * size].reshape(count, size, 3)
    return float(np.sqrt(np.mean(np.var(windows, axis=1))))


def _inputs_for_codes(sensor: Sensor, part: Part) -> Array:
    """Inputs within the range, at its ends and beyond them."""
    scale, resolution = sensor.number(f"{part}.range"), sensor.number(f"{part}.resolution")
    inside = scale * np.array([-1.0, -0.731, -0.123, 0.0, 0.123, 0.337, 0.731, 1.0])
    return np.concatenate((inside, resolution * np.array([1.0, -1.0, 2.4, 2.6]), scale * np.array([-1.2, 1.2])))


def _expected_codes(sensor: Sensor, part: Part, given: Array) -> Array:
    """round(u/q) of the input held within the range, within the register's codes."""
    scale, resolution = sensor.number(f"{part}.range"), sensor.number(f"{part}.resolution")
    limit = sensor.number(f"{part}.code_limit")
    whole = np.floor(np.clip(given, -scale, scale) / resolution + 0.5)
    return np.clip(whole, -limit, limit - 1.0)


def word_period(sensor: Sensor, part: Part) -> float:
    """Nominal time (s) between register words."""
    return clockwork(perfect(sensor), part).word
