"""The parts' digital chains against their tables (facts of ADXRS450 Rev. 0 p. 11, ADXL355 Rev. D pp. 25-27, ADIS16350).

Responses come from the parts' own steps, without noise and with registers so fine that they do not round. Two (or
three) axes carry the real and the imaginary part of exp(j w t): what the settled words show, over exp(j w t) at the
moment of the update, is H(f) itself, and one word is enough.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable

import numpy as np
import pytest
from faultless_parts import ADIS, faultless

from attitude_fmu.models.sensors import accelerometer, gyro
from attitude_fmu.models.sensors.digital_filter import TAPS, bartlett, settled_bartlett
from attitude_fmu.models.sensors.gyro import GYRO_FILTER
from attitude_fmu.models.vectors import IDENTITY3, ZERO3

Response = Callable[[float], complex]
NO_DRAWS = (0.0,) * 10


def corner_of(response: Response, low: float, high: float) -> float:
    """-3 dB frequency between two frequencies, Hz."""
    for _ in range(30):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if abs(response(middle)) > math.sqrt(0.5) else (low, middle)
    return low


def delay_of(response: Response) -> float:
    """Delay of slow signals, s: -arg H/w at 0.5 Hz, within 1e-5 of that at 0 Hz."""
    return -cmath.phase(response(0.5)) / (2 * math.pi * 0.5)


# --- ADXRS450 --------------------------------------------------------------------------------------------------------


def response_of_cic(resonator: float, bandwidth: float = 10.6e3, ticks: int = 20) -> Response:
    """H(f) of a gyro with this f0; the words after 160/f0 have forgotten the start, behind a low bandwidth later."""
    part = faultless(fine=True, gyro__resonator_frequency=resonator, gyro__bandwidth=bandwidth).gyro
    k = gyro.gyro_coefficients(part, IDENTITY3, False)._replace(sample_deviation=ZERO3)
    sense, register = gyro.sense(0), gyro.register(0)

    def response(frequency: float) -> complex:
        shown = []
        for quadrature in (0.0, -0.5 * math.pi):
            state, _ = gyro.initial_gyro(0, ZERO3, ZERO3, 0.0, 1.0, part, k)
            for tick in range(1, ticks + 1):
                angle = 2 * math.pi * frequency * tick * k.sense_period[0] + quadrature
                state = sense(state, (math.cos(angle), 0.0, 0.0), ZERO3, 1.0, part, k)
                if tick % 4 == 0:
                    state = register(state, 0.0, part, k, (), NO_DRAWS)
            shown.append(state.code * part.resolution)
        return complex(*shown) * cmath.exp(-2j * math.pi * frequency * ticks * k.sense_period[0])

    return response


@pytest.mark.parametrize(("resonator", "corner"), [(13e3, 64.8), (16e3, 79.7), (19e3, 94.7)])
def test_the_cic_follows_the_resonator(resonator: float, corner: float) -> None:
    response = response_of_cic(resonator)
    assert abs(response(0.0)) == pytest.approx(1.0, abs=1e-8)
    assert corner_of(response, 10.0, 200.0) == pytest.approx(corner, rel=0.01)
    assert delay_of(response) == pytest.approx(63 / resonator, rel=1e-3)  # 3.94 ms at 16 kHz; Table 1: 3.25 to 4.75
    for null in (1, 2, 3):  # the inputs come at f0/8: nulls beyond f0/16 are theirs
        assert abs(response(null * resonator / 64)) < 1e-7


@pytest.mark.parametrize("frequency", [20.0, 50.0, 120.0, 180.0, 300.0])
def test_the_cic_is_a_sinc2_of_linear_phase(frequency: float) -> None:
    x = math.pi * frequency / 16e3
    exact = (math.sin(64 * x) / (64 * math.sin(x))) ** 2
    found = response_of_cic(16e3)(frequency)
    # inputs are taken at f0/8 and joined by straight lines, which lose sinc^2 of eight samples
    assert abs(found) == pytest.approx(exact * (math.sin(8 * x) / (8 * math.sin(x))) ** 2, rel=1e-3)
    straight = found * cmath.exp(2j * math.pi * frequency * 63 / 16e3)
    assert abs(straight.imag) < 2e-5


# --- ADXL355 ---------------------------------------------------------------------------------------------------------

ADXL355_TABLE = {  # code: output data rate Hz, delay ms, dB at a quarter of the rate (full path)
    0: (4000.0, 0.63, -3.63),
    1: (2000.0, 1.00, -2.26),
    2: (1000.0, 1.78, -1.93),
    3: (500.0, 3.26, -1.83),
    4: (250.0, 6.27, -1.83),
    5: (125.0, 12.34, -1.83),
    6: (62.5, 24.18, -1.83),
    7: (31.25, 47.59, -1.83),
    8: (15.625, 96.25, -1.83),
    9: (7.813, 189.58, -1.83),
    10: (3.906, 384.31, -1.83),
}


@pytest.mark.parametrize("code", ADXL355_TABLE)
def test_the_decimator_has_the_sheets_attenuation_and_delay_at_every_rate(code: int) -> None:
    rate, delay, decibels = ADXL355_TABLE[code]
    part = faultless(fine=True, accelerometer__output_data_rate=code + 1).accelerometer
    k = accelerometer.accelerometer_coefficients(part, IDENTITY3, False)._replace(sample_deviation=0.0)
    ratio, period = int(k.decimation), k.sense_period
    assert 1.0 / k.word_period == pytest.approx(rate, rel=2e-4)  # the sheet rounds the slowest rates
    w = 2 * math.pi / (4 * k.word_period)
    slope = 1.0 / (8 * ratio)  # z carries a ramp, whose lag is the delay
    state, _ = accelerometer.initial_accelerometer(ZERO3, ZERO3, (1.0, 1.0, 1.0), part, k)
    words, updates = state.words, []
    for tick in range(1, 5 * ratio + 9):
        t = tick * period
        felt = (math.cos(w * t), math.sin(w * t), slope * tick)
        state = accelerometer.sense(state, felt, (1.0, 1.0, 1.0), part, k)
        if state.words > words:  # the registers have just been updated
            words = state.words
            x, y, z = (code * part.resolution for code in accelerometer.registers(state, k).code)
            updates.append((complex(x, y) * cmath.exp(-1j * w * t), tick - z / slope))
        if tick % ratio == 0:
            state = accelerometer.register(state, ZERO3, part, k, (), NO_DRAWS)
    response, age = updates[-1]
    assert 20 * math.log10(abs(response)) == pytest.approx(decibels, abs=0.05)
    assert age * period * 1e3 == pytest.approx(delay, rel=0.02)


@pytest.mark.parametrize(
    ("code", "corner"), list(enumerate((24.7e-4, 6.2084e-4, 1.5545e-4, 0.3862e-4, 0.0954e-4, 0.0238e-4), 1))
)
def test_the_high_pass_forgets_a_step_at_its_corner(code: int, corner: float) -> None:
    # after a step a first-order high-pass decays by exp(-2 pi f t): seen from word 10 to word 1010
    part = faultless(fine=True, accelerometer__output_data_rate=1, accelerometer__high_pass=code + 1).accelerometer
    k = accelerometer.accelerometer_coefficients(part, IDENTITY3, False)._replace(sample_deviation=0.0)
    state, _ = accelerometer.initial_accelerometer(ZERO3, ZERO3, (1.0, 1.0, 1.0), part, k)
    shown = []
    for _ in range(1011):
        state = accelerometer.sense(state, (10.0, 0.0, 0.0), (1.0, 1.0, 1.0), part, k)
        state = accelerometer.register(state, ZERO3, part, k, (), NO_DRAWS)
        shown.append(state.earlier.code[0] * part.resolution)
    assert max(shown) == pytest.approx(10.0, rel=0.05)
    assert math.log(shown[10] / shown[1010]) / (2 * math.pi * 1000) == pytest.approx(corner, rel=0.01)


def test_the_high_pass_is_at_minus_3_db_at_its_corner_and_settled_from_the_start() -> None:
    part = faultless(fine=True, accelerometer__output_data_rate=1, accelerometer__high_pass=2).accelerometer
    k = accelerometer.accelerometer_coefficients(part, IDENTITY3, False)._replace(sample_deviation=0.0)
    state, _ = accelerometer.initial_accelerometer((0.0, 0.0, 9.0), ZERO3, (1.0, 1.0, 1.0), part, k)
    w = 2 * math.pi * 24.7e-4
    for word in range(1, 801):  # 12 time constants
        felt = (math.cos(w * word), math.sin(w * word), 9.0)
        state = accelerometer.sense(state, felt, (1.0, 1.0, 1.0), part, k)
        state = accelerometer.register(state, ZERO3, part, k, (), NO_DRAWS)
    x, y, z = (code * part.resolution for code in state.earlier.code)
    assert z == pytest.approx(0.0, abs=1e-6)
    assert abs(complex(x, y)) == pytest.approx(math.sqrt(0.5), rel=2e-3)


# --- ADIS16354 -------------------------------------------------------------------------------------------------------

RATE = 819.2
CORNERS = {2: 149.0, 4: 67.3, 8: 32.9, 16: 16.4, 32: 8.17, 64: 4.08}
NOISE_GAINS = {1: 1.0, 2: 0.612, 4: 0.415, 8: 0.290, 16: 0.204, 32: 0.144, 64: 0.102}


def impulse_response(taps: int) -> np.ndarray:
    sums, lines = settled_bartlett(0.0, float(taps))
    h = []
    for sample in range(2 * taps + 3):
        y, sums, lines = bartlett(sums, lines, 1.0 if sample == 0 else 0.0, taps)
        h.append(y)
    return np.array(h)


@pytest.mark.parametrize("taps", TAPS)
def test_a_bartlett_window_has_the_tables_corner_delay_and_noise(taps: int) -> None:
    h = impulse_response(taps)
    assert np.count_nonzero(h) == 2 * taps - 1
    assert h.sum() == pytest.approx(1.0, rel=1e-14)
    assert math.sqrt((h * h).sum()) == pytest.approx(NOISE_GAINS[taps], abs=6e-4)
    assert (np.arange(len(h)) * h).sum() == pytest.approx(taps - 1)
    if taps > 1:
        z = [
            np.exp(-2j * np.pi * f / RATE * np.arange(len(h))) @ h for f in (0.99 * CORNERS[taps], 1.01 * CORNERS[taps])
        ]
        assert abs(z[1]) < math.sqrt(0.5) < abs(z[0])


@pytest.mark.parametrize("taps", [1, 4, 64])
def test_the_running_sums_stay_exact(taps: int) -> None:
    codes = np.random.default_rng(taps).integers(-(2**19), 2**19, 20_000)
    box = np.ones(taps, dtype=int)
    exact = np.convolve(np.convolve(codes, box), box)[: len(codes)]  # whole numbers
    sums, lines = settled_bartlett(0.0, float(taps))
    for code, expected in zip(codes.tolist(), exact.tolist(), strict=True):
        y, sums, lines = bartlett(sums, lines, float(code), taps)
        assert y == expected / taps**2


def response_of_bartlett(taps: int, divider: int = 1) -> tuple[Response, Response]:
    """H(f) of a gyro and of an accelerometer of the ADIS16354 from their inputs on, bandwidth included."""
    way = GYRO_FILTER.value(f"bartlett_{taps}")
    p = faultless(ADIS, True, gyro__filter=way, accelerometer__filter=way)
    p = p._replace(gyro=p.gyro._replace(divider=divider), accelerometer=p.accelerometer._replace(divider=divider))
    g = gyro.gyro_coefficients(p.gyro, IDENTITY3, False)._replace(sample_deviation=ZERO3)
    a = accelerometer.accelerometer_coefficients(p.accelerometer, IDENTITY3, False)._replace(sample_deviation=0.0)
    senses = int(g.senses)
    assert senses == a.decimation == 4 * divider
    assert g.sense_period[0] == a.sense_period == pytest.approx(1 / (4 * RATE))
    ticks = senses * (2 * taps + 12)

    def of_gyro(frequency: float) -> complex:
        sense, sample = gyro.sense_bartlett(0), gyro.sample(0, taps)
        shown = []
        for quadrature in (0.0, -0.5 * math.pi):
            state, lines = gyro.initial_gyro(0, ZERO3, ZERO3, 0.0, 1.0, p.gyro, g)
            for tick in range(1, ticks + 1):
                angle = 2 * math.pi * frequency * tick * g.sense_period[0] + quadrature
                state = sense(state, (math.cos(angle), 0.0, 0.0), ZERO3, 1.0, p.gyro, g)
                if tick % senses == 0:
                    state, lines = sample(state, lines, 0.0, p.gyro, g, (), NO_DRAWS)
            shown.append(state.code * p.gyro.resolution)
        return complex(*shown) * cmath.exp(-2j * math.pi * frequency * ticks * g.sense_period[0])

    def of_accelerometer(frequency: float) -> complex:
        sample, one = accelerometer.sample(taps), (1.0, 1.0, 1.0)
        state, lines = accelerometer.initial_accelerometer(ZERO3, ZERO3, one, p.accelerometer, a)
        for tick in range(1, ticks + 1):
            angle = 2 * math.pi * frequency * tick * a.sense_period
            felt = (math.cos(angle), math.sin(angle), 0.0)
            state = accelerometer.sense_bartlett(state, felt, one, p.accelerometer, a)
            if tick % senses == 0:
                state, lines = sample(state, lines, ZERO3, p.accelerometer, a, (), NO_DRAWS)
        x, y, _ = (code * p.accelerometer.resolution for code in state.latest.code)
        return complex(x, y) * cmath.exp(-2j * math.pi * frequency * ticks * a.sense_period)

    return of_gyro, of_accelerometer


@pytest.mark.parametrize("taps", TAPS)
def test_the_whole_chain_is_the_window_behind_the_analogue_bandwidth(taps: int) -> None:
    pole = 350.0
    for response in response_of_bartlett(taps):
        # delay_of is within (2 pi 0.5 Hz/pole)^2 of that at 0 Hz, and the finest registers round by 1e-9
        assert delay_of(response) == pytest.approx((taps - 1) / RATE + 1 / (2 * math.pi * pole), rel=1e-3)
        for frequency in (1.0, CORNERS.get(taps, 200.0), 300.0):
            x = math.pi * frequency / RATE
            window = (math.sin(taps * x) / (taps * math.sin(x))) ** 2
            expected = window / math.hypot(1.0, frequency / pole)
            assert abs(response(frequency)) == pytest.approx(expected, rel=0.01, abs=1e-4)


def test_without_a_window_the_bandwidth_is_350_hz() -> None:
    for response in response_of_bartlett(1):
        assert corner_of(response, 100.0, 400.0) == pytest.approx(350.0, rel=0.01)


@pytest.mark.parametrize("frequency", [50.0, 350.0])
def test_what_specific_force_does_to_a_gyro_passes_the_bandwidth_too(frequency: float) -> None:
    sensitive = ((1e-2, 0.0, 0.0), ZERO3, ZERO3)
    p = faultless(ADIS, True, gyro__filter=GYRO_FILTER.value("bartlett_1"), gyro__g_sensitivity=sensitive).gyro
    k = gyro.gyro_coefficients(p, IDENTITY3, False)._replace(sample_deviation=ZERO3)
    sense, sample = gyro.sense_bartlett(0), gyro.sample(0, 1)
    shown = []
    for quadrature in (0.0, -0.5 * math.pi):
        state, lines = gyro.initial_gyro(0, ZERO3, ZERO3, 0.0, 1.0, p, k)
        for tick in range(1, 101):
            angle = 2 * math.pi * frequency * tick * k.sense_period[0] + quadrature
            state = sense(state, ZERO3, (math.cos(angle), 0.0, 0.0), 1.0, p, k)
            if tick % 4 == 0:
                state, lines = sample(state, lines, 0.0, p, k, (), NO_DRAWS)
        shown.append(state.code * p.resolution)
    assert abs(complex(*shown)) == pytest.approx(1e-2 / math.hypot(1.0, frequency / 350.0), rel=0.01)


def test_a_low_bandwidth_acts_ahead_of_the_cic_too() -> None:
    plain = response_of_cic(16e3)(100.0)
    limited = response_of_cic(16e3, 100.0, 60)(100.0)
    # the pole without the half step that the straight lines between its outputs add: 1/cos(pi 100 Hz/2 kHz) = 1.2 %
    assert abs(limited / plain) == pytest.approx(math.sqrt(0.5), rel=0.02)
    assert abs(response_of_cic(16e3, 500.0)(100.0) / plain) == pytest.approx(1.0, abs=1e-6)


def test_a_divider_slows_the_window_but_not_the_bandwidth() -> None:
    for response in response_of_bartlett(2, divider=5):
        assert delay_of(response) == pytest.approx(5 / RATE + 1 / (2 * math.pi * 350.0), rel=0.02)
        x = math.pi * 30.0 * 5 / RATE
        assert abs(response(30.0)) == pytest.approx(math.cos(x) ** 2 / math.hypot(1.0, 30.0 / 350.0), rel=0.01)


def test_the_default_sample_rates_are_the_parts_own() -> None:
    k = gyro.gyro_coefficients(faultless().gyro, IDENTITY3, False)
    assert 1 / k.word_period[0] == pytest.approx(500.0)
    assert 1 / k.sense_period[0] == pytest.approx(2000.0)
    k = gyro.gyro_coefficients(faultless(ADIS).gyro, IDENTITY3, False)
    assert 1 / k.word_period[0] == pytest.approx(RATE)
