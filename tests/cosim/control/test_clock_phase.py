"""Clocks that slip against each other: the linear model is the mean over their phases, as the FMU itself shows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest

from attitude_fmu.cosim.control import LinearisationRefusedError, fmu_frd, model_nlsys, model_noise, model_ss

BOARD = "AttitudeSensor"
TIED_PROCESSOR = {"processor.clock_error": 0.0}
"""Whose own phase against the master is another matter: it goes through dt once in 111 s."""

QUIET = {f"{part}.{term}": 0.0 for part in ("gyro", "accelerometer") for term in ("noise_density", "bias_instability")}
DT = 0.002


def system(output: str, phase: str, **more: float) -> control.StateSpace:
    source = output.replace("_measured", "")
    values = TIED_PROCESSOR | QUIET | more
    return model_ss(BOARD, DT, values, inputs=source, outputs=output, clock_phase=phase)  # type: ignore[arg-type]


EXACT = {f"gyro.clock_error[{axis}]": 0.0 for axis in (1, 2, 3)}
SENSES = 4
"""Of a word of the ADXRS450's model."""


def pulse_that_comes_late(late: int) -> Any:
    """What the whole model shows of 1 rad/s for one dt that begins so many senses after the clocks' ticks."""
    fine = model_nlsys(BOARD, DT / SENSES, TIED_PROCESSOR | QUIET | EXACT, inputs="rate[1]", outputs="rate_measured[1]")
    begun, steps = 10 * SENSES, 20 * SENSES
    shown = []
    for size in (0.0, 1.0):
        x, seen = fine.initial_state, []
        for k in range(steps):
            u = np.zeros(fine.ninputs)
            u[0] = size * (begun + late <= k < begun + late + SENSES)
            x = fine.dynamics(k * fine.dt, x, u)
            seen.append(fine.output((k + 1) * fine.dt, x, u)[0])
        shown.append(np.array(seen[begun + SENSES - 1 :: SENSES]))
    return shown[1] - shown[0]


def test_the_mean_is_that_of_the_model_itself_over_all_phases() -> None:
    """Inputs 0 to 3 senses late, each as likely; to the register's step and the sheet's nonlinearity of 0.05 %."""
    mean = system("rate_measured[1]", "mean")
    assert mean.state_labels == [*system("rate_measured[1]", "tied").state_labels, "rate[1].before"]
    expected = np.mean([pulse_that_comes_late(late) for late in range(SENSES)], axis=0)
    found = np.squeeze(control.impulse_response(mean, np.arange(11) * DT).outputs)[1:] * DT
    np.testing.assert_allclose(found, expected, atol=5e-4)


def test_a_clock_that_fits_is_tied_either_way() -> None:
    mean, tied = (system("rate_measured[1]", phase, **EXACT) for phase in ("mean", "tied"))
    np.testing.assert_array_equal(mean.A, tied.A)
    np.testing.assert_array_equal(mean.B, tied.B)


def test_a_word_that_waits_for_an_own_later_tick_keeps_its_wait() -> None:
    mean, tied = (system("specific_force_measured[1]", phase) for phase in ("mean", "tied"))
    np.testing.assert_array_equal(mean.A, tied.A)


@pytest.mark.parametrize(
    ("output", "phase", "gain"),
    [
        pytest.param("rate_measured[1]", 5.0, 0.04, marks=pytest.mark.slow),
        pytest.param("rate_measured[2]", 5.0, 0.04, marks=pytest.mark.slow),
        ("rate_measured[3]", 5.0, 0.04),
        ("specific_force_measured[1]", 5.0, 0.10),
    ],
)
def test_default_boards_linear_model_is_what_the_fmu_shows(dist: Path, output: str, phase: float, gain: float) -> None:
    """Up to half the Nyquist frequency, within the bounds of docs/control.md.

    A clock that is 2 % fast has a window 0.1 ms shorter, 4 deg and 3 % at 125 Hz; an accelerometer's wait is spread
    over 2 ms, 10 % of sinc there. Tied clocks would miss the rates by 28 deg.
    """
    source = output.replace("_measured", "")
    w = np.geomspace(20.0, 0.5 * np.pi / DT, 8)
    measured = fmu_frd(
        dist / f"{BOARD}.fmu",
        DT,
        w,
        source,
        output,
        TIED_PROCESSOR | QUIET,
        amplitude=0.5,
        settle=4.0,
        periods=3,
        realisations=3,
    )
    z = np.exp(1j * measured.frequency * DT)
    ratio = np.squeeze(measured.frdata) / np.array([np.squeeze(system(output, "mean")(one)) for one in z])
    assert np.degrees(np.abs(np.angle(ratio))).max() < phase
    assert np.abs(np.abs(ratio) - 1.0).max() < gain


def test_noise_model_has_the_same_way_from_inputs() -> None:
    noise = model_noise(BOARD, DT, TIED_PROCESSOR, inputs="rate[1]", outputs="rate_measured[1]")
    bare = model_ss(BOARD, DT, TIED_PROCESSOR, inputs="rate[1]", outputs="rate_measured[1]")
    for frequency in (1.0, 30.0, 200.0):
        z = np.exp(2j * np.pi * frequency * DT)
        np.testing.assert_allclose(noise.system(z), bare(z), rtol=1e-9, atol=1e-12)


def test_an_unknown_phase_is_refused() -> None:
    with pytest.raises(LinearisationRefusedError, match="mean, tied"):
        system("rate_measured[1]", "worst")
