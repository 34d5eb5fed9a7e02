"""Where the time goes on the way round a loop: each part's share of the phase at the crossover."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .conditioning import Array
from .head_models import BODY_RATES, JOINT, Clocks, SensorModel
from .linear import model_ss
from .responses import Complex, response
from .stabilised_head import Head

REGISTER = "register.rate"


class Delay(NamedTuple):
    """What a part takes: s, and rad at a crossover."""

    part: str
    seconds: float
    phase: float


def delay_budget(head: Head, axis: int, crossover: float, register: Complex) -> list[Delay]:
    """Delays of a joint's loop through the gyro, at its crossover (Hz); `register` is the response of its register."""
    f, dt = head.frequencies, head.clocks.period
    turn = 2.0 * np.pi * crossover
    element, _ = BODY_RATES[axis]
    word = _lag(register[:, element, element], f, crossover)
    whole = _lag(head.readings[:, element, element], f, crossover)
    # a free inertia turns its angle by half a turn, and the held torque by half a period
    plant = _lag(-head.mean.torque[:, JOINT.start + axis, axis], f, crossover)
    hold = 0.5 * turn * dt
    parts = {
        "gyro: filter and word": word,
        "processor: reading the word": whole - word,
        "torque held between ticks": hold,
        "motor driver, friction, structure": plant - hold,
    }
    return [Delay(part, phase / turn, phase) for part, phase in parts.items()]


def _lag(response: Complex, frequencies: Array, at: float) -> float:
    return float(-np.angle(np.interp(at, frequencies, response.real) + 1j * np.interp(at, frequencies, response.imag)))


def register_response(sensor: SensorModel, clocks: Clocks, parameters: dict[str, float], frequencies: Array) -> Complex:
    """Of the gyros' registers by rate, in units of their gain at rest: frequencies x 3 x 3; 1 where there are none."""
    register = model_ss(
        sensor.name,
        clocks.period,
        {**parameters, **clocks.sensor},
        inputs="rate",
        outputs=REGISTER,
        coupling_delay=0,
    )
    H = response(register.A, register.B, register.C, register.D, frequencies, clocks.period)
    gain = np.abs(np.diagonal(H[0]))[:, None]
    return np.where(gain > 0.0, H / np.where(gain > 0.0, gain, 1.0), 1.0)
