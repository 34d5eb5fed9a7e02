"""Faults of single channels, the status that the parts raise, the words that carry both, and the self-test."""

from __future__ import annotations

import math
from typing import Any

import pytest
from faultless_parts import ADIS, GYRO, STILL, faultless, run_of

from attitude_fmu.models.attitude_sensor import MODEL, Parameters
from attitude_fmu.models.sensors import adis16354_words, adxl355_registers, adxrs450_frame
from attitude_fmu.models.sensors.accelerometer import HIGH_PASS, registers
from attitude_fmu.models.sensors.faults import CHANNEL, FAULT, FaultParameters, faulted
from attitude_fmu.models.system import Run

BOTH = pytest.mark.parametrize("device", [GYRO, ADIS])
CHANNELS = pytest.mark.parametrize("channel", range(6), ids=[item.name for item in CHANNEL.items])
START, END, STOP = 0.05, 0.1, 0.2
MOVING = STILL._replace(rate=(0.5, -0.6, 0.7), specific_force=(3.0, 4.0, -5.0))
OTHER = STILL._replace(rate=(-0.1, 0.2, 0.3), specific_force=(-1.0, 2.0, 1.5))


def one_fault(kind: str, channel: int, size: float = 0.1, start: float = START, end: float = END) -> FaultParameters:
    return FaultParameters(FAULT.value(kind), channel + 1, start, end, size)


def with_fault(device: str, kind: str, channel: int, **changes: Any) -> Parameters:
    p = faultless(device)
    return p._replace(fault=(FaultParameters(), one_fault(kind, channel, **changes)))


def codes(run: Run) -> tuple[float, ...]:
    register = run.outputs().register
    return *register.rate, *register.acceleration


def readings(run: Run) -> tuple[float, ...]:
    return *run.state.reading.rate, *run.state.reading.specific_force


def part_of(run: Run, channel: int) -> Any:
    """What the part of a channel shows: over-range and condition."""
    if channel < 3:
        return run.state.gyro[channel]
    return registers(run.state.accelerometer, run.coefficients.accelerometer)


def full_scale(run: Run, channel: int) -> float:
    part = run.parameters.gyro if channel < 3 else run.parameters.accelerometer
    return part.range / part.resolution


def at(run: Run, inputs: Any, time: float) -> tuple[float, ...]:
    run.advance(inputs, time)
    return codes(run)


@CHANNELS
@BOTH
def test_a_stuck_channel_keeps_its_last_word_and_recovers(device: str, channel: int) -> None:
    run = Run(MODEL, with_fault(device, "stuck", channel), MOVING)
    well = at(run, MOVING, START - 0.001)
    during = at(run, OTHER, END - 0.005)
    assert during[channel] == well[channel]
    assert all(during[i] != well[i] for i in range(6) if i != channel)
    assert at(run, OTHER, STOP) == codes(run_of(faultless(device), OTHER, STOP))


@CHANNELS
@BOTH
def test_a_dropped_channel_delivers_zero(device: str, channel: int) -> None:
    run = Run(MODEL, with_fault(device, "dropped", channel), MOVING)
    well = at(run, MOVING, START - 0.005)
    during = at(run, MOVING, END - 0.005)
    assert during == tuple(0.0 if i == channel else code for i, code in enumerate(well))
    assert at(run, MOVING, STOP) == well


@CHANNELS
@BOTH
def test_a_saturated_channel_lies_at_the_end_of_its_range_and_says_so(device: str, channel: int) -> None:
    for size, sign in ((0.1, 1.0), (-0.1, -1.0)):
        run = Run(MODEL, with_fault(device, "saturated", channel, size=size), MOVING)
        well = at(run, MOVING, START - 0.005)
        assert run.outputs().status == 1  # aligning
        during = at(run, MOVING, END - 0.005)
        assert during[channel] == pytest.approx(sign * full_scale(run, channel), abs=1.0)
        assert [*during[:channel], *during[channel + 1 :]] == [*well[:channel], *well[channel + 1 :]]
        assert part_of(run, channel).over_range == 1.0
        assert at(run, MOVING, STOP) == well


@CHANNELS
@BOTH
def test_a_drifting_channel_runs_away_by_its_size_each_second(device: str, channel: int) -> None:
    run = Run(MODEL, with_fault(device, "drifting", channel, size=2.0), STILL)
    assert at(run, STILL, START - 0.005) == (0.0,) * 6
    # words a known time apart: the drift between them is exact but for rounding
    seen, words = [], []
    for time in (START + 0.01, END - 0.005):
        seen.append(at(run, STILL, time)[channel])
        state = run.state.gyro[channel] if channel < 3 else run.state.accelerometer
        words.append(state.words)
    k = run.coefficients.gyro.word_period[channel] if channel < 3 else run.coefficients.accelerometer.word_period
    per_second = (seen[1] - seen[0]) / ((words[1] - words[0]) * k)
    assert per_second == pytest.approx(2.0 * full_scale(run, channel), rel=1e-3, abs=1.0 / k / (words[1] - words[0]))
    late = 2 * k  # words still under way when the fault begins
    assert seen[1] == pytest.approx(2.0 * full_scale(run, channel) * (END - 0.005 - START), abs=late * per_second)
    assert at(run, STILL, STOP) == (0.0,) * 6


@CHANNELS
@BOTH
def test_one_word_in_a_hundred_is_a_spike_of_the_size(device: str, channel: int) -> None:
    run = Run(MODEL, with_fault(device, "spiking", channel, start=0.0, end=10.0), STILL)
    found: dict[float, int] = {}
    last = -1.0
    while run.state.reading.readings < 750:
        run.advance(STILL, (run.state.reading.readings + 1) * 0.002)
        state = run.state.gyro[channel] if channel < 3 else run.state.accelerometer
        if state.words != last:
            last = state.words
            found[codes(run)[channel]] = found.get(codes(run)[channel], 0) + 1
    size = math.floor(0.1 * full_scale(run, channel) + 0.5)
    assert set(found) <= {0.0, size, -size}
    spikes = sum(found.values()) - found[0.0]
    # of 750 words 7.5 are expected, Poisson: 1 to 18 but once in 800
    assert 1 <= spikes <= 18


def test_spikes_come_once_in_a_hundred_and_both_ways() -> None:
    spike = FaultParameters(FAULT.value("spiking"), 1, 0.0, 1e9, 0.1)
    values = [faulted(0.0, 5.0, spike, 0, 1.0, draw).value for draw in (-2.6, -2.55, 0.0, 2.55, 2.6)]
    assert values == [-0.5, 0.0, 0.0, 0.0, 0.5]
    assert math.erfc(2.5758293035489004 / math.sqrt(2.0)) == pytest.approx(0.01, rel=1e-12)


@CHANNELS
@BOTH
def test_lost_frames_hold_the_last_reading_while_the_part_goes_on(device: str, channel: int) -> None:
    run = Run(MODEL, with_fault(device, "lost_frames", channel), MOVING)
    run.advance(MOVING, START - 0.001)
    well = readings(run)
    run.advance(OTHER, END - 0.005)
    during = readings(run)
    assert during[channel] == well[channel]
    assert all(during[i] != well[i] for i in range(6) if i != channel)
    assert codes(run) == codes(run_of(faultless(device), OTHER, STOP))
    run.advance(OTHER, STOP)
    assert readings(run) == readings(run_of(faultless(device), OTHER, STOP))


@CHANNELS
def test_lost_words_are_missed_ones(channel: int) -> None:
    run = Run(MODEL, with_fault(GYRO, "lost_frames", channel, start=0.1, end=0.2), STILL)
    run.advance(STILL, 0.1)
    before = run.outputs().sample
    run.advance(STILL, 0.19)
    assert run.outputs().sample == before
    run.advance(STILL, 0.3)
    assert run.outputs().sample.repeated == before.repeated
    assert run.outputs().sample.missed - before.missed == pytest.approx(50, abs=1)  # 0.1 s at 500 words/s


def test_two_faults_at_once() -> None:
    p = faultless()._replace(fault=(one_fault("dropped", 0), one_fault("saturated", 4)))
    run = Run(MODEL, p, MOVING)
    during = at(run, MOVING, END - 0.005)
    assert during[0] == 0.0
    assert during[4] == pytest.approx(full_scale(run, 4), abs=1.0)
    both = faultless()._replace(fault=(one_fault("drifting", 1, size=1.0), one_fault("stuck", 1, start=0.08)))
    run = Run(MODEL, both, STILL)
    assert 0.0 < at(run, STILL, 0.079)[1] <= at(run, STILL, 0.082)[1] == at(run, STILL, END - 0.005)[1]


def test_faults_can_be_switched_while_running() -> None:
    p = faultless()
    run = run_of(p, MOVING, 0.05)
    assert codes(run)[2] != 0.0
    run.tune(p._replace(fault=(one_fault("dropped", 2, start=0.0, end=1e9), FaultParameters())))
    assert at(run, MOVING, 0.1)[2] == 0.0
    run.tune(p)
    assert at(run, MOVING, 0.15)[2] != 0.0


# --- status and words ------------------------------------------------------------------------------------------------


def unsigned(word: float) -> int:
    assert -(2**31) <= word < 2**31
    assert word == int(word)
    return int(word) & 0xFFFFFFFF


@pytest.mark.parametrize("channel", range(3))
def test_an_adxrs450_marks_what_is_wrong_with_it_in_its_own_frame_alone(channel: int) -> None:
    for kind, status, named in (
        ("none", adxrs450_frame.VALID, set()),
        ("dropped", adxrs450_frame.INVALID, {"phase_lock", "self_test"}),
        ("stuck", adxrs450_frame.VALID, {"self_test"}),
        ("spiking", adxrs450_frame.VALID, set()),
        ("lost_frames", adxrs450_frame.VALID, set()),
    ):
        run = run_of(with_fault(GYRO, kind, channel), MOVING, START - 0.001)
        before = run.outputs().register.rate
        run.advance(OTHER, END - 0.004)
        register = run.outputs().register
        for axis in range(3):
            frame = adxrs450_frame.decode_sensor_data(unsigned(register.gyro_word[axis]))
            assert frame.parity_holds
            mine = axis == channel
            assert frame.code == (register.rate[axis] if kind != "lost_frames" or not mine else before[axis])
            assert frame.status == (status if mine else adxrs450_frame.VALID), kind
            assert {name for name, bit in frame.faults._asdict().items() if bit} == (named if mine else set()), kind
        assert register.status_word == 0.0


def test_frames_are_numbered_by_the_readings() -> None:
    run = Run(MODEL, faultless(), STILL)
    seen = []
    for reading in range(1, 18):
        run.advance(STILL, reading * 0.002)
        word = unsigned(run.outputs().register.gyro_word[0])
        seen.append(adxrs450_frame.decode_sensor_data(word).sequence)
    assert seen == [reading % 8 for reading in range(1, 18)]


def test_every_frame_of_a_noisy_run_has_odd_parity_and_the_registers_code() -> None:
    run = Run(MODEL, MODEL.Parameters(), MOVING)
    for reading in range(1, 200):
        run.advance(MOVING, reading * run.coefficients.processor_period)
        register = run.outputs().register
        for axis in range(3):
            frame = adxrs450_frame.decode_sensor_data(unsigned(register.gyro_word[axis]))
            assert (frame.parity_holds, frame.code) == (True, register.rate[axis])
            word = register.accelerometer_word[axis]
            assert 0 <= word < 2**24
            assert adxl355_registers.code_of_data(word) == register.acceleration[axis]
            assert word == adxl355_registers.data_word(register.acceleration[axis])


@CHANNELS
def test_an_adis16354_reports_a_failed_channel_in_status_and_alarms_in_every_word(channel: int) -> None:
    bit = {0: 10, 1: 11, 2: 12, 3: 13, 4: 14, 5: 15}[channel]  # X, Y, Z gyro, X, Y, Z accelerometer
    for kind in ("stuck", "dropped"):
        run = Run(MODEL, with_fault(ADIS, kind, channel), MOVING)
        run.advance(MOVING, START - 0.01)
        assert run.outputs().register.status_word == 0.0
        assert not any(int(word) & 0x4000 for word in run.outputs().register.gyro_word)
        run.advance(MOVING, END - 0.005)
        assert run.outputs().register.status_word == 2**bit + 2**5
        register = run.outputs().register
        assert all(int(word) & 0x4000 for word in (*register.gyro_word, *register.accelerometer_word))
        run.advance(MOVING, STOP)
        assert run.outputs().register.status_word == 0.0


def test_an_adis16354_reports_range_and_supply() -> None:
    far = MOVING._replace(rate=(0.0, 6.0, 0.0))
    assert run_of(faultless(ADIS), far, 0.05).outputs().register.status_word == 2**4
    for volts, word in ((4.7, 1), (4.75, 0), (5.25, 0), (5.3, 2)):
        run = run_of(faultless(ADIS), MOVING._replace(supply_voltage=volts), 0.05)
        assert run.outputs().register.status_word == word


def received(run: Run) -> tuple[float, ...]:
    register = run.outputs().register
    return *register.gyro_word, *register.accelerometer_word


def test_a_master_that_steps_with_the_processor_sees_which_words_are_new() -> None:
    # words come every 1/819.2 s, readings every 1 ms: new is what has come since the reading before
    run = Run(MODEL, faultless(ADIS, processor__period=0.001), MOVING)
    new = []
    for reading in range(1, 41):
        run.advance(MOVING, reading * 0.001)
        came = math.floor(reading * 0.8192) > math.floor((reading - 1) * 0.8192)
        for code, word in zip(codes(run), received(run), strict=True):
            assert 0 <= word < 2**16
            assert adis16354_words.code_of_output(word) == code
            assert int(word) >> 15 == came
        new.append(came)
    assert set(new) == {True, False}


@BOTH
def test_words_are_those_of_the_last_reading_whatever_the_registers_show_since(device: str) -> None:
    run = Run(MODEL, faultless(device, processor__period=0.02), MOVING)
    run.advance(MOVING, 0.02)
    words, registers = received(run), codes(run)
    run.advance(OTHER, 0.0399)
    assert received(run) == words
    assert all(now != then for now, then in zip(codes(run), registers, strict=True))
    run.advance(OTHER, 0.04)
    assert all(now != then for now, then in zip(received(run), words, strict=True))


@CHANNELS
@BOTH
def test_a_lost_word_leaves_the_one_received_before(device: str, channel: int) -> None:
    run, plain = Run(MODEL, with_fault(device, "lost_frames", channel), MOVING), Run(MODEL, faultless(device), MOVING)
    run.advance(MOVING, START - 0.001)
    plain.advance(MOVING, START - 0.001)
    last = received(run)[channel]
    for reading in range(round(START * 500), round(START * 500) + 20):
        for one in (run, plain):
            one.advance(OTHER, reading * 0.002 + 0.0005)
        assert received(run)[channel] == last
        assert received(run)[:channel] == received(plain)[:channel]
        assert received(run)[channel + 1 :] == received(plain)[channel + 1 :]
    for one in (run, plain):
        one.advance(OTHER, STOP)
    assert received(run) == received(plain)


@CHANNELS
@BOTH
def test_what_is_wrong_with_a_word_is_told_with_that_word(device: str, channel: int) -> None:
    # dropped words are zero, saturated ones at the end: at no tick may the flag differ from what the register shows
    for kind in ("dropped", "saturated"):
        run, told = Run(MODEL, with_fault(device, kind, channel), MOVING), set()
        well = codes(run)[channel]
        for tick in range(1, 1200):
            run.advance(MOVING, tick * 1e-4)
            part = part_of(run, channel)
            conditions = (part.condition,) * 3 if channel < 3 else part.condition
            flag = conditions[channel % 3] == 2.0 if kind == "dropped" else part.over_range == 1.0
            assert flag == (abs(codes(run)[channel] - well) > 100), tick
            told.add(flag)
        assert told == {True, False}


@pytest.mark.parametrize(("volts", "failed"), [(3.1, 1.0), (3.15, 0.0), (5.0, 0.0), (5.25, 0.0), (5.3, 1.0)])
def test_an_adxrs450_reports_a_supply_outside_its_range(volts: float, failed: float) -> None:
    run = run_of(faultless(), MOVING._replace(supply_voltage=volts), 0.05)
    for word in run.outputs().register.gyro_word:
        frame = adxrs450_frame.decode_sensor_data(unsigned(word))
        assert (frame.faults, frame.status) == (adxrs450_frame.NO_FAULTS._replace(power=failed), adxrs450_frame.VALID)


# --- self-test -------------------------------------------------------------------------------------------------------


@BOTH
def test_the_self_test_adds_its_response(device: str) -> None:
    p = faultless(device, gyro__self_test_response=(0.1, 0.2, -0.3))
    run = run_of(p, MOVING, 0.05)
    before = codes(run)
    run.tune(p._replace(gyro=p.gyro._replace(self_test=True), accelerometer=p.accelerometer._replace(self_test=True)))
    during = at(run, MOVING, 0.1)
    responses = (*p.gyro.self_test_response, *p.accelerometer.self_test_response)
    for i in range(6):
        lsb = p.gyro.resolution if i < 3 else p.accelerometer.resolution
        assert (during[i] - before[i]) * lsb == pytest.approx(responses[i], abs=lsb)
    run.tune(p)
    assert at(run, MOVING, 0.15) == before


@pytest.mark.parametrize("high_pass", ["none", "corner_1"])
@BOTH
def test_the_self_test_goes_the_way_of_the_signal(device: str, high_pass: str) -> None:
    # switched on, it shows what a step of rate and specific force of its size does, through every filter
    response, pushed = (0.1, 0.2, -0.3), (1.0, -2.0, 3.0)
    p = faultless(
        device,
        True,
        gyro__self_test_response=response,
        accelerometer__self_test_response=pushed,
        accelerometer__high_pass=HIGH_PASS.value(high_pass),
    )
    tested, driven = Run(MODEL, p, STILL), Run(MODEL, p, STILL)
    tested.tune(
        p._replace(gyro=p.gyro._replace(self_test=True), accelerometer=p.accelerometer._replace(self_test=True))
    )
    shares = set()
    for step in range(1, 60):
        tested.advance(STILL, 0.0005 * step)
        driven.advance(STILL._replace(rate=response, specific_force=pushed), 0.0005 * step)
        for one, other in zip(codes(tested), codes(driven), strict=True):
            assert abs(one - other) <= 1.0
        shares.add(codes(tested)[0] * p.gyro.resolution / response[0])
    assert len([share for share in shares if 0.05 < share < 0.95]) >= 2
    assert max(shares) == pytest.approx(1.0, rel=1e-6)


def test_the_adxl355_answers_its_self_test_as_the_sheet_says() -> None:
    assert faultless().accelerometer.self_test_response == pytest.approx((0.3 * 9.80665, 0.3 * 9.80665, 1.5 * 9.80665))


def test_a_checked_adxrs450_raises_every_fault_in_self_test_data() -> None:
    run = run_of(faultless(gyro__self_test=True), MOVING, 0.05)
    for word in run.outputs().register.gyro_word:
        frame = adxrs450_frame.decode_sensor_data(unsigned(word))
        assert frame.status == adxrs450_frame.SELF_TEST
        assert frame.faults == adxrs450_frame.ALL_FAULTS._replace(
            fail=0.0, amplitude=0.0, over_voltage=0.0, under_voltage=0.0
        )
        assert frame.parity_holds
