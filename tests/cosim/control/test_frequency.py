"""Measured frequency responses against closed forms and exact linear models; errors that are told; refusals."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

import control as ct
import matplotlib.pyplot as plt
import numpy as np
import pytest

from attitude_fmu.cosim.bench import benches
from attitude_fmu.cosim.characteristics import Sensor, perfect
from attitude_fmu.cosim.control.fmu_systems import fmu_nlsys
from attitude_fmu.cosim.control.frequency import MeasuredFrequencyResponse, Method, fmu_frd
from attitude_fmu.cosim.control.linear import model_ss
from attitude_fmu.cosim.errors import SystemRefusedError
from attitude_fmu.cosim.interface import read_interface

STEP = 0.01
HALF_NYQUIST = 0.5 * math.pi
"""times the sampling rate: half the Nyquist frequency in rad/s."""


def away(found: MeasuredFrequencyResponse, expected: ct.StateSpace) -> tuple[float, float]:
    """Largest error of gain (relative) and of phase (deg)."""
    exact = expected(np.exp(1j * found.frequency * found.dt), squeeze=False)
    ratio = found.frdata / exact
    return float(np.max(np.abs(np.abs(ratio) - 1.0))), float(np.max(np.abs(np.angle(ratio, deg=True))))


# --- closed forms


@pytest.mark.parametrize("method", ["multisine", "stepped"])
def test_an_integrator_is_dt_over_z_minus_one(slave: Callable[..., Path], method: str) -> None:
    omega = np.geomspace(2.0, 300.0, 12)
    found = fmu_frd(slave("integrator", saves=False), STEP, omega, "u", "x", method=method)  # type: ignore[arg-type]
    z = np.exp(1j * found.frequency * STEP)
    assert found.frdata[0, 0] == pytest.approx(STEP / (z - 1.0), rel=1e-9)
    assert found.coherence == pytest.approx(1.0)
    assert found.frequency == pytest.approx(omega, rel=0.2)  # five turns and odd ones only: moved by 1/5 at most
    assert (found.input_labels, found.output_labels, found.dt) == (["u"], ["x"], STEP)


@pytest.mark.parametrize(("delay", "gain"), [(1, 1.0), (0, 0.0)])
def test_the_delay_of_coupling_is_in_it(slave: Callable[..., Path], delay: int, gain: float) -> None:
    found = fmu_frd(slave("gain", saves=False), STEP, [3.0, 30.0, 200.0], "u", "y", {"k": -2.5}, coupling_delay=delay)
    assert found.frdata[0, 0] == pytest.approx(-2.5 * np.exp(-1j * gain * found.frequency * STEP), rel=1e-12)


@pytest.mark.parametrize("method", ["multisine", "stepped"])
def test_a_foreign_pendulum_is_its_own_linear_model(pendulum: Path, method: str) -> None:
    outputs = ["angle", "rate", "load"]
    with fmu_nlsys(pendulum, STEP, "torque", outputs) as system:
        linear = ct.linearize(system, 0.0, 0.0)
    omega = np.geomspace(1.0, HALF_NYQUIST / STEP, 12)
    # 40 s: the transient has gone by exp(-0.2 * 40)
    found = fmu_frd(pendulum, STEP, omega, "torque", outputs, amplitude=1e-3, transient=40.0, method=method)  # type: ignore[arg-type]
    gain, phase = away(found, linear)
    assert gain < 1e-3
    assert phase < 0.05


# --- our models: within 1 % and 1 deg up to half the Nyquist frequency


@pytest.fixture(scope="module")
def flawless(dist: Path) -> Mapping[str, float | str]:
    """Parameters of a sensor without errors and visible rounding; the processor's clock keeps step with the parts'."""
    fmu = dist / "AttitudeSensor.fmu"
    with benches(fmu, read_interface(fmu)) as made:
        return {**perfect(Sensor(made, {})).values, "processor.clock_error": 0.0}  # type: ignore[dict-item]


@pytest.mark.parametrize(
    ("part", "shown"), [("rate[1]", "rate_measured[1]"), ("specific_force[1]", "specific_force_measured[1]")]
)
def test_the_sensor_is_its_exact_linear_model(
    dist: Path, flawless: Mapping[str, float | str], part: str, shown: str
) -> None:
    step = 0.002
    omega = np.geomspace(10.0, HALF_NYQUIST / step, 15)
    found = fmu_frd(dist / "AttitudeSensor.fmu", step, omega, part, shown, flawless, amplitude=0.5, settle=4.0)
    gain, phase = away(found, model_ss("AttitudeSensor", step, flawless, inputs=part, outputs=shown))
    assert gain < 0.01
    assert phase < 1.0
    assert np.min(found.coherence) > 0.9999


def test_the_gimbal_is_its_exact_linear_model(dist: Path) -> None:
    step = 0.001
    axes = ("yaw", "pitch", "roll")
    # balanced and calm: the joints stay where they are, their friction below break-away is a spring
    still: dict[str, float | str] = {"wind.speed": 0.0, "shutter.impulse.pitch": 0.0}
    for body in ("yaw_frame", "pitch_frame", "camera"):
        still |= {f"{body}.center_of_gravity[{axis}]": 0.0 for axis in (1, 2, 3)}
    omega = np.geomspace(10.0, HALF_NYQUIST / step, 25)
    found = fmu_frd(
        dist / "TripodGimbal.fmu", step, omega, "motor_torque", "joint_rate", still,
        amplitude=1e-5, settle=2.0, transient=10.0, realisations=1, periods=2,
    )  # fmt: skip
    linear = model_ss("TripodGimbal", step, still, inputs="motor_torque", outputs="joint_rate")
    for axis in axes:
        part = found[f"joint_rate_{axis}", f"motor_torque_{axis}"]
        gain, phase = away(part, linear[f"joint_rate_{axis}", f"motor_torque_{axis}"])
        assert gain < 0.01
        assert phase < 1.0


# --- how far it can be trusted


def test_the_standard_error_is_that_of_the_error(dist: Path, flawless: Mapping[str, float | str]) -> None:
    # white noise of the gyro at 12 frequencies, with 4 sets of phases; the standard error is by the larger of two with
    # 12 and 2 degrees of freedom. 999 of 1000 such root mean squares lie between 0.70 and 1.29, half of them below 0.96
    def run(seed: int, parameters: Mapping[str, float | str]) -> MeasuredFrequencyResponse:
        return fmu_frd(
            dist / "AttitudeSensor.fmu", 0.002, np.geomspace(20.0, 700.0, 12), "rate[1]", "rate_measured[1]",
            parameters, amplitude=0.02, settle=4.0, periods=4, realisations=2, seed=seed,
        )  # fmt: skip

    clean = run(1, flawless)
    noisy = [run(seed, {**flawless, "gyro.noise_density": 5e-4}) for seed in (1, 2, 3, 4)]
    ratio = np.array([np.abs(one.frdata - clean.frdata) / one.standard_error for one in noisy])
    assert 0.70 < np.sqrt(np.mean(ratio**2)) < 1.29
    assert all(np.min(one.coherence) < 0.9999 for one in noisy)
    assert all(np.all(one.distortion.noise > 10.0 * clean.distortion.noise) for one in noisy)


def test_one_record_has_no_coherence(slave: Callable[..., Path]) -> None:
    found = fmu_frd(slave("gain", saves=False), STEP, [3.0, 30.0], "u", "y", periods=1, realisations=1)
    assert np.all(np.isnan(found.coherence))
    assert np.all(np.isnan(found.standard_error))


@pytest.mark.parametrize("method", ["multisine", "stepped"])
def test_a_transient_that_has_not_died_is_told(pendulum: Path, method: Method) -> None:
    # the slow pole, at -1.35/s, leaves exp(-0.7) after 0.5 s and exp(-13) after 10 s
    def run(transient: float) -> MeasuredFrequencyResponse:
        return fmu_frd(
            pendulum, STEP, np.geomspace(15.0, 150.0, 10), "torque", "angle", {"damping": 8.0},
            amplitude=1e-3, method=method, transient=transient,
        )  # fmt: skip

    with pytest.warns(UserWarning, match=r"angle from torque changes by .* % .* after 0\.5 s.*longer transient"):
        short = run(0.5)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        long = run(10.0)
    assert np.max(np.abs(short.frdata / long.frdata - 1.0)) > 0.005


def test_noise_is_no_transient(dist: Path, flawless: Mapping[str, float | str]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = fmu_frd(
            dist / "AttitudeSensor.fmu", 0.002, np.geomspace(20.0, 700.0, 12), "rate[1]", "rate_measured[1]",
            {**flawless, "gyro.noise_density": 5e-4}, amplitude=0.02, settle=4.0,
        )  # fmt: skip
    assert np.max(found.standard_error / np.abs(found.frdata)) > 0.005


def test_a_large_swing_shows_as_odd_distortion(pendulum: Path) -> None:
    omega = np.geomspace(1.0, 20.0, 8)
    small, large = (
        fmu_frd(pendulum, STEP, omega, "torque", "angle", amplitude=size, transient=40.0).distortion
        for size in (0.01, 3.0)
    )
    # a sine is odd: nothing on the even lines; what is left of the transient is below all
    assert large.odd > 100.0 * max(large.even, large.noise)
    assert large.odd > 100.0 * small.odd


# --- as an object of python-control


# an integrator's pole lies on the contour
@pytest.mark.filterwarnings("ignore::RuntimeWarning", "ignore:number of encirclements")
def test_it_goes_where_python_controls_frds_go(slave: Callable[..., Path]) -> None:
    found = fmu_frd(slave("integrator", saves=False), STEP, np.geomspace(0.5, 300.0, 60), "u", "x")
    exact = ct.tf([2.0 * STEP], [1.0, -1.0], STEP)
    (_, phase_margin, _, crossover), expected = ct.margin(2.0 * found), ct.margin(exact)
    assert phase_margin == pytest.approx(expected[1], abs=0.5)
    assert crossover == pytest.approx(expected[3], rel=0.02)
    closed = ct.feedback(2.0 * found, 1.0)
    z = np.exp(1j * found.frequency * STEP)
    assert closed.frdata[0, 0] == pytest.approx(exact(z) / (1.0 + exact(z)), rel=1e-9)
    assert found(z) == pytest.approx(found.frdata[0, 0], rel=1e-12)
    assert found(z.conj()) == pytest.approx(found.frdata[0, 0].conj(), rel=1e-12)
    assert ct.frequency_response(found, found.frequency).complex == pytest.approx(found.frdata[0, 0], rel=1e-12)
    assert abs(ct.nyquist_response(found).response) == pytest.approx(np.append(abs(found.frdata), STEP / 2.0), rel=0.05)


@pytest.mark.filterwarnings("ignore:number of encirclements")
def test_it_is_drawn_as_python_controls_own(slave: Callable[..., Path]) -> None:
    plt.switch_backend("agg")
    found = fmu_frd(slave("integrator", saves=False), STEP, np.geomspace(0.5, 300.0, 20), "u", "x")
    gain, phase = (axes.get_lines()[0] for axes in ct.bode_plot(found, omega_limits=None).axes.ravel())
    assert gain.get_xdata() == pytest.approx(found.frequency)
    assert gain.get_ydata() == pytest.approx(np.abs(found.frdata[0, 0]))
    assert np.exp(1j * np.radians(phase.get_ydata())) == pytest.approx(np.exp(1j * np.angle(found.frdata[0, 0])))
    plt.close("all")
    curves = ct.nyquist_plot(found).axes.ravel()[0].get_lines()
    drawn = np.concatenate([np.asarray(curve.get_xdata()) + 1j * np.asarray(curve.get_ydata()) for curve in curves])
    for value in found.frdata[0, 0, 5:]:
        assert np.nanmin(np.abs(drawn - value)) < 1e-6 * abs(value)
    plt.close("all")


def test_a_part_keeps_what_is_known_of_it(pendulum: Path) -> None:
    found = fmu_frd(pendulum, STEP, [2.0, 5.0, 20.0], ["torque", "damping"], ["angle", "rate"], amplitude=0.1)
    part = found["rate", "torque"]
    assert part.shape == (1, 1)
    assert np.array_equal(part.coherence, found.coherence[1:, :1])
    assert np.array_equal(part.standard_error, found.standard_error[1:, :1])
    assert part.distortion.odd == found.distortion.odd[1, 0]
    assert found.frdata.shape == found.coherence.shape == found.standard_error.shape == (2, 2, 3)


def test_progress_is_told(slave: Callable[..., Path]) -> None:
    heard: list[float] = []
    fmu_frd(slave("gain"), STEP, [10.0, 20.0, 40.0], "u", "y", method="stepped", progress=heard.append)
    assert heard == sorted(heard)
    assert heard[-1] == pytest.approx(1.0)
    assert len(heard) == 3


# --- refusals


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"omega": [10.0, 400.0]}, "between 0 and 314.159 rad/s"),
        ({"omega": [0.0, 10.0]}, "between 0 and"),
        ({"omega": []}, "between 0 and"),
        ({"method": "chirp"}, "one of multisine, stepped"),
        ({"periods": 0}, "at least 1"),
        ({"coupling_delay": 3}, "0 or 1"),
        ({"amplitude": 0.0}, "amplitude of torque = 0"),
        ({"amplitude": {"torqe": 1.0}}, "did you mean torque"),
        ({"inputs": "double"}, "only real inputs"),
        ({"inputs": "torqu"}, "did you mean torque"),
        ({"period": 0.02}, "at least four steps"),
        ({"omega": [300.0], "period": 0.05}, "too short"),
        ({"dt": 0.0}, "sampled system"),
    ],
)
def test_what_cannot_be_measured_is_refused(pendulum: Path, settings: dict[str, object], reason: str) -> None:
    asked = {"dt": STEP, "inputs": "torque", "outputs": "angle", **settings}
    with pytest.raises(SystemRefusedError) as caught:
        fmu_frd(pendulum, **asked)  # type: ignore[arg-type]
    assert reason in str(caught.value)
