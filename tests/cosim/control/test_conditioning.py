"""Gains for anti-windup and for switching on."""

from __future__ import annotations

import control
import numpy as np
import pytest
from scipy import linalg

from attitude_fmu.cosim.control.conditioning import anti_windup_gain, bumpless_gain, radius
from attitude_fmu.cosim.errors import ExportRefusedError


def matrices(system: control.StateSpace) -> tuple[np.ndarray, ...]:
    return system.A, system.B, system.C, system.D


def random_system(seed: int, n: int, p: int, m: int) -> control.StateSpace:
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    A *= rng.uniform(0.3, 0.99) / radius(A)
    return control.ss(A, rng.standard_normal((n, m)), rng.standard_normal((p, n)), rng.standard_normal((p, m)), 0.01)


def test_invertible_controller_is_conditioned_on_the_input_that_would_have_given_the_output() -> None:
    lead = control.ss([[0.5]], [[1.0]], [[-1.0]], [[4.0]], 0.01)  # zero at 0.75
    assert anti_windup_gain(*matrices(lead)) == pytest.approx(np.array([[0.25]]), rel=1e-14)


def test_zero_outside_the_circle_is_mirrored() -> None:
    system = control.ss([[0.9]], [[1.0]], [[-0.4]], [[0.2]], 0.01)
    A, B, C, D = matrices(system)
    assert control.zeros(system) == pytest.approx([2.9])
    assert radius(A - anti_windup_gain(A, B, C, D) @ C) == pytest.approx(1.0 / 2.9, rel=1e-9)


@pytest.mark.parametrize(
    "system",
    [
        control.ss([[1.0]], [[0.01]], [[5.0]], [[0.0]], 0.01),  # an integrator alone
        control.sample_system(control.ss(control.tf([1, 0], [1, 10])), 0.01),  # a zero at 1
        control.ss(np.diag([1.0, 0.4]), np.ones((2, 1)), [[0.05, -6.0]], [[12.0]], 0.01),  # PID
        control.ss([[1.2, 0.0], [0.3, 0.5]], [[1.0], [0.0]], [[0.0, 1.0]], [[0.0]], 0.01),  # unstable
        *[random_system(seed, n, p, m) for seed, (n, p, m) in enumerate([(1, 1, 1), (5, 2, 3), (6, 3, 2), (12, 3, 9)])],
    ],
)
def test_limited_controller_is_stable(system: control.StateSpace) -> None:
    A, B, C, D = matrices(system)
    assert radius(A - anti_windup_gain(A, B, C, D) @ C) < 1.0


def test_gain_does_not_depend_on_the_scale_of_the_states() -> None:
    A, B, C, D = matrices(random_system(3, 5, 2, 3))
    scale = np.array([1.0, 1e3, 1e-3, 1e2, 1e-2])
    scaled = A / scale[:, None] * scale, B / scale[:, None], C * scale
    assert scale[:, None] * anti_windup_gain(*scaled, D) == pytest.approx(anti_windup_gain(A, B, C, D), rel=1e-6)
    assert scale[:, None] * bumpless_gain(scaled[0], scaled[2]) == pytest.approx(bumpless_gain(A, C), rel=1e-6)


def test_mode_that_neither_decays_nor_shows_is_refused() -> None:
    with pytest.raises(ExportRefusedError, match="a mode that does not decay is not seen in the outputs"):
        anti_windup_gain(np.eye(2), np.eye(2), np.array([[1.0, 0.0]]), np.zeros((1, 2)))


def test_integrator_takes_the_whole_step_upon_itself() -> None:
    # C = (integral, derivative): the derivative's lag would forget its share
    gain = bumpless_gain(np.diag([1.0, 0.4]), np.array([[0.05, -6.0]]))
    assert gain == pytest.approx(np.array([[20.0], [0.0]]), abs=1e-9)


@pytest.mark.parametrize(("n", "p"), [(1, 1), (5, 2), (12, 1), (30, 3)])
def test_output_moves_by_what_was_asked_for(n: int, p: int) -> None:
    system = random_system(n, n, p, 3)
    assert system.C @ bumpless_gain(system.A, system.C) == pytest.approx(np.eye(p), abs=1e-12)


def test_output_stays_nearer_to_where_it_was_set_than_by_the_smallest_change_of_state() -> None:
    system = random_system(8, 6, 2, 1)
    smallest = linalg.pinv(system.C)

    def drift(gain: np.ndarray) -> float:
        state, total = system.A @ gain, 0.0
        for k in range(1, 5000):
            total += 0.999**k * float(((system.C @ state - np.eye(2)) ** 2).sum())
            state = system.A @ state
        return total

    assert drift(bumpless_gain(system.A, system.C)) < drift(smallest)
